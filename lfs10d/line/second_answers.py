"""Valid frames that answer no request of ours: another master's traffic, second answers to one request. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lfs10d.line.device import Device
from lfs10d.line.doubtful_answers import DoubtfulAnswers
from lfs10d.line.held_readings import HeldReadings
from lfs10d.line.quiet_watch import QuietWatch, spoilt
from lfs10d.modbus import diagnosis
from lfs10d.modbus.exchange import FAULT_HEARD
from lfs10d.modbus.frames import EXCEPTION_FLAG
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.overhearing import Overhearing
from lfs10d.modbus.pending import PendingRequests
from lfs10d.reading import AnsweredTwice, Fault, FaultCode, Reading

EXPLAINED = 1.0
"""So long after another master was heard what is spoilt is its doing, in s."""


class SecondAnswers:
    """Watches the configured devices of one line; what other masters ask goes to `pending`."""

    def __init__(self, pending: PendingRequests) -> None:
        self._pending = pending
        self._overhearing = Overhearing()
        self._devices: Mapping[int, Device] = {}
        self._asked_by_another: dict[int, float] = {}
        self._quiet = QuietWatch(pending.duplicates, 0.0)
        self._doubts = DoubtfulAnswers(pending.duplicates)
        self.held = HeldReadings()

    @property
    def quiet_until(self) -> float:
        """Until when nobody is asked, so that a second answer is heard."""
        return self._quiet.until

    def watch(self, devices: Mapping[int, Device]) -> None:
        """Watch these devices, by slave id, from now on."""
        self._devices = devices
        self._overhearing.listen_to({slave: device.spec.codec for slave, device in devices.items()})

    def is_doubtful(self, outcome: Outcome, timeout: float) -> bool:
        """Take an outcome at the line's rate; whether its answer may be a second one to the request before."""
        device = self._devices.get(outcome.request.slave)
        if device is None:
            return False
        by_another = self._asked_by_another.get(outcome.request.slave, float("-inf")) >= outcome.asked
        if by_another and outcome.answer is not None:  # it began before the exchange, which saw the rest of it only
            self._pending.duplicates.rest(device.slave, outcome.ended + timeout)
            return True
        if outcome.ended - max(self._asked_by_another.values(), default=float("-inf")) <= EXPLAINED:
            return False
        self._quiet.exchanged(outcome, online=device.online)
        doubtful = self._doubts.exchanged(outcome, device.response_times, timeout)
        broken = outcome.strays and spoilt(outcome)
        if broken and diagnosis.stranger(outcome.request, device.spec.codec, outcome.heard) is None:
            self._doubt_held(outcome.strays[0][1], outcome)
        return doubtful

    def _doubt_held(self, broken_at: float, outcome: Outcome) -> None:
        """Let the readings fail whose slaves' own answers may be what came broken in this exchange from then on."""
        for slave, device in self._devices.items():
            if self.held.holds(device.name, broken_at) and self._doubts.doubt(slave, outcome.ended):
                fault = Fault(FaultCode.COLLISION, diagnosis.RUN_INTO, heard=outcome.heard[-FAULT_HEARD:])
                self.held.spoil(device.name, broken_at, fault)

    def on_answer(self, outcome: Outcome) -> list[AnsweredTwice]:
        """Take an outcome that the scheduler knows of: a second answer may follow it, or none does any more."""
        device = self._devices.get(outcome.request.slave)
        if device is None or outcome.answer is None:
            return []
        request, barrier = outcome.request, device.spec.profile.barrier
        is_barrier = barrier is not None and (
            (request.address, request.function) == (barrier.register, barrier.function)
            and len(outcome.answer) == barrier.count
        )
        ended = self._pending.duplicates.answered(device.slave, outcome.ended, barrier=is_barrier)
        self._quiet.answered(device.slave, outcome.ended)
        return [AnsweredTwice(outcome.ended, device.name, device.slave, None)] if ended else []

    def prove(self, outcome: Outcome, readings: list[Reading]) -> list[Reading]:
        """Take the readings of an outcome; return those that are to be published, and hold back the others."""
        proved: list[Reading] = []
        until = self._doubts.proved_at(outcome.request.slave)
        for reading in readings:
            proved += self.held.released(device=reading.device)
            if reading.values is None or until <= outcome.ended:
                proved.append(reading)
            else:
                self.held.hold([reading], until, self._doubts.own_by(outcome.request.slave))
        return proved

    def on_strays(self, strays: Iterable[tuple[bytes, float]], outcome: Outcome | None = None) -> list[AnsweredTwice]:
        """Take what was heard and belongs to no exchange, or is left over by `outcome`, with the times of its pieces.

        A right frame of a slave that owes nothing is one answer too many.
        """
        events: list[AnsweredTwice] = []
        owing = outcome.request.slave if outcome is not None and outcome.answer is None else None
        for frame in self._overhearing.hear(strays):
            device = self._devices[frame.slave]
            codec = device.spec.codec
            if frame.request is not None:
                self._pending.asked_by_another(frame.request, codec, frame.at)
                self._asked_by_another[frame.slave] = frame.at
                continue
            size, exception = codec.size(len(frame.body)), bool(frame.body[1] & EXCEPTION_FLAG)
            owed = self._pending.overheard(frame.slave, size, exception=exception, now=frame.at)
            if owed or frame.slave == owing:
                continue
            twice = self._pending.duplicates.second(frame.slave, frame.at, misplaced=owing is not None)
            self._quiet.second(frame.slave, frame.at)
            self.held.spoil(
                device.name, frame.at, Fault(FaultCode.COLLISION, diagnosis.UNDECIDED, heard=codec.wrap(frame.body))
            )
            if twice is not None:
                fault = Fault(FaultCode.DUPLICATE_ID, diagnosis.twice(twice), heard=codec.wrap(frame.body))
                events.append(AnsweredTwice(frame.at, device.name, frame.slave, fault))
        return events
