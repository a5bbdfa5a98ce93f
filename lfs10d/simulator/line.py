"""The wire: who sends when, what collides, and what each party receives. Time is an argument.

`SimulatedLine` knows neither a clock nor a port: a master transmits at a time in nanoseconds, an `Adapter`
collects what has arrived by a time. In virtual time and on a pseudo terminal it is the same object.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from heapq import heappop, heappush
from random import Random

from lfs10d.simulator.burst import MASTER, Burst, Receiver, collide
from lfs10d.simulator.judge import HeardRequest, Judge, JudgeReport
from lfs10d.simulator.sensor import Reply, Sensor
from lfs10d.simulator.wind import Unique
from lfs10d.simulator.wire import Format, Framing, nanoseconds, unseal


class SimulatedLine:
    """Sensors on one pair of wires, and a judge who hears the master. Append sensors and faults at any time."""

    def __init__(
        self,
        sensors: Iterable[Sensor] = (),
        *,
        format: Format | None = None,  # noqa: A002  # the word for it
        framing: Framing = "rtu",
        seed: int = 0,
        keep_log: bool = True,
    ) -> None:
        self.format = format or Format()
        """Of noise and of a second master; every sensor and adapter has its own."""
        self.framing: Framing = framing
        self.judge = Judge(framing)
        self.log: list[HeardRequest] = []
        """Every request in order with its answers, while `keep_log`."""
        self.keep_log = keep_log
        self.random = Random(seed)  # noqa: S311  # repeatable noise, no secret
        self.sensors: list[Sensor] = []
        self.now = 0
        self.answered = 0
        self._receivers: list[Receiver] = []
        self._bursts: list[Burst] = []
        self._events: list[tuple[int, int, Callable[[int], None]]] = []
        self._event_count = 0
        self._quiet_since: tuple[int, Format] | None = None
        self._handed = 0
        self._dead: int | None = None
        self._unique = Unique()
        self._troubles: list[Callable[[HeardRequest], None]] = []
        for sensor in sensors:
            self.add(sensor)

    def add(self, sensor: Sensor) -> Sensor:
        """Put a sensor on the line; without a source of its own it gets values unique on this line."""
        if isinstance(sensor.source, Unique):
            sensor.source = self._unique
        self.sensors.append(sensor)
        return sensor

    def sensor(self, slave: int) -> Sensor:
        """Return the first sensor that has this id now; KeyError if none has."""
        for sensor in self.sensors:
            if sensor.slave == slave:
                return sensor
        raise KeyError(slave)

    def attach(self, receiver: Receiver) -> None:
        """Let a receiver hear what is sent from now on."""
        self._receivers.append(receiver)

    def after_each_request(self, trouble: Callable[[HeardRequest], None]) -> None:
        """Call this with every request that was heard, right after the sensors heard it."""
        self._troubles.append(trouble)

    def at(self, when: float, action: Callable[[int], None]) -> None:
        """Call `action(now)` when the line's time reaches `when` (s)."""
        self.at_nanosecond(nanoseconds(when), action)

    def at_nanosecond(self, when: int, action: Callable[[int], None]) -> None:
        """Call `action(now)` when the line's time reaches `when` (ns)."""
        self._event_count += 1
        heappush(self._events, (when, self._event_count, action))

    def next_event(self) -> int | None:
        """Return when something is next decided on the line, None if nothing is pending."""
        return self._events[0][0] if self._events else None

    def advance(self, now: int) -> None:
        """Let everything happen that is due by `now`."""
        events = self._events
        while events and events[0][0] <= now:
            when, _, action = heappop(events)
            self.now = max(self.now, when)
            action(when)
        self.now = max(self.now, now)

    def transmit(self, data: bytes, now: int, shape: Format) -> int:
        """Send bytes of the master from `now` on (or behind its own bytes under way); return their end."""
        self.advance(now)
        start = now
        busy = False
        for burst in self._bursts:
            if burst.speaker is MASTER and now < burst.ends[-1]:
                start = burst.ends[-1]
            elif burst.speaker is not MASTER and burst.ends[0] <= now < burst.ends[-1]:
                busy = True  # of a byte that is not over nobody can know: that request is struck
        self._retire(start)
        quiet_since, slower = None, shape
        if self._quiet_since is not None:
            quiet_since = max(self._quiet_since[0], min(self._handed, start))
            if self._quiet_since[1].t35 > shape.t35:
                slower = self._quiet_since[1]
        hearing = self.judge.listen(data, start, shape, quiet_since=quiet_since, slower=slower, busy=busy)
        burst = Burst(MASTER, start, bytearray(data), shape.ends(start, len(data)), shape)
        end = burst.ends[-1]
        self._put(burst)
        self.at_nanosecond(end, lambda when: self._settle(hearing, burst, when))
        return end

    def speak(self, speaker: object, data: bytes, start: int, shape: Format | None = None, pause: int = 0) -> Burst:
        """Send bytes of anybody else from `start` on, whatever else is on the line."""
        shape = shape or self.format
        burst = Burst(speaker, start, bytearray(data), shape.ends(start, len(data), pause), shape)
        self._put(burst)
        return burst

    def power_cut(self, now: float, sensors: Sequence[Sensor] | None = None) -> None:
        """Cut the power of these sensors (or all); what they are saying ends at once."""
        self.advance(nanoseconds(now))
        for sensor in self.sensors if sensors is None else sensors:
            sensor.power_cut()
            for burst in self._bursts:
                if burst.speaker is sensor:
                    burst.cut(nanoseconds(now))
        self._bursts = [burst for burst in self._bursts if burst.ends]

    def power_up(self, sensors: Sequence[Sensor] | None = None) -> None:
        """Give these sensors (or all) their power back."""
        for sensor in self.sensors if sensors is None else sensors:
            sensor.power_up()

    def handed_over(self, now: int) -> None:
        """Count the line as busy until `now`: the last byte was handed over later than it was over (a pty)."""
        self._handed = now

    def strike(self, now: int) -> None:
        """Spoil what the master is sending at `now`: its rate was changed under the bytes."""
        for burst in self._bursts:
            if burst.speaker is MASTER and burst.start <= now < burst.ends[-1]:
                burst.struck = True

    def _retire(self, now: int) -> None:
        """Forget bursts that are over by `now`, but remember when the last byte ended."""
        kept = []
        for burst in self._bursts:
            end = burst.ends[-1]
            if end > now:
                kept.append(burst)
            elif self._quiet_since is None or end > self._quiet_since[0]:
                self._quiet_since = (end, burst.format)
        self._bursts = kept

    def _put(self, burst: Burst) -> None:
        for other in self._bursts:
            if other.start < burst.ends[-1] and burst.start < other.ends[-1]:
                collide(other, burst)
                if not burst.ends:
                    break
        self._bursts = [other for other in (*self._bursts, burst) if other.ends]
        if burst.ends:
            for receiver in self._receivers:
                receiver.offer(burst)

    def _settle(self, hearing: HeardRequest, burst: Burst, now: int) -> None:
        """Judge the master's request at the end of its bytes; if it is heard, let the sensors hear it."""
        if self.judge.settle(hearing, struck=burst.struck) is None:
            self.at_nanosecond(self.judge.patience(hearing), lambda when: self._give_up(hearing, when))
            return
        hearing.ended = now
        self.carry(hearing, burst, now)

    def _give_up(self, hearing: HeardRequest, now: int) -> None:
        """Let what was never completed be no request; sensors that such things upset are upset."""
        if self.judge.expire(hearing, now) is None:
            return
        if self.keep_log:
            self.log.append(hearing)
        for sensor in self.sensors:
            if sensor.format == hearing.format:
                sensor.disturb(now)

    def carry(self, request: HeardRequest, burst: Burst, now: int) -> None:
        """Bring a request, at its end, to the sensors and their answers onto the line."""
        if self.keep_log:
            self.log.append(request)
        if request.verdict is not JudgeReport.HEARD or burst.struck:
            return
        replies = self._ask(request, burst.format, now)
        if request.body:
            self._dead = None if replies or request.body[0] == 0 else request.body[0]
        for reply in replies:
            self._answer(request, reply)
        for trouble in self._troubles:
            trouble(request)

    def _ask(self, request: HeardRequest, shape: Format, now: int) -> list[Reply]:
        bodies: dict[str, bytes | None] = {}
        replies: list[Reply] = []
        for sensor in self.sensors:
            if sensor.faults:
                sensor.restore(now)
            if (sensor.format is not shape and sensor.format != shape) or sensor.framing != self.framing:
                continue
            check = sensor.blueprint.check
            if check not in bodies:
                bodies[check] = unseal(request.frame, self.framing, check)
            body = bodies[check]
            if body is not None:
                request.body = body
                reply = sensor.hear(body, now, after_dead=self._dead not in (None, body[0]))
                if reply is not None:
                    replies += (reply, *reply.following)
        return replies

    def _answer(self, request: HeardRequest, reply: Reply) -> None:
        self.answered += 1
        reply.burst = self.speak(reply.sensor, reply.data, reply.start, reply.format, reply.pause)
        request.answers.append(reply)
