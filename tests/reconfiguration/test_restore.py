"""What our own retained topics tell of an earlier life is a stranger's word until the line was asked."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.config.changes import Changes, DeviceChange, Place, Rate, Verified
from lfs10d.config.effective import Effective, effective
from lfs10d.config.loader import load
from lfs10d.reconfiguration.restore import LARGEST, ConfirmedPlace, RetainedState, restored, retained_state, topics

TEXT = """\
line: {port: x}
slaves: [{id: 2, name: a}, {id: 3, name: b}, {id: 4, name: c, profile: eh600}]
mqtt: {host: localhost}
"""


@pytest.fixture
def now(tmp_path: Path) -> Effective:
    file = tmp_path / "lfs10d.yaml"
    file.write_text(TEXT)
    return effective(load(file), Changes())


def verified(**slaves: int) -> dict[str, DeviceChange]:
    return {name: DeviceChange(verified=Verified(Place(slave))) for name, slave in slaves.items()}


# What is read


def test_the_topics_are_those_of_the_files_devices_and_of_the_line(now: Effective) -> None:
    assert topics(now) == {"line/state", "device/a/config", "device/b/config", "device/c/config"}


def test_our_own_payloads_are_understood() -> None:
    config = json.dumps({"v": 1, "slave": 9, "label": None, "interval": 1, "response_timeout": "auto"}).encode()
    state = json.dumps({"v": 1, "port": "/dev/ttyUSB0", "baudrate": 19200, "open": True}).encode()
    assert retained_state({"device/a/config": config, "line/state": state}) == RetainedState({"a": 9}, 19200)


@pytest.mark.parametrize(
    "payload",
    [
        b"", b"null", b"[]", b"9", b"{", b"\xff", b'{"slave": "9"}', b'{"slave": true}', b'{"slave": 9.0}',
        b'{"slave": 0}', b'{"slave": 256}', b'{"slave": NaN}', b'{"slave": 1e999}', b"[" * 4000,
        b'{"slave": 9, "label": "' + b"x" * LARGEST + b'"}',
    ],
)  # fmt: skip
def test_what_is_not_in_our_form_says_nothing(payload: bytes) -> None:
    state = payload.replace(b"slave", b"baudrate")
    assert retained_state({"device/a/config": payload, "line/state": state, "device/a": b"{}"}) == RetainedState({})


@pytest.mark.parametrize("rate", [0, 9601, -9600, 115201, "9600", None, 2**70])
def test_a_rate_that_no_line_has_says_nothing(rate: object) -> None:
    assert retained_state({"line/state": json.dumps({"baudrate": rate}).encode()}).baudrate is None


@given(st.dictionaries(st.sampled_from(["device/a/config", "line/state"]), st.binary(max_size=64)))
def test_whatever_is_retained_an_id_is_an_id_and_a_rate_a_rate(payloads: dict[str, bytes]) -> None:
    state = retained_state(payloads)
    assert all(1 <= slave <= 255 for slave in state.slaves.values())
    assert state.baudrate in (None, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)


# What is made of it


def test_a_silent_device_is_to_be_asked_for_at_both_places(now: Effective) -> None:
    changes, settled = restored(now, RetainedState({"a": 9, "b": 3}, 9600), frozenset({"b"}))
    assert (changes.devices, changes.baudrate, settled) == (verified(a=9), None, ())
    assert effective(now.file, changes).places["a"] == (Place(2, 9600), Place(9, 9600))


def test_where_nothing_differs_nothing_is_changed(now: Effective) -> None:
    assert restored(now, RetainedState({"a": 2, "b": 3}, 9600), frozenset()) == (Changes(), ())
    assert restored(now, RetainedState({}), frozenset()) == (Changes(), ())


def test_a_device_that_answers_where_the_file_has_it_is_there_and_that_is_told(now: Effective) -> None:
    told = ConfirmedPlace("a", Place(2, 9600), Place(9, 9600))
    assert restored(now, RetainedState({"a": 9}), frozenset({"a"})) == (Changes(), (told,))


def test_an_id_that_two_had_is_asked_for_neither(now: Effective) -> None:
    assert restored(now, RetainedState({"a": 9, "b": 9}), frozenset()) == (Changes(), ())
    assert restored(now, RetainedState({"a": 3, "b": 3}), frozenset()) == (Changes(), ())


def test_who_answers_at_an_id_that_was_another_s_is_not_known_yet(now: Effective) -> None:
    """The sensor of b was moved to 2 after that of a was moved from there to 9."""
    changes, settled = restored(now, RetainedState({"a": 9, "b": 2}), frozenset({"a"}))
    assert (changes.devices, settled) == (verified(a=9, b=2), ())


@pytest.mark.parametrize("slave", [9, 250])
def test_a_device_whose_id_no_request_can_set_is_where_the_file_says(now: Effective, slave: int) -> None:
    assert restored(now, RetainedState({"c": slave}), frozenset()) == (Changes(), ())


def test_devices_that_the_file_has_not_are_nobody(now: Effective) -> None:
    assert restored(now, RetainedState({"gone": 9}), frozenset()) == (Changes(), ())


def test_what_a_change_says_already_holds(now: Effective) -> None:
    known = Changes({"a": DeviceChange(verified=Verified(Place(7), file=2))}, Rate(9600, 19200))
    held = effective(now.file, known)
    assert restored(held, RetainedState({"a": 9}, 4800), frozenset()) == (held.changes, ())
    removed = effective(now.file, Changes().removing("a", now.file_values))
    assert restored(removed, RetainedState({"a": 9}), frozenset()) == (removed.changes, ())
    optioned = effective(now.file, Changes().setting("a", {"enabled": False}, now.file_values))
    changes, _ = restored(optioned, RetainedState({"a": 9}), frozenset())
    assert changes.of("a").verified == Verified(Place(9))
    assert changes.of("a").options == {"enabled": False}


def test_at_another_rate_all_are_asked_while_nobody_answers(now: Effective) -> None:
    changes, settled = restored(now, RetainedState({"a": 9}, 19200), frozenset())
    assert (changes, settled) == (Changes(verified(a=9), Rate(19200, 19200)), ())
    places = effective(now.file, changes).places
    assert places["a"] == (Place(2, 9600), Place(9, 19200))
    assert places["b"] == (Place(3, 9600), Place(3, 19200))


def test_one_answer_settles_the_rate_of_the_line(now: Effective) -> None:
    changes, settled = restored(now, RetainedState({"a": 9}, 19200), frozenset({"b", "c"}))
    assert changes == Changes(verified(a=9))
    assert settled == (ConfirmedPlace("b", Place(3, 9600), Place(3, 19200)),)
