"""Every request with anything in its parameters: it is answered, and the answer is JSON."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.commands.handlers.registry import HANDLERS
from tests.support.context import Ask, FakeContext

WORDS = st.sampled_from(
    [
        "mast-top",
        "slave-3",
        "nobody",
        "",
        "1s",
        "250ms",
        "9" * 300,
        "auto",
        "\0",
        "\x1b]0;x\x07",
        "lfs10",
        "../x",
        "1-255",
        "255-1",
        "/dev/null",
        "/proc/self/mem",
    ]
)
PLAIN = (
    st.none()
    | st.booleans()
    | st.sampled_from([0, 1, 2, 3, 77, 247, 255, 256, -1, 9600, 19200, 65535, 2**63, 10**400])
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | WORDS
    | st.text(max_size=80)
)
VALUES = st.recursive(
    PLAIN,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.parametrize("name", sorted(HANDLERS))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_the_parameters_are_one_answer_comes(
    ask: Ask, fake: FakeContext, name: str, data: st.DataObject
) -> None:
    del fake.done[:]
    keys = st.sampled_from([*HANDLERS[name].spec.parameters.model_fields, "id", "transaction"])
    parameters: dict[str, Any] = data.draw(st.dictionaries(keys, VALUES))
    answer = ask(name, json.dumps(parameters))
    assert answer.status in {"ok", "rejected", "failed"}
    json.dumps([answer.data, answer.error()], allow_nan=False)
    assert answer.status != "rejected" or "change" not in fake.done
    error = answer.error()
    assert error is None or str(error["message"]).isprintable()
