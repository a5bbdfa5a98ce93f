"""YAML as version 1.2 reads it."""

from __future__ import annotations

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from lfs10d.schema.document import parse
from lfs10d.schema.yaml12 import DEEPEST_NESTING, TAG, Loader, render


@pytest.mark.parametrize(
    ("word", "kind"),
    [
        *((word, "str") for word in ("on", "no", "1:30", "1_000", "0b1", "=", "<<", "2026-11-21", "nULL", "0o8", "x")),
        *((word, "int") for word in ("0", "010", "-5", "+5", "0x1F", "0o17")),
        *((word, "float") for word in ("1.", ".5", "1e3", "-1.5E-3", ".inf", "-.INF", ".nan")),
        *((word, "bool") for word in ("true", "False", "TRUE")),
        *((word, "null") for word in ("~", "null", "NULL")),
    ],
)
def test_a_plain_word_has_the_type_that_yaml_1_2_gives_it(word: str, kind: str) -> None:
    node = Loader(word).get_single_node()
    assert node is not None
    assert node.tag == TAG + kind


def test_an_alias_has_a_place_of_its_own_and_the_anchor_keeps_its() -> None:
    node = Loader("[&a x, *a]").get_single_node()
    assert node is not None
    assert [item.start_mark.column for item in node.value] == [1, 7]


def test_nesting_has_an_end_before_the_stack_has() -> None:
    deepest = "[" * DEEPEST_NESTING + "]" * DEEPEST_NESTING
    assert Loader(deepest).get_single_node() is not None
    with pytest.raises(yaml.MarkedYAMLError, match="nested more than 20 levels deep"):
        Loader(f"[{deepest}]").get_single_node()


CORE = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(CORE)
@example(["on", "0o17", "010", "0x1F", "1:30", "~", "", "true", "1e3", ".5", "null", "<<", "="])
@example({"\x85": "\u2028", "\ufeff": "a\u2029"})
def test_what_is_rendered_reads_back_as_the_same_data(content: object) -> None:
    assert parse(render(content), "f").data == content


def test_rendering_writes_shared_data_out() -> None:
    shared = [1]
    assert "*" not in render({"a": shared, "b": shared})


@pytest.mark.parametrize("text", ["a\u202eb", "\u2066x\u2069", "\x9b[2J", "\ufeffx", "\U000e0041", "a\tb"])
def test_what_would_turn_or_hide_text_is_written_escaped(text: str) -> None:
    written = render({"label": text, text: 1})
    assert all(sign.isprintable() or sign == "\n" for sign in written)
    assert parse(written, "x").data == {"label": text, text: 1}
