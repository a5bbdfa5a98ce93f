"""JSON that a person may look at."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.cli.json_text import json_text

ANY_TEXT = st.text(st.characters(codec=None, exclude_categories=()))
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | ANY_TEXT,
    lambda inner: st.lists(inner) | st.dictionaries(ANY_TEXT, inner),
    max_leaves=8,
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Mâst, 10 m", '"Mâst, 10 m"'),
        ("a\u202eb", '"a\\u202eb"'),
        ("\u2066x\u2069", '"\\u2066x\\u2069"'),
        ("\x7f\x9b\u2028\ufeff", '"\\u007f\\u009b\\u2028\\ufeff"'),
        ("\U000e0041", '"\\udb40\\udc41"'),
        ("\ud800", '"\\ud800"'),
    ],
)
def test_what_would_turn_or_hide_text_is_escaped(text: str, words: str) -> None:
    assert json_text(text) == words


@given(JSON, st.sampled_from([None, 2]))
def test_it_reads_back_as_the_same_and_every_sign_prints(value: object, indent: int | None) -> None:
    text = json_text(value, indent=indent)
    assert json.loads(text) == json.loads(json.dumps(value))
    assert all(sign.isprintable() or sign == "\n" for sign in text)
    assert indent is not None or "\n" not in text
