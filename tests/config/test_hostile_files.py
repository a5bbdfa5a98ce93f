"""Whatever stands in the files that are read at the start: it is understood, or put aside and told. Nothing raises."""

from __future__ import annotations

import json
from pathlib import Path

from hypothesis import example, given
from hypothesis import strategies as st

from lfs10d.config.changes_file import ChangesFile
from lfs10d.daemon import boot
from lfs10d.errors import ConfigError, Problem
from lfs10d.profiles.library import parse_profile
from lfs10d.reconfiguration.journal import FILE_NAME, Endpoint, Journal, Move, OpenReaddress
from lfs10d.system.disk import Disk
from tests.support.volatile_disk import ForgetfulFiles

STATE = Path("/state")
SPOT = Endpoint(slave=3, baudrate=9600)

NUMBERS = st.integers() | st.sampled_from([2**63, 2**64, 10**400, -1, 255, 9600]) | st.floats()
WORDS = st.sampled_from(["readdress", "ok", "a1", "", "\0", "\x1b[2J", "\ud800", "9" * 400, "mast-top"])


def nested(keys: st.SearchStrategy[str]) -> st.SearchStrategy[object]:
    """Return any JSON whose objects have such keys."""
    plain = st.none() | st.booleans() | NUMBERS | WORDS | st.text(max_size=8)
    return st.recursive(
        plain,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=5),
        max_leaves=15,
    )


JOURNAL_KEYS = st.sampled_from(
    [
        "version",
        "last_number",
        "changes",
        "answers",
        "number",
        "kind",
        "moves",
        "begun",
        "asked",
        "answered",
        "facts",
        "device",
        "old",
        "new",
        "slave",
        "baudrate",
        "name",
        "id",
        "transaction",
        "fingerprint",
        "topic",
        "correlation",
        "status",
        "data",
        "error",
        "at",
        "took_ms",
    ]
)
JOURNALS = st.fixed_dictionaries(
    {"version": st.just(1)},
    optional={"changes": nested(JOURNAL_KEYS), "answers": nested(JOURNAL_KEYS), "last_number": nested(JOURNAL_KEYS)},
)
"""Journals with the right frame and anything in it."""


def as_json(content: object) -> bytes:
    return json.dumps(content).encode("utf-8", "surrogatepass")


@given(st.binary(max_size=200) | JOURNALS.map(as_json) | nested(JOURNAL_KEYS).map(as_json))
@example(b"[" * 100_000)
@example(b'{"version": 1, "last_number": 1' + b"0" * 5000 + b"}")
def test_any_journal_is_read_or_put_aside_and_the_next_intent_is_kept(content: bytes) -> None:
    files = ForgetfulFiles()
    Disk(files).replace(STATE / FILE_NAME, content)
    journal = Journal(STATE, Disk(files))
    trouble = journal.take()
    assert trouble is None or trouble.isprintable()
    opened = journal.open
    change = journal.intend(OpenReaddress(moves=(Move(device="a", old=SPOT, new=SPOT),), begun=5))
    files.power_cut()
    again = Journal(STATE, Disk(files))
    assert again.take() is None
    assert again.open == (*opened, change)


@given(
    st.binary(max_size=60)
    | nested(st.sampled_from(["version", "devices", "line", "slave", "baudrate", "poll", "x"])).map(as_json)
)
@example(b"[" * 500)
@example(b"version: 1\ndevices: &a [*a]\n")
def test_any_file_of_changes_is_understood_or_told(content: bytes) -> None:
    files = ForgetfulFiles()
    Disk(files).replace(STATE / "changes.yaml", content)
    found = ChangesFile(STATE, Disk(files)).take()
    assert found.trouble is None or str(found.trouble).isprintable()


@given(st.binary(max_size=60))
def test_any_counter_of_lives_gives_a_boot_of_eight_characters(content: bytes) -> None:
    files = ForgetfulFiles()
    Disk(files).replace(STATE / boot.FILE_NAME, content)
    begun = boot.begin(STATE, Disk(files), 1.7e9)
    assert len(begun.id) == 8
    assert begun.previous != begun.id


PROFILE_KEYS = st.sampled_from(
    [
        "name",
        "title",
        "device_class",
        "sources",
        "ids",
        "framings",
        "checksums",
        "max_words",
        "ascii_max_data",
        "min_interval",
        "function",
        "byte_order",
        "word_order",
        "values",
        "settings",
        "barrier",
        "baudrate",
        "slave_id",
        "factory",
        "busy_exceptions",
        "broadcast",
        "provenance",
        "notes",
        "address",
        "register",
        "count",
        "type",
        "unit",
        "scale",
        "offset",
        "range",
        "writable",
        "precision",
        "codes",
        "locked_by",
        "seen",
        "limit",
        "reserved",
        "unverified",
        "rtu",
        "ascii",
    ]
)
PLAIN_WORDS = st.sampled_from(
    [
        "lfs10",
        "uint16",
        "int32",
        "float32",
        "holding",
        "0x0001",
        "010",
        "1e999",
        ".nan",
        "-1",
        "0",
        "1",
        "125",
        "on",
        "~",
        "[]",
        "{}",
        "[1,247]",
        "big",
        "''",
        "*a",
    ]
)
YAML = st.recursive(
    PLAIN_WORDS | st.text(max_size=4).map(repr),
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]")
        | st.lists(st.tuples(PROFILE_KEYS, inner), max_size=5).map(
            lambda pairs: "{" + ", ".join(f"{key}: {value}" for key, value in pairs) + "}"
        )
    ),
    max_leaves=15,
)
PROFILES = st.lists(st.tuples(PROFILE_KEYS, YAML), max_size=8).map(
    lambda pairs: "".join(f"{key}: {value}\n" for key, value in pairs)
)
TANK = "name: tank\ntitle: Tank\nvalues: [{name: level, address: 1, register: 1, type: uint16, unit: m}]\n"


@given(PROFILES | st.text(max_size=80) | PROFILES.map(lambda more: TANK + more))
def test_any_text_is_a_profile_or_problems_with_their_places(text: str) -> None:
    told: tuple[Problem, ...] = ()
    try:
        profile = parse_profile(text, "any.yaml")
    except ConfigError as error:
        told = error.problems
        assert told
    else:
        assert profile.reads()
    for problem in told:
        assert str(problem).isprintable()
        assert problem.line >= 1
        assert problem.column >= 1
