"""The judge of the master: rules, verdicts, counts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.simulator.judge import ROUNDING, HeardRequest, Judge, JudgeReport
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import SECOND, Format, seal
from tests.support.simulated import violations

SLOW, FAST = Format(9600), Format(19200)
REQUEST = seal(bytes.fromhex("01 03 00 01 00 02"))


def line_with(*sent: tuple[int, bytes], shape: Format = SLOW) -> SimulatedLine:
    """Return a line on which a master sent these bytes, each so many ns after the end of the ones before."""
    line = SimulatedLine([Sensor(1, format=shape, turnaround=0.5)], format=shape)
    end = SECOND
    for pause, data in sent:
        end = line.transmit(data, end + pause, shape)
    line.advance(end + SECOND)
    return line


def verdicts(line: SimulatedLine) -> list[str]:
    def plain(request: HeardRequest) -> str:
        return str(request.verdict)

    return [plain(request) for request in line.log]


@given(pause=st.integers(min_value=0, max_value=10_000_000), shape=st.sampled_from((SLOW, FAST, Format(115200))))
def test_a_second_request_is_heard_after_t35_and_not_before(pause: int, shape: Format) -> None:
    line = line_with((0, REQUEST), (shape.t35 + pause, REQUEST), shape=shape)
    assert verdicts(line) == ["heard", "heard"]
    assert violations(line.judge) == 0
    assert line.judge.min_gap == shape.t35 + pause


@given(missing=st.integers(min_value=ROUNDING + 1, max_value=SLOW.t35 - 1))
def test_a_request_that_begins_too_early_is_not_heard(missing: int) -> None:
    line = line_with((0, REQUEST), (SLOW.t35 - missing, REQUEST))
    assert verdicts(line) == ["heard", "gap"]
    assert line.judge.counts == {"gap": 1, "heard": 1}
    assert line.judge.summary()["unheard"] == 1
    assert line.judge.min_excess == -missing
    assert len(line.log[1].answers) == 0


def test_a_rounding_of_the_clock_is_no_violation() -> None:
    line = line_with((0, REQUEST), (SLOW.t35 - ROUNDING, REQUEST))
    assert verdicts(line) == ["heard", "heard"]
    assert line.judge.histogram[0] == 0


def test_the_gap_counts_from_the_last_byte_of_an_answer_too() -> None:
    line = SimulatedLine([Sensor(1)])
    end = line.transmit(REQUEST, 0, SLOW)
    line.advance(end)
    answered = line.log[0].answers[0].burst.ends[-1]
    line.transmit(REQUEST, answered + SLOW.t35 - 100, SLOW)
    line.advance(2 * answered)
    assert verdicts(line) == ["heard", "gap"]


def test_the_first_request_has_no_gap() -> None:
    line = line_with((0, REQUEST))
    assert line.log[0].gap is None
    assert line.judge.summary()["min_gap_us"] is None


def test_after_a_change_of_rate_the_slower_gap_holds() -> None:
    for first, second in ((SLOW, FAST), (FAST, SLOW)):
        for pause, wanted in ((SLOW.t35, "heard"), (FAST.t35, "gap")):
            line = SimulatedLine()
            end = line.transmit(REQUEST, 0, first)
            end = line.transmit(REQUEST, end + pause, second)
            line.advance(end)
            assert verdicts(line) == ["heard", wanted]


@given(cut=st.integers(min_value=1, max_value=7), pause=st.integers(min_value=0, max_value=SLOW.t15))
def test_a_pause_up_to_t15_inside_is_allowed(cut: int, pause: int) -> None:
    line = line_with((0, REQUEST[:cut]), (pause, REQUEST[cut:]))
    assert verdicts(line) == ["heard"]


@given(cut=st.integers(min_value=1, max_value=7), more=st.integers(min_value=ROUNDING + 1, max_value=1_900_000))
def test_a_longer_pause_tears_the_request(cut: int, more: int) -> None:
    line = line_with((0, REQUEST[:cut]), (SLOW.t15 + more, REQUEST[cut:]))
    assert verdicts(line) == ["torn"]
    assert line.judge.counts["torn"] == 1


def test_a_request_torn_by_more_than_a_gap_is_torn_all_the_same() -> None:
    line = line_with((0, REQUEST[:5]), (50_000_000, REQUEST[5:]))
    assert verdicts(line) == ["malformed", "torn"]
    assert line.judge.counts["torn"] == 1


def test_torn_and_never_ended_is_torn() -> None:
    assert verdicts(line_with((0, REQUEST[:3]), (SLOW.t15 + 1000, REQUEST[3:5]))) == ["torn"]


def test_a_torn_request_that_never_ends_is_over_when_the_next_begins() -> None:
    line = line_with((0, REQUEST[:3]), (SLOW.t35, REQUEST))
    assert verdicts(line)[-1] == "heard"
    assert line.judge.counts["malformed"] == 1


def test_a_frame_with_a_wrong_check_is_malformed() -> None:
    line = line_with((0, REQUEST[:-1] + b"\x00"), (SECOND, REQUEST))
    assert verdicts(line) == ["malformed", "heard"]
    assert violations(line.judge) == 0


def test_a_request_written_behind_another_under_way_comes_too_early() -> None:
    line = SimulatedLine([Sensor(1)])
    line.transmit(REQUEST, SECOND, SLOW)
    end = line.transmit(REQUEST, SECOND + 1_000_000, SLOW)
    line.advance(end + SECOND)
    assert verdicts(line) == ["gap"]
    assert line.judge.counts["gap"] == 1


def test_a_request_in_two_writes_without_a_pause_is_one() -> None:
    line = SimulatedLine([Sensor(1)])
    line.transmit(REQUEST[:4], SECOND, SLOW)
    end = line.transmit(REQUEST[4:], SECOND + 1_000_000, SLOW)
    line.advance(end)
    assert verdicts(line) == ["heard"]
    assert end == pytest.approx(SECOND + SLOW.span(8), abs=1)


def test_writing_while_another_speaks_is_a_collision() -> None:
    line = SimulatedLine([Sensor(1)])
    line.speak("noise", bytes(20), SECOND)
    line.transmit(REQUEST, SECOND + 2_000_000, SLOW)
    line.advance(2 * SECOND)
    assert verdicts(line) == ["collision"]
    assert line.judge.counts["collision"] == 1


@pytest.mark.parametrize("begins", [-500_000, 3_000_000])
def test_a_request_into_which_another_begins_to_speak_is_struck_without_guilt(begins: int) -> None:
    line = SimulatedLine([Sensor(1)])
    line.speak("noise", bytes(20), SECOND + begins)
    line.transmit(REQUEST, SECOND, SLOW)
    line.advance(2 * SECOND)
    assert verdicts(line) == ["struck"]
    assert (line.judge.counts["struck"], violations(line.judge)) == (1, 0)


def test_ascii_frames_may_follow_at_once_and_pause_inside() -> None:
    frame = seal(REQUEST[:-2], "ascii")
    line = SimulatedLine([Sensor(1, framing="ascii", turnaround=2.0)], framing="ascii")
    end = line.transmit(frame[:5], SECOND, SLOW)
    end = line.transmit(frame[5:], end + SECOND // 2, SLOW)
    end = line.transmit(frame, end + 1000, SLOW)
    line.advance(end)
    assert verdicts(line) == ["heard", "heard"]


def test_an_ascii_frame_is_given_up_after_a_second() -> None:
    line = SimulatedLine(framing="ascii")
    frame = seal(REQUEST[:-2], "ascii")
    line.transmit(frame[:5], 0, SLOW)
    line.advance(2 * SECOND)
    line.transmit(frame[5:], 2 * SECOND, SLOW)
    line.advance(4 * SECOND)
    assert verdicts(line) == ["malformed", "torn"]


def test_what_is_settled_is_settled_once() -> None:
    judge = Judge()
    hearing = judge.listen(REQUEST, 0, SLOW, quiet_since=None, slower=SLOW, busy=False)
    assert judge.settle(hearing, struck=False) is JudgeReport.HEARD
    assert judge.settle(hearing, struck=False) is None
    assert judge.expire(hearing, SECOND) is None
    assert judge.counts.total() == 1


def test_a_piece_after_a_gap_begins_another_request() -> None:
    judge = Judge()
    torn = judge.listen(REQUEST[:3], 0, SLOW, quiet_since=None, slower=SLOW, busy=False)
    other = judge.listen(REQUEST, SECOND, SLOW, quiet_since=0, slower=SLOW, busy=False)
    assert torn.verdict is JudgeReport.MALFORMED
    assert judge.settle(other, struck=False) is JudgeReport.HEARD


def test_the_summary_counts_every_gap_in_one_place() -> None:
    line = line_with((0, REQUEST), (SLOW.t35 + 30_000, REQUEST), (SLOW.t35 + 60_000_000, REQUEST), (1000, REQUEST))
    summary = line.judge.summary()
    assert summary["excess_us"] == {
        "<0": 1, "<20": 0, "<50": 1, "<100": 0, "<200": 0, "<500": 0, "<1000": 0, "<2000": 0, "<5000": 0,
        "<10000": 0, "<50000": 0, ">=50000": 1,
    }  # fmt: skip
    assert summary["min_gap_us"] == 1.0
    assert summary["min_excess_us"] == (1000 - SLOW.t35) / 1000
