"""What pydantic finds, in words for the person who wrote the file."""

from __future__ import annotations

from typing import Any, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import PydanticCustomError

from lfs10d.schema.fields import PLAIN_ERROR
from lfs10d.schema.messages import in_words, keys_at, missing, unknown_key


class Leaf(BaseModel):
    """A section."""

    model_config = ConfigDict(strict=True)

    register_: int = Field(0, alias="register", description="Where it lies.")
    bare: int = Field(0, le=5)
    word: Literal["a", "b"] = "a"
    number: float = Field(0, allow_inf_nan=False)


class Tree(BaseModel):
    """A file."""

    one: Leaf | None = None
    many: list[Leaf] = []
    named: dict[str, Leaf] = {}


@pytest.mark.parametrize(
    ("key", "known", "words"),
    [
        ("prot", ("port", "name"), "is not a known key; did you mean port?"),
        ("zzz", ("port", "name"), "is not a known key; known here: port, name"),
        ("zzz", (), "is not a known key"),
    ],
)
def test_an_unknown_key_is_answered_with_the_nearest_or_with_all(key: str, known: tuple[str, ...], words: str) -> None:
    assert unknown_key(key, known) == words


@pytest.mark.parametrize(
    ("path", "keys"),
    [
        ((), ("one", "many", "named")),
        (("named",), ()),
        (("named", "bare"), ("register", "bare", "word", "number")),
        (("named", "any", "bare"), ()),
        (("one",), ("register", "bare", "word", "number")),
        (("many", 0), ("register", "bare", "word", "number")),
        (("many", 0, "bare"), ()),
        (("none",), ()),
    ],
)
def test_the_keys_of_a_place_are_those_of_its_models(path: tuple[str | int, ...], keys: tuple[str, ...]) -> None:
    assert keys_at(Tree, path) == keys


def test_a_missing_key_is_answered_with_what_to_write() -> None:
    assert missing(Leaf, ("register_",)) == "is missing; write here: where it lies"
    assert missing(Leaf, ("bare",)) == "is missing"
    assert missing(Leaf, ("other",)) == "is missing"
    assert missing(None, ("register_",)) == "is missing"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"bare": "x"}, 'must be a whole number, not text "x"'),
        ({"bare": 6}, "must be at most 5, not 6"),
        ({"word": "c"}, "must be one of 'a' or 'b', not text \"c\""),
        ({"number": float("inf")}, "must be a finite number, not .inf"),
        ([], "must be a mapping of keys to values, not an empty list"),
    ],
)
def test_an_error_says_what_would_be_right_and_what_was_found(content: object, words: str) -> None:
    with pytest.raises(ValidationError) as invalid:
        Leaf.model_validate(content)
    (detail,) = invalid.value.errors()
    assert in_words(detail) == words


@pytest.mark.parametrize(
    ("kind", "context", "words"),
    [
        (PydanticCustomError(PLAIN_ERROR, "{message}", {"message": "must be odd"}), {}, "must be odd"),
        ("value_error", {"error": ValueError("two\nlines")}, "two lines"),
        ("uuid_type", {}, "UUID input should be a string, bytes or UUID object"),
    ],
)
def test_any_other_message_stays_as_it_is_on_one_line(
    kind: str | PydanticCustomError, context: dict[str, Any], words: str
) -> None:
    error = ValidationError.from_exception_data("f", [{"type": kind, "loc": (), "input": 1, "ctx": context}])
    assert in_words(error.errors()[0]) == words
