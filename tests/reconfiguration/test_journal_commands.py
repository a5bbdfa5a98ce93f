"""Requests and answers go into the journal and come back as they were."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.command import Command, Result, failed, ok, rejected
from lfs10d.reconfiguration.journal_commands import command_of, command_record, result_of, result_record

KEYS = st.none() | st.text(max_size=64) | st.integers()
CALLS = st.builds(
    Command, KEYS, KEYS, fingerprint=st.text(), topic=st.none() | st.text(), correlation=st.none() | st.binary()
)


@given(CALLS)
def test_a_request_comes_back_as_it_was(call: Command) -> None:
    record = command_record("device/readdress", call)
    assert (record.name, record.key) == ("device/readdress", call.key)
    assert command_of(record) == call


@given(
    st.sampled_from(
        [ok({"a": 1}), rejected("address_in_use", "taken", param="to"), failed("refused", "no", exception_code=3)]
    )
)
def test_an_answer_comes_back_as_it_was(answer: Result) -> None:
    kept = result_record(command_record("x", Command("a")), answer, 5)
    assert kept is not None
    assert kept.at == 5
    again = result_of(kept)
    assert (again.status, again.data, again.error()) == (answer.status, answer.data, answer.error())


def test_an_answer_that_nobody_asked_for_is_not_kept() -> None:
    assert result_record(None, ok(), 5) is None
