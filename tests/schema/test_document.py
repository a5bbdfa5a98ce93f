"""YAML text to data with places, as YAML 1.2 means it."""

from __future__ import annotations

import math

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from lfs10d.errors import ConfigError, Problem
from lfs10d.schema.document import LARGEST_FILE, MOST_VALUES, Document, decode, parse
from lfs10d.schema.fields import Hexadecimal
from lfs10d.schema.yaml12 import DEEPEST_NESTING
from tests.support.documents import problems


def data(text: str) -> object:
    document = parse(text, "f")
    assert document.problems == ()
    return document.data


def refusal(text: str) -> str:
    with pytest.raises(ConfigError) as refused:
        parse(text, "f")
    assert len(refused.value.problems) == 1
    return str(refused.value)


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        *((word, word) for word in ("on", "off", "yes", "no", "y", "n", "On", "1:30", "1_000", "0b11", "2026-11-21")),
        *((word, word) for word in ("=", "<<", "0o8", "0xg", "+-1", "nULL", "tRUE", "1e", ".", "inf", "nan", "-.nan")),
        ("010", 10),
        ("-08", -8),
        ("+5", 5),
        ("0x1F", Hexadecimal(31)),
        ("0o17", 15),
        ("1.", 1.0),
        (".5", 0.5),
        ("-1.5e3", -1500.0),
        ("1e3", 1000.0),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("1e999", math.inf),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("'5'", "5"),
        ('"on"', "on"),
        ("!!str 5", "5"),
        ("!!int 0x10", Hexadecimal(16)),
        ("!!float 1", 1.0),
    ],
)
def test_plain_words_mean_what_yaml_1_2_says(word: str, meant: object) -> None:
    found = data(f"key: {word}")
    assert found == {"key": meant}
    assert isinstance(found, dict)
    assert type(found["key"]) is type(meant)


def test_not_a_number_is_one() -> None:
    found = data(".NaN")
    assert isinstance(found, float)
    assert math.isnan(found)


TEXT = """\
# comment
line: {port: /dev/x, baudrate: 9600}
slaves:
  - 2
  - id: 3
    name: top
"""


@pytest.mark.parametrize(
    ("path", "value", "key"),
    [
        ((), (2, 1), None),
        (("line",), (2, 7), (2, 1)),
        (("line", "port"), (2, 14), (2, 8)),
        (("slaves",), (4, 3), (3, 1)),
        (("slaves", 0), (4, 5), None),
        (("slaves", 1), (5, 5), None),
        (("slaves", 1, "name"), (6, 11), (6, 5)),
    ],
)
def test_every_key_and_value_has_its_line_and_column(
    path: tuple[str | int, ...], value: tuple[int, int], key: tuple[int, int] | None
) -> None:
    place = parse(TEXT, "f").places[path]
    assert place.value == value
    assert place.key == key


def test_an_alias_stands_where_it_stands_and_not_at_its_anchor() -> None:
    document = parse("a: &x [1]\nb: *x\n", "f")
    assert document.data == {"a": [1], "b": [1]}
    assert document.places[("b",)].value == (2, 4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "f:1:1: the file is empty"),
        ("# nothing\n", "f:1:1: the file is empty"),
        ("a: 1\n\tb: 2\n", "f:2:1: a tab may not indent or separate here; use spaces"),
        ("a: b: c", "f:1:5: is not valid YAML: mapping values are not allowed here"),
        ("a: 1\n---\nb: 2\n", "f:2:1: a second document begins here; the file may hold only one"),
        ("a: 1\nb: \0", "f:2:4: the character U+0000 may not stand in the file; write it as an escape in quotes"),
        ("a: \u2028", "f:1:4: the character U+2028 may not stand in the file; write it as an escape in quotes"),
        ("a: \ud800", "f:1:4: the character U+D800 may not stand in the file; write it as an escape in quotes"),
        ("[" * 100_000, f"f:1:{DEEPEST_NESTING + 1}: is not valid YAML: nested more than 20 levels deep"),
        ("- " * 100, f"f:1:{2 * DEEPEST_NESTING + 1}: is not valid YAML: nested more than 20 levels deep"),
        ("a: &x [*x]", "f:1:8: a[0]: an alias may not contain itself"),
        ("a: *nothing", "f:1:4: is not valid YAML: found undefined alias 'nothing'"),
        ('a: "\\UFFFFFFFF"', "f:1:7: is not valid YAML: a number is out of range"),
        ("%YAML 1." + "9" * 5000 + "\n--- a", "f:1:9: is not valid YAML: a number is out of range"),
        ("a: 'b", "f:1:6: is not valid YAML: found unexpected end of stream (while scanning a quoted scalar)"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(text: str, message: str) -> None:
    assert refusal(text) == message


def test_aliases_to_aliases_are_refused_before_they_fill_the_memory() -> None:
    levels = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    levels += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 10)]
    assert refusal("\n".join(levels)).endswith("is too large or too deep to read (an alias counts as its content)")
    assert MOST_VALUES < 10**5


def test_aliases_cannot_nest_deeper_than_lists() -> None:
    chain = "a0: &a0 [x]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}]\n" for n in range(1, 30))
    assert refusal(chain).endswith("is too large or too deep to read (an alias counts as its content)")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a: 1\nb: 2\na: 3\n", ["f:3:1: a: is given twice, first in line 1; keep one"]),
        ("s: [{id: 1, id: 2}]", ["f:1:13: s[0].id: is given twice, first in line 1; keep one"]),
        ("5: 1\n0x5: 2", ["f:2:1: 5: is given twice, first in line 1; keep one"]),
        ("true: 1", ["f:1:1: a key must be text or a whole number, not true"]),
        ("a: {1.5: 1}", ["f:1:5: a: a key must be text or a whole number, not 1.5"]),
        ("? [1]\n: 2", ["f:1:3: a key must be text or a whole number, not a list"]),
        ("~: 1", ["f:1:1: a key must be text or a whole number, not empty"]),
        (
            "a: !!python/object:os.system ls",
            ['f:1:4: a: the tag "tag:yaml.org,2002:python/object:os.sy..." is not known; leave it out'],
        ),
        ("a: !mine [1]", ['f:1:4: a: the tag "!mine" is not known; leave it out']),
        ("a: !!int x", ['f:1:4: a: "x" does not match its tag; leave the tag out']),
        ("a: " + "9" * 5000, ["f:1:4: a: has too many digits"]),
        ('a: "\\ud800"', ["f:1:4: a: holds half a character (a surrogate); write it whole"]),
    ],
)
def test_what_is_wrong_in_one_place_is_kept_beside_the_rest(text: str, found: list[str]) -> None:
    assert problems(text) == found


def test_of_a_key_given_twice_the_first_counts() -> None:
    assert parse("a: 1\na: 2", "f").data == {"a": 1}


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (b"a: 1\nb: caf\xe9\n", "f:2:7: byte 0xe9 is not UTF-8; save the file as UTF-8"),
        (b"\xef\xbb\xbfb: caf\xe9\n", "f:1:7: byte 0xe9 is not UTF-8; save the file as UTF-8"),
        (b"\xef\xbb\xbf\xc3\xbc\xe9\n", "f:1:2: byte 0xe9 is not UTF-8; save the file as UTF-8"),
        ("a: 1".encode("utf-16"), "f:1:1: byte 0xff is not UTF-8; save the file as UTF-8"),
        (b"#" * (LARGEST_FILE + 1), "f:1:1: the file is too large; at most 256 KiB are read"),
    ],
)
def test_a_file_that_is_no_text_is_refused_with_its_place(raw: bytes, message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        decode(raw, "f")
    assert str(refused.value) == message


def test_a_byte_order_mark_shifts_nothing() -> None:
    document = parse(decode(b"\xef\xbb\xbfa: 1", "f"), "f")
    assert document.places[("a",)].key == (1, 1)


YAMLISH = st.text(st.sampled_from("ab:{}[]-#&*!?|>'\"%@`,\n\t \r\0\\0123.~x<U\ufeff\x85\ud800é")) | st.text()


@given(YAMLISH)
@example("? ? ? a")
@example("!<tag:yaml.org,2002:str> ? x")
@example("!!str [a]")
@example("{? a: 1}")
@example('"\\x')
@example("%TAG ! tag:x,1:\n---\n!a b")
def test_any_text_is_a_document_or_a_configuration_error(text: str) -> None:
    document: Document | None = None
    told: tuple[Problem, ...] = ()
    try:
        document = parse(text, "f")
    except ConfigError as error:
        told = error.problems
    assert len(told) == (1 if document is None else 0)
    assert all(problem.line >= 1 and problem.column >= 1 and str(problem).isprintable() for problem in told)
    assert document is None or () in document.places


@given(st.binary())
def test_any_bytes_are_text_or_a_configuration_error(raw: bytes) -> None:
    text: str | None = None
    told: tuple[Problem, ...] = ()
    try:
        text = decode(raw, "f")
    except ConfigError as error:
        told = error.problems
    assert len(told) == (1 if text is None else 0)
    assert text is None or text.encode() in {raw, raw[3:]}


def test_where_yaml_1_1_and_1_2_agree_so_do_pyyaml_and_we() -> None:
    assert data(TEXT) == yaml.safe_load(TEXT)


def test_a_bare_percent_sign_is_answered_with_its_quotes() -> None:
    with pytest.raises(ConfigError) as caught:
        parse("values:\n  - {name: humidity, unit: %}\n", "a.yaml")
    assert str(caught.value) == 'a.yaml:2:28: a percent sign cannot begin a plain word; put it in quotes: "%"'
