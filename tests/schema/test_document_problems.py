"""Problems of a document in words, at their places, in their order."""

from __future__ import annotations

import pytest

from lfs10d.errors import Problem
from lfs10d.schema.document import parse, path_text
from tests.support.documents import found, problems


@pytest.mark.parametrize(
    ("text", "already"),
    [
        ("inner: {required: !mine 1}", "inner.required: the tag"),
        ("inner: {required: !!int x}", 'inner.required: "x" does not match'),
        (f"inner: {{required: {'9' * 5000}}}", "inner.required: has too many"),
        ('inner: {required: "\\ud800"}', "inner.required: holds half"),
    ],
)
def test_what_could_not_be_read_is_told_once(text: str, already: str) -> None:
    (problem,) = problems(text)
    assert already in problem
    assert found(text) == []


def test_a_key_that_could_not_be_read_is_told_once() -> None:
    (problem,) = problems("!mine a: 1")
    assert "the tag" in problem


def test_an_unknown_key_is_told_beside_its_value_that_could_not_be_read() -> None:
    text = "inner: {zzz: !mine 9, required: 1}"
    assert len(problems(text)) == 1
    assert found(text) == ["f:1:9: inner.zzz: is not a known key; known here: number, needed, required, bare"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            'inner: {number: "9", required: 1}',
            ['f:1:17: inner.number: must be a whole number from 1 to 9, not text "9"'],
        ),
        ("inner: {numbr: 9, required: 1}", ["f:1:9: inner.numbr: is not a known key; did you mean number?"]),
        (
            "inner: {zzz: 9, required: 1}",
            ["f:1:9: inner.zzz: is not a known key; known here: number, needed, required, bare"],
        ),
        ("a: 1\ninner:\n  bare: 1\n", None),
        ("many:\n- {bare: 1}", ["f:2:3: many[0].required: is missing; write here: a number that must be there"]),
        ("bare: {}", ["f:1:7: bare.thing: is missing"]),
        ("registr: 1", ["f:1:1: registr: is not a known key; did you mean register?"]),
        ('"a\\nb": 1', None),
        ("many: 5", ["f:1:7: many: must be a list, not 5"]),
        ("inner: [1]", ["f:1:8: inner: must be a mapping of keys to values, not a list"]),
        ("union: 1.5", ["f:1:8: union: must be a whole number, not 1.5", "f:1:8: union: must be one of 'x', not 1.5"]),
        (
            "mixed: [x]",
            [
                "f:1:8: mixed: must be a mapping of keys to values, not a list",
                'f:1:9: mixed[0]: must be a whole number, not text "x"',
            ],
        ),
        ("ratio: 5", ["f:1:8: ratio: must be less than 5.0, not 5"]),
        ("ratio: -.inf", ["f:1:8: ratio: must be a finite number, not -.inf"]),
        ("odd: 2", ["f:1:6: odd: must be odd"]),
        ("codes: {99: 1}", ["f:1:9: codes.99: the key must be at least 100, not 99"]),
        ("codes: {100: x}", ['f:1:14: codes.100: must be a whole number, not text "x"']),
        ("flag: on", ['f:1:7: flag: must be true or false, not text "on"']),
        ("name: b", ['f:1:7: name: must be text that fits ^a, not text "b"']),
        ("5: 1", ["f:1:1: 5: is not a known key; keys are text here"]),
        ("[1]", ["f:1:1: must be a mapping of keys to values, not a list"]),
    ],
)
def test_what_pydantic_finds_is_told_in_words_with_its_place(text: str, expected: list[str] | None) -> None:
    if expected is None:
        assert all(line.startswith("f:") and line.isprintable() for line in found(text))
    else:
        assert found(text) == expected


def test_all_is_told_in_order_of_place() -> None:
    text = "ratio: 9\nflag: 1\ninner: {bare: x}\nodd: 4\n"
    assert [line.split(": ")[1] for line in found(text)] == ["ratio", "flag", "inner.required", "inner.bare", "odd"]


def test_without_the_model_an_unknown_key_is_told_without_a_proposal() -> None:
    assert found("inner: {zzz: 1}", None) == [
        "f:1:8: inner.required: is missing",
        "f:1:9: inner.zzz: is not a known key",
    ]


def test_a_key_that_holds_odd_characters_is_told_on_one_line() -> None:
    assert path_text(("a b", 0, "c\nd", "e")) == '"a b"[0]."c\\nd".e'


def test_a_problem_of_an_absent_key_stands_at_what_surrounds_it() -> None:
    document = parse("a:\n  b: 1\n", "f")
    assert document.problem(("a", "c", 3), "x") == Problem("f", 2, 3, "a.c[3]", "x")
    assert document.problem(("a", "b"), "x", key=True).column == 3
    assert document.problem((), "x", key=True) == Problem("f", 1, 1, "", "x")
    assert document.holds(("a", "b"))
    assert not document.holds(("a", "c"))
    assert document.line_of(("a", "b")) == 2
