"""The bench finds what is wrong, lost or out of order, and counts what is right."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from bench.broker import Broker, Heard, missing_seqs
from bench.line import Sent
from bench.measure import Run, jitter, judge_samples, measure, rates
from bench.report import markdown, results, table
from bench.rows import ROWS, Master, Row

DOUBLE = (sys.executable, str(Path(__file__).with_name("daemon_double.py")))
SHORT = Row("short", "two at 115200", baudrate=115200, sensors=2, warm=1.5, seconds=1.0)


def sent(order: int, slave: int, kind: str = "ok") -> Sent:
    return Sent(order, slave, 1.0 + order, float(order), order + 0.5, kind)


def heard(order: int, slave: int, seq: int = 1, value: float | None = None) -> Heard:
    return Heard(order + 0.502, f"slave-{slave}", "b", seq, 1.0 + order if value is None else value, None)


def test_what_was_sent_and_heard_in_order_is_right() -> None:
    judgement = judge_samples([sent(0, 1), sent(1, 2)], [heard(0, 1), heard(1, 2)], 0.0, 10.0)
    assert (judgement.wrong, judgement.lost) == (0, 0)
    assert judgement.latencies == pytest.approx([2.0, 2.0])


@pytest.mark.parametrize(
    "samples",
    [
        [heard(0, 2)],
        [heard(0, 1, value=77.0)],
        [heard(1, 1), heard(0, 1)],
        [heard(0, 1), heard(0, 1)],
        [heard(2, 1)],
    ],
    ids=["of another sensor", "never sent", "out of order", "twice", "from an answer given up"],
)
def test_a_value_is_wrong(samples: list[Heard]) -> None:
    log = [sent(0, 1), sent(1, 1), sent(2, 1, "stale")]
    assert judge_samples(log, samples, 0.0, 10.0).wrong == 1


def test_a_whole_answer_that_nobody_published_is_lost_and_a_spoilt_one_is_not() -> None:
    log = [sent(0, 1), sent(1, 1, "crc"), sent(2, 1), sent(20, 1)]
    assert judge_samples(log, [heard(0, 1)], 0.0, 10.0).lost == 1


def test_a_late_answer_that_was_waited_for_is_right_and_need_not_be_published() -> None:
    log = [sent(0, 1, "late"), sent(1, 1, "late")]
    judgement = judge_samples(log, [heard(0, 1)], 0.0, 10.0)
    assert (judgement.wrong, judgement.lost) == (0, 0)


def test_failed_polls_are_no_values() -> None:
    failed = Heard(1.0, "slave-1", "b", 1, None, "timeout")
    assert judge_samples([sent(0, 1, "crc")], [failed], 0.0, 10.0).wrong == 0


def test_holes_in_seq_are_counted_per_device_and_boot() -> None:
    assert missing_seqs([heard(0, 1, 1), heard(1, 1, 4), heard(2, 2, 1), heard(3, 2, 2)]) == 2


def test_the_rate_counts_whole_answers_of_the_healthy_only() -> None:
    log = [sent(order, 1 + order % 3, "crc" if order == 4 else "ok") for order in range(9)]
    rate, slowest = rates(log, (1, 2), 8.5)
    assert rate == pytest.approx(4 / 7)
    assert slowest == pytest.approx(2 / 8.5 * 2)
    assert rates(log, (1, 2), 8.5, interval=1.0)[0] == pytest.approx(5 / 8.5)


def test_nobody_answering_is_a_rate_of_nothing() -> None:
    assert rates([], (1, 2), 5.0) == (0.0, 0.0)


def test_jitter_is_how_far_polls_are_off_their_interval() -> None:
    log = [Sent(n, 1, float(n), at, at, "ok") for n, at in enumerate((0.0, 1.0, 2.003))]
    assert jitter(log, 1.0) == pytest.approx(0.0, abs=1e-6)
    assert jitter([*log, Sent(3, 1, 3.0, 4.0, 4.0, "ok")], 1.0) == pytest.approx(3.0)
    assert jitter(log, 0.0) is None


def test_the_limit_is_the_wires() -> None:
    assert Row("", "", turnaround_ms=0.0).limit == pytest.approx(1 / 0.025)
    assert Row("", "", baudrate=115200, turnaround_ms=0.0).limit == pytest.approx(1 / 4.976e-3, rel=1e-3)


def test_every_row_has_its_own_name_and_is_measured_against_one_that_exists() -> None:
    names = [row.name for row in ROWS]
    assert len(set(names)) == len(names)
    assert {row.against for row in ROWS} <= {"reference", "", *names}
    assert all("reference" in row.masters for row in ROWS if row.against == "reference")


def run_of(row: str, master: Master, rate: float) -> Run:
    gaps: dict[str, float | None] = {"min": 3700.0, "p50": 3800.0, "p99": 3900.0, "max": 4000.0}
    return Run(row, master, rate, rate, rate / 40, 1, 2, gaps, 50.0, 500.0, 40.0, 20.0)


def test_the_table_holds_medians_and_ratios_of_the_same_run() -> None:
    row = Row("a", "row a")
    runs = {
        ("a", "reference"): [run_of("a", "reference", rate) for rate in (30.0, 38.0, 40.0)],
        ("a", "daemon"): [run_of("a", "daemon", rate) for rate in (30.0, 19.0, 38.0)],
    }
    head, reference, daemon = table([row], runs)
    assert daemon[head.index("polls/s")] == "30.00"
    assert daemon[head.index("against")] == "0.950"
    assert reference[head.index("against")] == "-"
    assert daemon[head.index("viol.")] == "3+6"
    assert daemon[head.index("x ref")] == "1.00"
    assert "| row a |" in markdown([head, daemon])
    assert daemon[head.index("runs")] == "3"
    assert "on 2030-01-01" in results([row], runs, "2030-01-01")


@pytest.mark.needs("gcc", "mosquitto")
def test_an_honest_daemon_is_found_honest(tmp_path: Path) -> None:
    with Broker(tmp_path) as broker:
        run = measure(SHORT, "daemon", broker.port, DOUBLE)
    assert (run.violations, run.wrong, run.lost, run.holes) == (0, 0, 0, 0)
    assert run.published > 0
    assert run.rss > run.rss_anon > 0
    assert run.first_sample is not None
    assert run.latency["p99"] >= run.latency["p50"] > 0


@pytest.mark.needs("gcc", "mosquitto")
def test_a_daemon_that_swaps_two_sensors_is_found_out(tmp_path: Path) -> None:
    with Broker(tmp_path) as broker:
        run = measure(SHORT, "daemon", broker.port, (*DOUBLE, "--swapped"))
    assert run.wrong == run.published > 0
    assert run.lost > 0


@pytest.mark.needs("gcc", "mosquitto")
def test_a_daemon_that_ends_is_reported_with_its_words(tmp_path: Path) -> None:
    with Broker(tmp_path) as broker, pytest.raises(RuntimeError, match="no such thing"):
        measure(SHORT, "daemon", broker.port, (sys.executable, "-c", "raise SystemExit('no such thing')"))
