"""Values as a table shows them."""

from __future__ import annotations

import pytest

from lfs10d.cli.render.value_text import plain_text, with_unit
from lfs10d.reading import Value


@pytest.mark.parametrize(
    ("value", "words"),
    [(4.567, "4.57"), (3, "3"), (True, "yes"), (False, "no"), ("rain", "rain"), ("\x1b[1m", "\\x1b[1m")],
)
def test_a_value_is_shown_as_it_is_and_text_escaped(value: Value, words: str) -> None:
    assert plain_text(value) == words


@pytest.mark.parametrize(
    ("value", "unit", "among", "alone"),
    [
        (4.5, "m/s", "4.50 m/s", "4.50 m/s"),
        (4.5, "", "4.50", "4.50"),
        (3, "1", "n 3", "3"),
        (True, "", "n yes", "yes"),
        (True, "1", "n yes", "yes"),
        ("rain", "", "rain", "rain"),
        ("rain", "1", "rain", "rain"),
    ],
)
def test_a_bare_number_and_a_yes_have_their_name_among_others(value: Value, unit: str, among: str, alone: str) -> None:
    assert with_unit("n", value, unit, alone=False) == among
    assert with_unit("n", value, unit, alone=True) == alone
