"""The line's time budget: what the configured polls cost, computed, not measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from lfs10d.config.models import Config, LineConfig, SlaveConfig
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.modbus.request import ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.profile import Profile

ASSUMED_TURNAROUND = 0.005
"""Seconds a slave thinks before it answers, where a figure is wanted before it was measured."""

LONGEST_LEARNED_TIMEOUT = 1.0
"""Seconds: the upper bound of a learned time-out."""


@dataclass(frozen=True, slots=True)
class LoadShare:
    """What one device takes of the line. `wire` is the time of one poll without turnaround, in seconds.

    `exchanges` make one poll, with `rest` s in all in which the device must be left in peace, and others are polled.
    `load` and `load_with_turnaround` are parts of one: of the device's own time, its rest included, so that with more
    than 1 it cannot be polled so often even if it is alone; None for interval 0, which takes what the others leave.
    `slowest` is a poll whose answers all begin at the last moment.
    """

    device: str
    slave: int
    profile: str
    interval: float
    exchanges: int
    wire: float
    rest: float
    load: float | None
    load_with_turnaround: float | None
    slowest: float


@dataclass(frozen=True, slots=True)
class Budget:
    """The shares of all enabled devices, and their sums."""

    gap: float
    shares: tuple[LoadShare, ...]

    @property
    def load(self) -> float:
        """Part of the line's time that the polls with an interval take, without turnaround: 1.0 is all of it.

        While one device rests others are polled; so it is the sum of what goes over the wire, but no less than the
        load of the device that has the greatest.
        """
        return max([self.wire_load, *(share.load or 0.0 for share in self.shares)])

    @property
    def load_with_turnaround(self) -> float:
        """The same with a turnaround of 5 ms."""
        return max([self.wire_load_with_turnaround, *(share.load_with_turnaround or 0.0 for share in self.shares)])

    @property
    def wire_load(self) -> float:
        """The same of what goes over the wire alone, without the rests, in which others are polled."""
        return sum(share.wire / share.interval for share in self.shares if share.interval)

    @property
    def wire_load_with_turnaround(self) -> float:
        """The same with a turnaround of 5 ms."""
        waited = ((share.wire + share.exchanges * ASSUMED_TURNAROUND, share.interval) for share in self.shares)
        return sum(taken / interval for taken, interval in waited if interval)

    @property
    def shortest_cycle(self) -> float:
        """Seconds in which every device can be polled once, without turnaround."""
        alone = (share.wire + share.rest for share in self.shares)
        return max(sum(share.wire for share in self.shares), *alone, 0.0)

    @property
    def slowest_cycle(self) -> float:
        """Seconds for every device once, if each answer begins at the end of its time-out."""
        alone = (share.slowest + share.rest for share in self.shares)
        return max(sum(share.slowest for share in self.shares), *alone, 0.0)


def timing_of(line: LineConfig) -> LineTiming:
    """Return the times of the configured line."""
    return LineTiming.of(
        line.baudrate,
        databits=line.databits,
        parity=line.parity,
        stopbits=line.stopbits,
        extra_gap=line.extra_gap,
    )


def request_gap(slave: SlaveConfig, profile: Profile) -> float:
    """Return the rest in s that a device is given between two exchanges."""
    return max(slave.request_gap, profile.request_gap)


def budget(config: Config, profiles: Mapping[str, Profile]) -> Budget:
    """Return the budget of a resolved configuration; `profiles` by `SlaveConfig.profile`."""
    timing = timing_of(config.line)
    framing = Framing(config.line.framing)
    return Budget(
        gap=timing.gap,
        shares=tuple(
            _share(slave, profiles[slave.profile], timing, framing) for slave in config.slaves if slave.enabled
        ),
    )


def _share(slave: SlaveConfig, profile: Profile, timing: LineTiming, framing: Framing) -> LoadShare:
    codec = Codec(framing, Checksum(slave.checksum or profile.checksum))
    requests = [ReadRegisters(slave.id, read.address, read.count, read.function) for read in profile.reads()]
    wire = sum(timing.exchange(len(codec.encode(request)), codec.answer_size(request)) for request in requests)
    timeout = LONGEST_LEARNED_TIMEOUT if slave.response_timeout is None else slave.response_timeout
    waited = wire + len(requests) * ASSUMED_TURNAROUND
    rest = len(requests) * max(0.0, request_gap(slave, profile) - timing.gap)
    return LoadShare(
        device=slave.name,
        slave=slave.id,
        profile=slave.profile,
        interval=slave.interval,
        exchanges=len(requests),
        wire=wire,
        rest=rest,
        load=(wire + rest) / slave.interval if slave.interval else None,
        load_with_turnaround=(waited + rest) / slave.interval if slave.interval else None,
        slowest=wire + len(requests) * timeout,
    )
