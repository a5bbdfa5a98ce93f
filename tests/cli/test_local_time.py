"""Times as a verb's text has them."""

from __future__ import annotations

from datetime import UTC, timedelta, timezone, tzinfo

import pytest

from lfs10d.cli.local_time import NO_CLOCK, clock_text, moment, since_text, stamp, zone_name

TS = 1_795_298_022_003
"""2026-11-21T21:53:42.003Z"""
CET = timezone(timedelta(hours=1), "CET")
EARLY = timezone(timedelta(hours=-8), "PST")


@pytest.mark.parametrize(
    ("zone", "clock", "date"),
    [
        (UTC, "21:53:42.003 UTC", "2026-11-21 21:53:42.003 UTC"),
        (CET, "22:53:42.003 CET", "2026-11-21 22:53:42.003 CET"),
        (EARLY, "13:53:42.003 PST", "2026-11-21 13:53:42.003 PST"),
    ],
)
def test_every_time_has_the_name_of_its_zone(zone: tzinfo, clock: str, date: str) -> None:
    assert (clock_text(TS, zone), stamp(TS, zone), zone_name(TS, zone)) == (clock, date, zone.tzname(None))


def test_without_a_zone_it_is_the_one_of_this_machine() -> None:
    when = moment(TS)
    assert when is not None
    assert when.timestamp() == TS / 1000
    assert clock_text(TS) == f"{when:%H:%M:%S}.003 {when.tzname()}"


@pytest.mark.parametrize("ts", [1e300, -1e300, float("nan"), float("inf"), 10**17])
def test_what_is_no_time_is_shown_as_dashes(ts: float) -> None:
    assert clock_text(ts, UTC) == stamp(ts, UTC) == NO_CLOCK
    assert (since_text(ts, TS, UTC), zone_name(ts, UTC)) == ("?", "?")


@pytest.mark.parametrize(
    ("now", "zone", "words"),
    [
        (TS + 3_600_000, UTC, "21:53"),
        (TS + 86_400_000, UTC, "21 Nov 21:53"),
        (TS + 3_600_000, CET, "22:53"),
        (TS + 2 * 3_600_000, CET, "21 Nov 22:53"),
        (1e300, UTC, "21 Nov 21:53"),
    ],
)
def test_since_when_is_the_minute_and_on_another_day_the_date_too(now: float, zone: tzinfo, words: str) -> None:
    assert since_text(TS, now, zone) == words
