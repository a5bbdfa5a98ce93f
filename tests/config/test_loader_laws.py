"""Any text is a configuration, or problems with their places."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from lfs10d.config.loader import load
from lfs10d.errors import ConfigError, Problem

pytestmark = pytest.mark.usefixtures("in_a_folder_of_its_own")


KEYS = st.sampled_from(
    [
        "line",
        "port",
        "slaves",
        "id",
        "name",
        "mqtt",
        "host",
        "tls",
        "ca",
        "poll",
        "interval",
        "commands",
        "rs485",
        "store",
        "max_size",
        "wind",
        "profile",
        "password_file",
        "log",
        "level",
        "key",
        "x",
    ]
)
WORDS = st.sampled_from(
    [
        "/dev/x",
        "2",
        "3",
        "'9'",
        "250ms",
        "0",
        "auto",
        "null",
        "true",
        "on",
        ".inf",
        "lfs10",
        "[]",
        "{}",
        "-1",
        "1e400",
        "polling",
        "512MB",
        "'\\0'",
        '"\\0"',
        '"\\ud800"',
        "*a",
        "&a 1",
        "5",
        "9" * 50,
        "!!x y",
    ]
)
YAML = st.recursive(
    WORDS,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]")
        | st.lists(st.tuples(KEYS | WORDS, inner), max_size=4).map(
            lambda pairs: "{" + ", ".join(f"{key}: {value}" for key, value in pairs) + "}"
        )
    ),
    max_leaves=12,
)
SECTIONS = st.lists(st.tuples(KEYS, YAML), max_size=6).map(
    lambda pairs: "".join(f"{key}: {value}\n" for key, value in pairs)
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(SECTIONS | st.text() | YAML)
@example("line: {port: x}\nslaves: [{id: 2, profile: /dev/null}]")
@example('line: {port: x}\nslaves: [{id: 2, profile: "."}]')
@example("line: {port: x}\nslaves: [[], {}, {id: []}, {id: {}}, ~]\ncommands: [{}]\nmqtt: {tls: {ca: {}}}")
@example('line: {port: x}\n"": 1\n? {a: 1}\n: 2')
def test_any_text_is_a_configuration_or_problems_with_their_places(text: str) -> None:
    Path("any.yaml").write_bytes(text.encode(errors="surrogatepass"))
    told: tuple[Problem, ...] = ()
    try:
        load(Path("any.yaml"), environment={}, host="gateway")
    except ConfigError as error:
        told = error.problems
    assert list(told) == sorted(set(told), key=lambda one: (one.file != "any.yaml", one))
    for problem in told:
        assert str(problem).isprintable()
        assert problem.line >= 1
        assert problem.column >= 1
