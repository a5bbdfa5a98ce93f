"""The ids of a scan are written as numbers and ranges."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.line.jobs.scan_ids import ids_of


@pytest.mark.parametrize(
    ("text", "ids"),
    [("3", (3,)), ("1-4", (1, 2, 3, 4)), ("8, 1-2,2", (1, 2, 8)), (" 255 ", (255,)), ("7-7", (7,))],
)
def test_ids_are_written_as_numbers_and_ranges(text: str, ids: tuple[int, ...]) -> None:
    assert ids_of(text) == ids


@pytest.mark.parametrize("text", ["", "0", "256", "5-3", "1-", "-3", "a", "1--3", "1;2", "²", "1000", "1-999999999999"])
def test_what_is_no_id_is_refused_in_words(text: str) -> None:
    with pytest.raises(ValueError, match=r"ids go from 1 to 255|neither an id such as 3 nor a range"):
        ids_of(text)


@given(st.sets(st.integers(1, 255), min_size=1))
def test_every_set_of_ids_can_be_written(ids: set[int]) -> None:
    assert ids_of(",".join(map(str, ids))) == tuple(sorted(ids))
