"""The line's time budget: the time that the configured polls take, computed. What is measured: `telemetry.counters`."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.config.models import Config, LineConfig, SlaveConfig
from lfs10d.line.read_plan import part_of_polls
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.modbus.request import ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.profile import Profile
from lfs10d.system.dataclass import dataclass

ASSUMED_TURNAROUND = 0.005
"""Assumed response time of a slave in s, before it is measured."""

LONGEST_LEARNED_TIMEOUT = 1.0
"""Seconds: the upper bound of a learned time-out."""


@dataclass(frozen=True, slots=True)
class LoadShare:
    """The line time of one device. `wire` is the time of a usual poll without turnaround, in seconds.

    `exchanges` make a usual poll, with `rest` s in all in which the device must be left in peace, and others are
    polled. The longest poll reads the slow values too (those with an interval of their own): `longest_wire` and
    `longest_rest` are the same of it.
    Loads are parts of one, each read counted as often as it is asked: `load` and `load_with_turnaround` of the
    device's own time, its rest included, so that with more than 1 it cannot be polled so often even if it is alone;
    `wire_load` and `wire_load_with_turnaround` of the line's time, without the rest. None for interval 0, which takes
    what the others leave. `slowest` is the longest poll if its answers all begin at the last moment.
    """

    device: str
    slave: int
    profile: str
    interval: float
    exchanges: int
    wire: float
    rest: float
    longest_wire: float
    longest_rest: float
    load: float | None
    load_with_turnaround: float | None
    wire_load: float | None
    wire_load_with_turnaround: float | None
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
        """The load of the wire time alone, without the rests, in which others are polled."""
        return sum(share.wire_load or 0.0 for share in self.shares)

    @property
    def wire_load_with_turnaround(self) -> float:
        """The same with a turnaround of 5 ms."""
        return sum(share.wire_load_with_turnaround or 0.0 for share in self.shares)

    @property
    def shortest_cycle(self) -> float:
        """Seconds in which every device can be polled once as usual, without turnaround."""
        alone = (share.wire + share.rest for share in self.shares)
        return max(sum(share.wire for share in self.shares), *alone, 0.0)

    @property
    def slowest_cycle(self) -> float:
        """Seconds to poll every device once, slow values too, if each answer begins at the end of its time-out."""
        alone = (share.slowest + share.longest_rest for share in self.shares)
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
    timeout = LONGEST_LEARNED_TIMEOUT if slave.response_timeout is None else slave.response_timeout
    rest = max(0.0, request_gap(slave, profile) - timing.gap)
    wires: list[float] = []
    parts: list[float] = []
    for read in profile.reads():
        request = ReadRegisters(slave.id, read.address, read.count, read.function)
        wires.append(timing.exchange(len(codec.encode(request)), codec.answer_size(request)))
        parts.append(part_of_polls(profile, read, slave.interval))
    usual = [wire for wire, part in zip(wires, parts, strict=True) if part == 1.0]

    def load(more: float) -> float | None:
        """Return the load if each read takes `more` s in addition."""
        taken = sum(part * (wire + more) for wire, part in zip(wires, parts, strict=True))
        return taken / slave.interval if slave.interval else None

    return LoadShare(
        device=slave.name,
        slave=slave.id,
        profile=slave.profile,
        interval=slave.interval,
        exchanges=len(usual),
        wire=sum(usual),
        rest=len(usual) * rest,
        longest_wire=sum(wires),
        longest_rest=len(wires) * rest,
        load=load(rest),
        load_with_turnaround=load(rest + ASSUMED_TURNAROUND),
        wire_load=load(0.0),
        wire_load_with_turnaround=load(ASSUMED_TURNAROUND),
        slowest=sum(wires) + len(wires) * timeout,
    )
