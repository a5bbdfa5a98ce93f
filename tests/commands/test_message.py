"""Requests as they come in: what can be read of any bytes, and in which words the rest is refused."""

from __future__ import annotations

import json
from typing import Annotated, Any, Self

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, model_validator

from lfs10d.command import Command, Result, failed, ok, rejected
from lfs10d.commands.message import LARGEST, NoParameters, Parameters, parameters_of, read, response
from lfs10d.schema.fields import Duration, Whole


class Numbered(Parameters):
    """A form with a plain type, a kind of ours and an alias."""

    to: Annotated[int, Whole(1, 255)]
    dry_run: bool = False
    duration: Annotated[float, Duration(1, 600)] = Field(default=30.0, alias="for")


class Contradicting(Parameters):
    """A form that is wrong as a whole."""

    @model_validator(mode="after")
    def _refuse(self) -> Self:
        raise ValueError("neither  device\nnor slave")


def refused(payload: bytes) -> tuple[Command, str]:
    """Return what could be read of a payload that must be refused, and the code."""
    call, problem = read(payload)
    assert problem is not None
    assert problem.status == "rejected"
    assert problem.code is not None
    return call, problem.code


@pytest.mark.parametrize(
    "payload",
    [
        b"nonsense",
        b"{",
        b"{}x",
        b'{"a":1,}',
        b'{"id":"a1"',
        b"[]",
        b'[{"id":"a1"}]',
        b'"text"',
        b"17",
        b"null",
        b"true",
        b'{"a":NaN}',
        b'{"a":Infinity}',
        b'{"a":-Infinity}',
        b"\xef\xbb\xbf{}",
        "{}".encode("utf-16"),
        b'{"a":"\xff"}',
        b'{"a":"\\ud800"}',
        b'{"a":"\x01"}',
        b"\x00",
        b"[" * LARGEST,
        b'{"a":' * 600 + b"1" + b"}" * 600,
    ],
)
def test_anything_but_a_json_object_is_invalid_json_and_has_no_id(payload: bytes) -> None:
    assert refused(payload) == (Command(), "invalid_json")


@pytest.mark.parametrize(
    ("payload", "key"),
    [
        (b'{"id":"a1","to":5,"to":6}', '"to"'),
        (b'{"id":1,"id":1}', '"id"'),
        (b'{"a":[{"b":{"c":1,"\\u0063":1}}]}', '"c"'),
    ],
)
def test_a_key_that_is_given_twice_is_invalid_json_that_names_it(payload: bytes, key: str) -> None:
    call, problem = read(payload)
    assert call == Command()
    assert problem == rejected("invalid_json", f"{key} is given twice; keep one")


def test_two_objects_may_have_the_same_key() -> None:
    assert read(b'{"a":[{"b":1},{"b":2}]}')[1] is None


@pytest.mark.parametrize("number", ["1e999", "-1e999", "[1e999]", '{"b":1e999}'])
def test_a_number_that_no_float_holds_is_invalid_json_told_to_its_id(number: str) -> None:
    call, code = refused(f'{{"id":"a1","transaction":7,"a":{number}}}'.encode())
    assert (call.id, call.transaction, code) == ("a1", 7, "invalid_json")


@given(st.binary(max_size=200))
def test_no_bytes_whatever_break_the_reader(payload: bytes) -> None:
    call, problem = read(payload)
    assert problem is None or problem.code in {"invalid_json", "invalid_param"}
    assert isinstance(call.fingerprint, str)


IDS = st.text(max_size=64) | st.integers()
PLAIN = st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False, allow_infinity=False)
JSON = st.recursive(
    PLAIN | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
OBJECTS = st.dictionaries(st.text(max_size=8).filter(lambda key: key not in {"id", "transaction"}), JSON, max_size=4)


@given(OBJECTS, IDS, IDS)
def test_every_object_is_read_as_its_parameters_and_its_ids(content: dict[str, Any], one: str | int, two: int) -> None:
    call, problem = read(json.dumps({"id": one, **content, "transaction": two}).encode("utf-8", "replace"))
    if problem is None:
        assert (call.transaction, call.key) == (two, call.id)
        assert call.parameters == json.loads(call.fingerprint)


@given(OBJECTS)
def test_the_order_of_the_keys_and_the_white_space_make_no_other_fingerprint(content: dict[str, Any]) -> None:
    backwards = dict(reversed(content.items()))
    one, _ = read(json.dumps(content).encode())
    other, _ = read(json.dumps(backwards, indent=3, ensure_ascii=True).encode())
    assert one.fingerprint == other.fingerprint


def test_what_json_tells_apart_has_fingerprints_apart() -> None:
    texts = ["1", "true", "1.0", '"1"', "null", "[1]", '{"a":1}', "[]", "{}"]
    assert len({read(f'{{"to":{text}}}'.encode())[0].fingerprint for text in texts}) == len(texts)


@pytest.mark.parametrize("wrong", ["true", "1.5", "[]", "{}", f'"{"x" * 65}"'])
@pytest.mark.parametrize("key", ["id", "transaction"])
def test_an_id_that_is_none_is_an_invalid_param_and_null(key: str, wrong: str) -> None:
    call, problem = read(f'{{"{key}":{wrong},"to":1}}'.encode())
    assert (call.id, call.transaction, call.parameters) == (None, None, {"to": 1})
    assert problem is not None
    error = problem.error()
    assert error is not None
    assert (error["code"], error["param"]) == ("invalid_param", key)


def test_of_two_ids_that_are_none_the_first_is_told() -> None:
    _, problem = read(b'{"transaction":[],"id":{}}')
    assert problem is not None
    assert problem.facts["param"] == "id"


@pytest.mark.parametrize("good", ['"x"', f'"{"é" * 64}"', '""', "0", "-5", "9" * 400])
def test_text_of_up_to_64_characters_and_whole_numbers_are_ids(good: str) -> None:
    call, problem = read(f'{{"id":{good}}}'.encode())
    assert (call.id, problem) == (json.loads(good), None)


def test_the_transaction_stands_in_for_a_missing_id_only() -> None:
    assert read(b'{"transaction":"t"}')[0].key == "t"
    assert read(b'{"transaction":"t","id":"i"}')[0].key == "i"
    assert read(b"{}")[0].key is None


def test_a_response_has_its_keys_in_the_order_of_the_contract() -> None:
    given = response(Command(id="a1"), "device/options", ok({"from": 1, "to": 2}), 41.04)
    assert json.dumps(given) == (
        '{"v": 1, "id": "a1", "request": "device/options", "status": "ok", '
        '"data": {"from": 1, "to": 2}, "error": null, "took_ms": 41.0}'
    )


def test_a_transaction_is_echoed_as_such_and_only_where_there_was_one() -> None:
    assert response(Command(transaction=5), "health", ok(), 0)["transaction"] == 5
    assert response(Command(transaction=5), "health", ok(), 0)["id"] is None
    assert "transaction" not in response(Command(id=5), "health", ok(), 0)


@pytest.mark.parametrize(
    ("answer", "status", "error"),
    [
        (
            rejected("invalid_param", "to: wrong", param="to"),
            "rejected",
            {"code": "invalid_param", "message": "to: wrong", "param": "to"},
        ),
        (
            failed("refused", "it says no", exception_code=3),
            "failed",
            {"code": "refused", "message": "it says no", "param": None, "exception_code": 3},
        ),
        (ok(), "ok", None),
    ],
)
def test_the_error_object_has_code_message_param_and_what_else_is_known(
    answer: Result, status: str, error: dict[str, object] | None
) -> None:
    assert (answer.status, answer.error()) == (status, error)


def test_a_failure_may_have_data_all_the_same() -> None:
    assert failed("cancelled", "ended", data={"found": []}).data == {"found": []}


def test_parameters_come_back_in_their_form() -> None:
    call, _ = read(b'{"id":1,"to":9,"for":"1m"}')
    parameters = parameters_of(Numbered, call)
    assert isinstance(parameters, Numbered)
    assert (parameters.to, parameters.dry_run, parameters.duration) == (9, False, 60.0)


@pytest.mark.parametrize(
    ("payload", "param", "words"),
    [
        ('{"to":true}', "to", "to: must be a whole number from 1 to 255, not true"),
        ('{"to":"9"}', "to", 'to: must be a whole number from 1 to 255, not text "9"'),
        ('{"to":9.0}', "to", "to: must be a whole number from 1 to 255, not 9.0"),
        ('{"to":1,"dry_run":1}', "dry_run", "dry_run: must be true or false, not 1"),
        ('{"to":1,"for":"1"}', "for", f'for: must be {Duration(1, 600).words}, not text "1"'),
        ("{}", "to", "to: is missing"),
        ('{"too":1}', "too", "too: is no parameter of this request; it takes to, dry_run, for"),
        ('{"to":1,"duration":1}', "duration", "duration: is no parameter of this request; it takes to, dry_run, for"),
    ],
)
def test_the_wrong_parameter_is_named_and_what_would_be_right(payload: str, param: str, words: str) -> None:
    call, _ = read(payload.encode())
    answer = parameters_of(Numbered, call)
    assert isinstance(answer, Result)
    assert (answer.status, answer.code, answer.facts["param"], answer.message) == (
        "rejected",
        "invalid_param",
        param,
        words,
    )


def test_a_request_without_parameters_says_so() -> None:
    answer = parameters_of(NoParameters, read(b'{"verbose":true}')[0])
    assert isinstance(answer, Result)
    assert answer.message == "verbose: is no parameter of this request; it takes none"


def test_a_name_of_any_length_is_told_back_in_64_characters() -> None:
    answer = parameters_of(NoParameters, read(json.dumps({"x" * 3000: 1}).encode())[0])
    assert isinstance(answer, Result)
    assert answer.facts["param"] == "x" * 61 + "..."
    assert len(answer.message) < 200


def test_what_is_wrong_as_a_whole_names_no_parameter() -> None:
    answer = parameters_of(Contradicting, Command())
    assert isinstance(answer, Result)
    assert (answer.message, answer.facts["param"]) == ("neither device nor slave", None)
