"""What has been heard from the broker, as rows."""

from __future__ import annotations

import pytest

from lfs10d.cli.demo.state import KEPT, LineFigures
from tests.support.demo_states import Told


def test_a_sensor_not_heard_of_yet_claims_nothing(told: Told) -> None:
    row = told.picture.rows["mast-top"]
    assert (row.speed, row.state, row.error, told.picture.samples, told.picture.online) == (None, "...", "", 0, 0)


def test_a_good_sample_is_the_speed_and_joins_the_trend(told: Told) -> None:
    told.sample("mast-top", 7.25)
    told.sample("mast-top", 7.5)
    row = told.picture.rows["mast-top"]
    assert (row.speed, list(row.trend), row.error) == (7.5, [7.25, 7.5], "")


def test_a_failed_sample_takes_the_speed_away_and_names_its_fault(told: Told) -> None:
    told.sample("bridge", 7.25)
    told.sample("bridge", None, "crc")
    row = told.picture.rows["bridge"]
    assert (row.speed, list(row.trend), row.error) == (None, [7.25, None], "crc")


def test_what_failed_before_is_still_counted_when_all_is_well(told: Told) -> None:
    told.sample("bridge", None, "crc")
    told.sample("bridge", 7.25)
    assert told.picture.rows["bridge"].error == "1 of 2 polls failed"


def test_an_active_error_speaks_in_its_own_words_until_it_is_cleared(told: Told) -> None:
    told.sample("crane", None, "timeout")
    told.error("crane", "timeout", "no answer in 200 ms")
    assert told.picture.rows["crane"].error == "timeout: no answer in 200 ms"
    told.error("crane", None)
    assert told.picture.rows["crane"].error == "timeout"


@pytest.mark.parametrize(("word", "state", "online"), [("online", "online", 1), ("offline", "offline", 0)])
def test_availability_is_the_state(told: Told, word: str, state: str, online: int) -> None:
    told.availability("crane", word)
    assert (told.picture.rows["crane"].state, told.picture.online) == (state, online)


def test_samples_of_all_sensors_are_counted(told: Told) -> None:
    told.sample("bridge", None, "crc")
    told.sample("crane", None, "timeout")
    told.sample("crane", None, "timeout")
    assert told.picture.samples == 3


def test_the_trend_forgets_what_is_old(told: Told) -> None:
    for number in range(KEPT + 5):
        told.sample("roof-n", number / 10)
    assert len(told.picture.rows["roof-n"].trend) == KEPT
    assert told.picture.rows["roof-n"].trend[0] == 0.5


@pytest.mark.parametrize("figures", [(None, None, None), (13.5, None, 3709.3), (13.5, 49.0, None)])
def test_statistics_that_are_not_whole_yet_are_not_shown(told: Told, figures: tuple[float | None, ...]) -> None:
    told.stats(*figures)
    assert told.picture.line is None


def test_the_line_is_what_its_last_statistics_say(told: Told) -> None:
    told.stats(12.0, 40.0, 3800.0)
    told.stats(13.5, 49.3, 3709.3)
    assert told.picture.line == LineFigures(13.5, 49.3, 3709.3, 3645.8)


@pytest.mark.parametrize(
    "topic",
    ["device/stranger/telemetry", "device/stranger/error", "device/stranger/availability", "device/crane/config", "x"],
)
def test_what_is_none_of_ours_changes_nothing(told: Told, topic: str) -> None:
    told.picture.heard(topic, b"{")
    assert told.picture.samples == 0
    assert all(row.state == "..." for row in told.picture.rows.values())
