"""Which spans records are of, and how they are written."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from docs.generate.contract import check
from lfs10d.telemetry.wind.record import (
    DIRECTION_NAMES,
    EVEN_WITHIN,
    RECORD_NAMES,
    RecordSpans,
    Span,
    WindRecord,
    device_of_source,
    is_record,
    source_of,
)

LENGTH = 600_000
MIDNIGHT = 1_795_305_600_000
RECORD = WindRecord(
    device="mast-top",
    boot="k3f9a2c7",
    seq=3,
    ts=MIDNIGHT + LENGTH,
    clock="synced",
    values={
        "length": LENGTH, "mean": 5.1, "gust": 9.9, "gust_before": 1250, "max": 10.4, "samples": 2400, "coverage": 1.0
    },
    units={"mean": "m/s"},
    names=RECORD_NAMES,
    quality="good",
    error=None,
    rtt_ms=None,
)  # fmt: skip


# -- spans --------------------------------------------------------------------------------------------------------


def test_the_first_span_begins_with_the_measuring_and_ends_with_the_next_full_time() -> None:
    spans = RecordSpans(LENGTH, 5000)
    shift = MIDNIGHT + 200_000
    end = 400_000
    assert spans.due(shift) == end
    assert spans.take(end - 1, shift) is None
    assert spans.take(end, shift) == Span(5000, end, MIDNIGHT + LENGTH)
    assert spans.take(end, shift) is None


def test_after_a_stop_of_the_process_every_span_that_went_by_is_recorded() -> None:
    spans = RecordSpans(LENGTH, 0)
    taken = [spans.take(3 * LENGTH, MIDNIGHT) for _ in range(4)]
    assert [None if span is None else (span.begin, span.to) for span in taken] == [
        (0, MIDNIGHT + LENGTH),
        (LENGTH, MIDNIGHT + 2 * LENGTH),
        (2 * LENGTH, MIDNIGHT + 3 * LENGTH),
        None,
    ]


def test_a_clock_set_far_ahead_makes_no_records_of_times_that_never_were() -> None:
    spans = RecordSpans(LENGTH, 0)
    years = 6 * 365 * 86_400_000
    assert spans.take(300_000, years) is None
    span = spans.take(LENGTH, years)
    assert span == Span(0, LENGTH, years + LENGTH)


def test_what_is_not_recorded_when_the_clock_is_set_belongs_to_the_spans_of_the_new_time() -> None:
    spans = RecordSpans(LENGTH, 0)
    ahead = MIDNIGHT + 480_000  # after 5 min the clock is set 8 min ahead
    assert spans.take(300_000, ahead) == Span(0, 120_000, MIDNIGHT + LENGTH)
    assert spans.take(300_000, ahead) is None
    assert spans.due(ahead) == 720_000


def test_a_clock_set_back_over_a_full_time_repeats_its_span_with_what_came_since() -> None:
    spans = RecordSpans(LENGTH, 0)
    assert spans.take(LENGTH, MIDNIGHT) is not None
    back = MIDNIGHT - 60_000
    assert spans.take(LENGTH + 60_000, back) == Span(LENGTH, LENGTH + 60_000, MIDNIGHT + LENGTH)


@pytest.mark.parametrize("slewed", [-300, -1, 0, 1, 300])
def test_a_clock_that_is_slewed_neither_repeats_nor_skips_a_span(slewed: int) -> None:
    spans = RecordSpans(LENGTH, 0)
    shift, now, taken = MIDNIGHT, 0, []
    for _ in range(20):
        shift += slewed
        now = spans.due(shift)
        span = spans.take(now, shift)
        assert span is not None
        taken.append(span.to)
    assert taken == [MIDNIGHT + LENGTH * (place + 1) for place in range(20)]
    assert abs(slewed) < EVEN_WITHIN


@given(st.lists(st.tuples(st.integers(1, 2_000_000), st.integers(-(10**8), 10**8)), max_size=30))
def test_whatever_the_clock_does_spans_follow_each_other_and_end_at_full_times(steps: list[tuple[int, int]]) -> None:
    spans, now, shift, begin = RecordSpans(LENGTH, 0), 0, MIDNIGHT, 0
    for passed, step in steps:
        now, shift = now + passed, shift + step
        while (span := spans.take(now, shift)) is not None:
            assert span.begin == begin < span.end <= now
            assert span.end - span.begin <= LENGTH + EVEN_WITHIN
            assert (span.to % LENGTH, span.end) == (0, span.to - shift)
            begin = span.end
        assert spans.due(shift) > now


# -- records ------------------------------------------------------------------------------------------------------


def test_a_record_is_written_with_its_span_and_its_times() -> None:
    payload = RECORD.payload("line0")
    assert payload == {
        "v": 1, "line": "line0", "device": "mast-top", "boot": "k3f9a2c7", "seq": 3,
        "ts": MIDNIGHT + LENGTH, "time": "2026-11-22T00:10:00.000Z", "clock": "synced", "unit": "m/s",
        "from": MIDNIGHT, "to": MIDNIGHT + LENGTH, "mean": 5.1, "gust": 9.9, "gust_ts": MIDNIGHT + LENGTH - 1250,
        "lull": None, "lull_ts": None, "max": 10.4, "stddev": None, "samples": 2400, "coverage": 1.0,
    }  # fmt: skip
    assert check("device/mast-top/record", json.dumps(payload)) is not None


def test_a_vane_adds_its_directions_and_what_waited_says_so() -> None:
    vane = replace(RECORD, names=(*RECORD_NAMES, *DIRECTION_NAMES), units={})
    payload = vane.payload("line0", historical=True)
    assert list(payload)[-3:] == ["direction", "direction_stddev", "historical"]
    assert payload["unit"] is None
    assert check("device/mast-top/record", json.dumps(payload)) is not None


def test_a_record_whose_clock_is_set_right_moves_as_a_whole() -> None:
    payload = replace(RECORD, ts=RECORD.ts + 7000).payload("line0")
    assert (payload["from"], payload["to"], payload["gust_ts"]) == (
        MIDNIGHT + 7000, MIDNIGHT + LENGTH + 7000, MIDNIGHT + LENGTH + 5750,
    )  # fmt: skip


def test_records_have_a_source_of_their_own_and_go_alone_to_their_own_topic() -> None:
    assert (RECORD.source, RECORD.history_topic, RECORD.grouped) == (
        "mast-top/record", "device/mast-top/record", False,
    )  # fmt: skip
    assert [is_record(each) for each in ("mast-top/record", "mast-top", "record")] == [True, False, False]
    assert [device_of_source(each) for each in ("mast-top/record", "mast-top")] == ["mast-top", "mast-top"]


@pytest.mark.parametrize(
    ("topic", "source"),
    [("device/a/record", "a/record"), ("device/a/history", "a"), ("device/a/state", None), ("event", None)],
)
def test_the_source_of_a_topic_is_what_goes_there_late(topic: str, source: str | None) -> None:
    assert source_of(topic) == source
