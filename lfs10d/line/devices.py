"""The configured devices of one line, and what is learned of them; kept across reloads if unchanged. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from lfs10d.line.device import LEARNED_MOST, Device, DeviceSpec, PollRules
from lfs10d.modbus.outcome import Outcome

START_PATIENT = 8
"""With more silent devices than this at the start their time-out is at most 200 ms."""


class Devices(dict[str, Device]):
    """The devices by name; `by_slave` has them by slave id."""

    def __init__(self) -> None:
        super().__init__()
        self.by_slave: dict[int, Device] = {}

    def replace(self, specs: Iterable[DeviceSpec], rules: PollRules, *, port_lost: bool) -> list[Device]:
        """Take these devices in place of the old ones; return those that need a new grid.

        One that is enabled again, or whose slave id, profile or codec changed, is a new one on the line.
        """
        before = dict(self)
        self.clear()
        fresh: list[Device] = []
        for spec in specs:
            known = device = before.get(spec.name)
            if device is None or spec.begins_anew(device.spec):
                device = Device(spec, rules, spec.slave)
                if port_lost:
                    device.cut_off()
                fresh.append(device)
                if known is not None and known.spec.profile == spec.profile:
                    device.gap = known.gap
            elif device.spec.interval != spec.interval:
                fresh.append(device)
            if device.spec.profile is not spec.profile:
                device.reads.follow(spec.profile)
            device.spec, device.rules = spec, rules
            device.gap.configured = spec.request_gap
            self[spec.name] = device
        self.by_slave = {device.slave: device for device in self.values()}
        return fresh

    def learn(self, outcome: Outcome, *, doubtful: bool = False) -> None:
        """Learn response times, of late answers and of all kinds of requests; nothing from a `doubtful` answer."""
        for late in outcome.late:
            device = self.by_slave.get(late.request.slave)
            # What is later than any time-out says nothing of the usual time, and may be an older answer's.
            if device is not None and late.ours and late.latency <= LEARNED_MOST:
                device.response_times.learn(late.latency)
        if outcome.turnaround is not None and outcome.answer is not None and not doubtful:
            device = self.by_slave.get(outcome.request.slave)
            if device is not None:
                device.response_times.learn(outcome.turnaround)

    def forget_response_times(self) -> None:
        """Forget what was learned at another rate."""
        for device in self.values():
            device.response_times.forget()

    def hurry(self) -> None:
        """Use short time-outs for devices that are silent at the start, if they are many."""
        starting = [device for device in self.values() if device.starting]
        for device in starting if len(starting) > START_PATIENT else ():
            device.hurried = True
