"""The oracle finds what is wrong: each test publishes one thing that no daemon may."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from lfs10d.modbus.port_settings import PortSettings
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import seal
from soak.attestation import LOOKS, Attested, Oracle, codes, epoch_of, parsed
from tests.support.faulty_sensors import add_fault
from tests.support.virtual_port import SimulatedPort, VirtualClock

EPOCH = 1_700_000_000
READ = bytes((3, 0, 1, 0, 2))


class Wire:
    """A line with sensors 1 and 2 that a test asks by hand, at 1, 2, 3 ... s."""

    def __init__(self, **faults: float) -> None:
        self.line = SimulatedLine([Sensor(1), Sensor(2)])
        for kind, rate in faults.items():
            add_fault(self.line.sensor(1), kind, rate)
        self.clock = VirtualClock()
        self.port = SimulatedPort(self.line, self.clock, PortSettings("/dev/simulated", 9600))
        self.port.open()
        self.handed: list[tuple[float, bytes]] = []

    def ask(self, slave: int) -> dict[str, Any]:
        """Ask, and return the sample that a believing master publishes."""
        self.clock.now = float(int(self.clock.now) + 1)
        self.port.write(seal(bytes((slave,)) + READ))
        self.clock.now += 0.5
        self.handed.append((self.clock.now, self.port.read()))
        (answer,) = self.line.log[-1].answers
        (value,) = answer.values or (0.0,)
        return sample(value, ts=round((EPOCH + self.clock.now) * 1000))

    def judge(self, slave: int, *samples: dict[str, Any]) -> Attested:
        return Oracle(self.line.log, self.handed, epoch=EPOCH).judge(f"slave-{slave}", slave, samples)


def sample(value: float | None, **changes: object) -> dict[str, Any]:
    good = value is not None
    plain = {"seq": 1, "ts": EPOCH * 1000, "wind_speed": value, "quality": "good" if good else "bad"}
    return {**plain, "error": None if good else "timeout", "rtt_ms": 25.0 if good else None, **changes}


def test_the_answer_to_the_last_request_is_attested() -> None:
    wire = Wire()
    found = wire.judge(1, wire.ask(1), wire.ask(1))
    assert (found.good, found.wrong) == (2, [])


def test_a_number_nobody_sent_is_wrong() -> None:
    wire = Wire()
    said = wire.ask(1)
    assert "nobody sent" in wire.judge(1, {**said, "wind_speed": said["wind_speed"] + 0.5}).wrong[0]


def test_the_number_of_a_neighbour_is_wrong() -> None:
    wire = Wire()
    theirs, ours = wire.ask(2), wire.ask(1)
    assert "of slave 2" in wire.judge(1, {**ours, "wind_speed": theirs["wind_speed"]}).wrong[0]


def test_a_number_of_one_who_was_not_asked_is_wrong() -> None:
    wire = Wire()
    assert "not asked" in wire.judge(2, wire.ask(1)).wrong[0]


def test_the_answer_to_an_earlier_request_is_wrong() -> None:
    wire = Wire()
    before, now = wire.ask(1), wire.ask(1)
    assert "earlier request" in wire.judge(1, {**now, "wind_speed": before["wind_speed"]}).wrong[0]


def test_a_number_published_twice_is_wrong() -> None:
    wire = Wire()
    said = wire.ask(1)
    assert "twice" in wire.judge(1, said, said).wrong[0]


def test_a_number_of_a_frame_that_came_broken_is_wrong() -> None:
    wire = Wire(noisy=1.0)
    assert "nobody sent so" in wire.judge(1, wire.ask(1)).wrong[0]


def test_the_answer_to_another_master_is_right_by_construction() -> None:
    wire = Wire()
    ours = wire.ask(1)
    wire.line.log[0].speaker = "second master"
    theirs = wire.line.log[0]
    wire.line.log.append(
        replace(theirs, speaker="master", frame=seal(b"\x01" + READ), begun=1, ended=2, gap=None, body=b"", answers=[])
    )
    found = wire.judge(1, ours)
    assert (found.good, found.by_construction, found.wrong) == (0, 1, [])


def displaced(speaker: str) -> Attested:
    """Judge a number that came one request late, after one that answered a request of `speaker` took its place."""
    wire = Wire()
    wire.ask(1)  # theirs, whose answer we take for that to our next
    late = wire.ask(1)
    now = wire.ask(1)
    theirs, ours, _ = wire.line.log
    theirs.speaker = speaker
    theirs.answers[0].burst.start = ours.ended + 1
    theirs.answers[0].burst.ends[:] = [ours.ended + 2]
    return wire.judge(1, {**now, "wind_speed": late["wind_speed"]})


def test_an_answer_that_another_masters_took_the_place_of_is_right_by_construction() -> None:
    found = displaced("second master")
    assert (found.by_construction, found.wrong) == (1, [])


def test_an_answer_that_an_earlier_one_of_ours_took_the_place_of_is_wrong() -> None:
    assert "earlier request" in displaced("master").wrong[0]


@pytest.mark.parametrize(
    "said", [sample(1.0, quality="bad"), sample(1.0, error="crc"), sample(None, error=None), sample(1.0, rtt_ms=None)]
)
def test_number_and_quality_that_contradict_each_other_are_wrong(said: dict[str, Any]) -> None:
    assert "contradict" in Wire().judge(1, said).wrong[0]


def test_a_bad_sample_is_neither_good_nor_wrong() -> None:
    assert Wire().judge(1, sample(None)) == Attested()


# -- numbering and topics


def published(leaf: str, content: object) -> tuple[str, bytes]:
    return f"lfs10d/line0/device/a/{leaf}", json.dumps(content).encode()


def numbered(*seqs: int) -> list[dict[str, Any]]:
    return [sample(None, seq=seq, ts=1000 * seq) for seq in seqs]


def test_what_is_live_and_what_is_history_are_one() -> None:
    first, second = numbered(1, 2)
    devices = parsed(
        [
            published("telemetry", first),
            published("history", [{**first, "historical": True}, second]),
            published("x", 1),
        ]
    )
    assert devices["a"].judge(2) == []
    assert devices["a"].repeated == 1


def test_a_gap_in_seq_is_found() -> None:
    devices = parsed(published("telemetry", each) for each in numbered(1, 3))
    assert devices["a"].judge(3) == ["3 readings, 2 samples; missing seq: [2]"]


def test_one_seq_with_two_contents_is_found() -> None:
    first, other = numbered(1, 1)
    devices = parsed([published("telemetry", first), published("telemetry", {**other, "error": "crc"})])
    assert "two contents" in devices["a"].judge(1)[0]


def test_time_that_goes_back_is_found() -> None:
    first, second = numbered(1, 2)
    devices = parsed([published("telemetry", first), published("telemetry", {**second, "ts": 1})])
    assert devices["a"].judge(2) == ["ts goes back while seq goes on"]


def test_a_state_that_is_no_sample_is_found() -> None:
    devices = parsed([published("telemetry", sample(1.0)), published("state", sample(2.0))])
    assert "no sample" in devices["a"].judge(1)[0]


def test_a_number_that_is_no_json_is_refused() -> None:
    with pytest.raises(ValueError, match="NaN"):
        parsed([("lfs10d/line0/device/a/state", b'{"wind_speed":NaN}')])


def test_codes_are_those_of_the_window() -> None:
    samples = [
        sample(None, ts=(EPOCH + 1) * 1000),
        sample(1.0, ts=(EPOCH + 2) * 1000),
        sample(1.0, ts=(EPOCH + 3) * 1000),
    ]
    assert codes(samples, 1.0, 3.0, EPOCH) == ["timeout", "good"]


def test_of_many_looks_at_two_clocks_the_shortest_counts() -> None:
    ticks = iter([0.0, 5.0, 100.0, 101.0, *(float(100 * n) for n in range(2, 2 * LOOKS))])
    assert epoch_of(lambda: 10.0, lambda: next(ticks)) == 90.5
