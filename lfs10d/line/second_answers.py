"""Valid frames that answer no request of ours: another master's traffic, second answers to one request. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lfs10d.line.device import Device
from lfs10d.line.doubtful_answers import DoubtfulAnswers
from lfs10d.line.held_readings import HeldReadings
from lfs10d.line.quiet_watch import QuietWatch
from lfs10d.line.unproved_answers import PROVED_WITHIN
from lfs10d.modbus import diagnosis
from lfs10d.modbus.exchange import FAULT_HEARD
from lfs10d.modbus.frames import EXCEPTION_FLAG, Codec
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.overhearing import Overhearing
from lfs10d.modbus.pending import PendingRequests
from lfs10d.reading import AnsweredTwice, Fault, FaultCode, Reading

EXPLAINED = 1.0
"""Seconds after another master's frame in which spoilt exchanges are attributed to it."""


class SecondAnswers:
    """Watches the configured devices of one line; what other masters ask goes to `pending`."""

    def __init__(self, pending: PendingRequests) -> None:
        self._pending = pending
        self._overhearing = Overhearing()
        self._devices: Mapping[int, Device] = {}
        self._asked_by_another: dict[int, float] = {}
        self.quiet = QuietWatch(pending.duplicates, 0.0)
        """Until its `until` nobody is asked, so that a second answer is heard."""
        self._doubts = DoubtfulAnswers(pending.duplicates)
        self._doubted: dict[int, float] = {}
        """The slaves whose last answer was not believed, with the last bit of its request: another answer to that, and
        nothing else being owed, is one too many."""
        self.held = HeldReadings()

    def watch(self, devices: Mapping[int, Device]) -> None:
        """Watch these devices, by slave id, from now on."""
        self._devices = devices
        self._doubted = {slave: sent_end for slave, sent_end in self._doubted.items() if slave in devices}
        self._overhearing.listen_to({slave: device.spec.codec for slave, device in devices.items()})

    def is_doubtful(self, outcome: Outcome, timeout: float) -> bool:
        """Take an outcome at the line's rate; whether its answer may be a second one to the request before."""
        for late in outcome.late:
            if late.request.slave in self._doubted:
                self._spoil(late.request.slave, outcome.ended, outcome.heard[-FAULT_HEARD:])
        slave = outcome.request.slave
        device = self._devices.get(slave)
        if device is None:
            return False
        self._doubted.pop(slave, None)
        by_another = self._asked_by_another
        if outcome.answer is not None and by_another and by_another.get(slave, float("-inf")) >= outcome.asked:
            # It began before the exchange, which saw the rest of it only.
            self._pending.duplicates.rest(slave, outcome.ended + timeout)
            return True
        explained = bool(by_another) and outcome.ended - max(by_another.values()) <= EXPLAINED
        if not explained and (outcome.fault is not None or outcome.unsolicited):
            self.quiet.exchanged(outcome, online=device.online)
        tardy = slave in self._pending.tardy
        doubtful = self._doubts.exchanged(outcome, device.response_times, timeout, tardy=tardy, explained=explained)
        if doubtful and outcome.sent_end is not None:
            self._doubted[slave] = outcome.sent_end
            self._pending.unanswered(outcome.request, device.spec.codec, outcome.sent_end)
        if outcome.strays and _broken(outcome, device.spec.codec):
            self._doubt_held(outcome, explained=explained)
        elif not outcome.heard and device.online and outcome.began is not None and not tardy:
            self._doubt_held(outcome, explained=explained, silent=True)
        self._pending.barrier_first.discard(slave)
        if self._doubts.unproved(slave):
            self._demand_proof(device, outcome.ended)
        return doubtful

    def _doubt_held(self, outcome: Outcome, *, explained: bool, silent: bool = False) -> None:
        """Let held readings fail whose slave's own answer may be the broken one in this exchange.

        Or, of the slave that was `silent`, what was not heard because our request fell into it. When it came nobody
        knows: it may have lain unread.
        """
        for slave, device in self._devices.items():
            own = slave == outcome.request.slave
            told = not explained or self._pending.duplicates.extras(slave) > 0
            held = (own or not silent) and told and self.held.holds(device.name, outcome.asked)
            if held and self._doubts.doubt(slave, outcome.ended, silent=silent, own=own):
                fault = Fault(FaultCode.COLLISION, diagnosis.RUN_INTO, heard=outcome.heard[-FAULT_HEARD:])
                self.held.spoil(device.name, fault)

    def _spoil(self, slave: int, at: float, heard: bytes) -> None:
        """Let the held readings of a slave fail: a frame of it, received at `at`, is one too many."""
        fault = Fault(FaultCode.COLLISION, diagnosis.UNDECIDED, heard=heard)
        self.held.spoil(self._devices[slave].name, fault, at=at)
        self._doubts.decided(slave)

    def _demand_proof(self, device: Device, now: float) -> None:
        """Have a slave asked its barrier where its answers are unproved for long; left alone if that does not help."""
        slave = device.slave
        if self._doubts.overdue(slave, now):
            self._pending.barrier_first.add(slave)
        if self._doubts.overdue(slave, now if device.spec.profile.barrier is None else now - PROVED_WITHIN):
            self._pending.duplicates.rest(slave, self._doubts.held_until(slave))

    def prove(self, outcome: Outcome, readings: list[Reading]) -> list[Reading]:
        """Take the readings of an outcome; return those to be published, and hold the others back."""
        slave = outcome.request.slave
        device = self._devices.get(slave)
        if device is None:
            return readings
        doubts = self._doubts
        if not doubts.unproved(slave):
            return [*self.held.released(device=device.name), *readings] if self.held.entries else readings
        until, own_by = doubts.held_until(slave), doubts.own_by(slave)
        proved: list[Reading] = []
        if doubts.proved(slave):
            proved += self.held.released(device=device.name)
        else:
            self.held.extend(device.name, until, own_by)
        self.held.hold(readings, until, own_by)
        return proved

    def on_answer(self, outcome: Outcome) -> list[AnsweredTwice]:
        """Take an outcome that the scheduler knows of: a second answer may follow it, or none does any more."""
        device = self._devices.get(outcome.request.slave)
        if device is None or outcome.answer is None:
            return []
        request, barrier = outcome.request, device.spec.profile.barrier
        is_barrier = barrier is not None and (
            (request.address, request.function) == (barrier.address, barrier.function)
            and len(outcome.answer) == barrier.count
        )
        ended = self._pending.duplicates.answered(device.slave, outcome.ended, barrier=is_barrier)
        self.quiet.answered(device.slave, outcome.ended)
        return [AnsweredTwice(outcome.ended, device.name, device.slave, None)] if ended else []

    def on_strays(self, strays: Iterable[tuple[bytes, float]], outcome: Outcome | None = None) -> list[AnsweredTwice]:
        """Take bytes that belong to no exchange, or are left over by `outcome`, with the times of the pieces.

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
                self._doubts.spoke(frame.slave, frame.at)
                continue
            size = codec.size(len(frame.body))
            exception = frame.body[2] if frame.body[1] & EXCEPTION_FLAG else None
            owed = self._pending.overheard(frame.slave, size, exception=exception, now=frame.at)
            if owed and frame.slave in self._doubted:
                owed = self._pending.owes_besides(frame.slave, self._doubted[frame.slave])
                self._spoil(frame.slave, frame.at, codec.wrap(frame.body))
            second = not owed and frame.slave != owing
            self._doubts.spoke(frame.slave, frame.at, second=second)
            if not second:
                continue
            twice = self._pending.duplicates.second(frame.slave, frame.at, misplaced=owing is not None)
            self.quiet.second(frame.slave, frame.at)
            self._spoil(frame.slave, frame.at, codec.wrap(frame.body))
            if twice is not None:
                fault = Fault(FaultCode.DUPLICATE_ID, diagnosis.twice(twice), heard=codec.wrap(frame.body))
                events.append(AnsweredTwice(frame.at, device.name, frame.slave, fault))
        return events


def _broken(outcome: Outcome, codec: Codec) -> bool:
    """Whether anything came in an exchange that is part of no right frame, our own request left out."""
    strays = b"".join(data for data, _ in outcome.strays).replace(outcome.sent, b"")
    frames = codec.frames(strays, outcome.request.slave, codec.answer_size(outcome.request))
    return sum(end - begin for begin, end, _ in frames) < len(strays)
