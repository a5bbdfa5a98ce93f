"""Durations of which only a few are taken."""

from __future__ import annotations

import pytest

from lfs10d.schema.fields import FieldError
from lfs10d.schema.steps import Steps

LENGTHS = Steps(60, 3600, zero="none", steps=(60.0, 600.0, 3600.0))


@pytest.mark.parametrize(
    ("written", "means"), [("1m", 60.0), (600, 600.0), ("1h", 3600.0), ("60m", 3600.0), (0, 0.0), ("0s", 0.0)]
)
def test_each_step_is_taken_however_it_is_written(written: object, means: float) -> None:
    assert LENGTHS.accept(written) == means


@pytest.mark.parametrize("written", ["90s", 61, "2h", 30, "often", None, True, -60])
def test_anything_else_is_refused_with_all_that_are_taken(written: object) -> None:
    with pytest.raises(FieldError, match=r"^must be 1m, 10m or 1h, or 0 \(none\), not "):
        LENGTHS.accept(written)


def test_the_schema_names_the_numbers_and_takes_text() -> None:
    numbers, text = LENGTHS.json_schema()["anyOf"]
    assert numbers == {"enum": [0, 60, 600, 3600]}
    assert text["type"] == "string"
