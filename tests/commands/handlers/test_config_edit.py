"""What requests that change the configuration share: kept or refused, and in which words."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from lfs10d.command import RefusedError
from lfs10d.commands.handlers.config_edit import altered, apply_edit, as_json, known_device, refuse
from lfs10d.config.changes import Changes
from lfs10d.config.effective import Effective
from tests.support.context import Asked, FakeContext


def nothing_new(now: Effective) -> Changes:
    return now.changes


def test_an_edit_that_changes_nothing_leaves_what_holds(fake: FakeContext) -> None:
    before, now = asyncio.run(apply_edit(nothing_new, fake.context))
    assert before is now is fake.holding.now
    assert fake.done == []


def test_an_edit_that_cannot_be_kept_is_rejected_and_changes_nothing(fake: FakeContext, asked: Asked) -> None:
    asked("device/options", device="mast-top", enabled=False)
    before = fake.holding.now

    def without(now: Effective) -> Changes:
        return replace(now.changes, devices={})

    fake.disk.full = 0
    with pytest.raises(RefusedError) as caught:
        asyncio.run(apply_edit(without, fake.context))
    assert (caught.value.result.status, caught.value.result.code) == ("rejected", "storage_full")
    assert str(caught.value).endswith("; nothing was changed")
    assert fake.holding.now is before


def test_a_refusal_changed_nothing_and_says_why() -> None:
    refused = refuse("address_in_use", "id 3 is slave-3's", param="to", slave=3)
    assert (refused.result.status, refused.result.error()) == (
        "rejected",
        {"code": "address_in_use", "message": "id 3 is slave-3's", "param": "to", "slave": 3},
    )


def test_an_unknown_name_is_told_with_those_that_are_known(fake: FakeContext) -> None:
    with pytest.raises(RefusedError) as caught:
        known_device("nobody", fake.holding.now)
    assert str(caught.value) == "there is no device nobody; configured are: mast-top, slave-3"
    assert (caught.value.result.status, caught.value.result.code) == ("rejected", "unknown_device")
    assert caught.value.result.facts["param"] == "device"
    assert known_device("mast-top", fake.holding.now).id == 2


def test_where_no_device_is_configured_an_unknown_name_is_told_that(fake: FakeContext) -> None:
    fake.file.write_text("line: {port: tty}")
    fake.start()
    with pytest.raises(RefusedError, match=r"^there is no device nobody; configured are: none$"):
        known_device("nobody", fake.holding.now)


def test_a_device_is_shown_in_s_and_its_learned_time_out_as_auto(fake: FakeContext) -> None:
    mast = known_device("mast-top", fake.holding.now)
    assert as_json(mast, ("interval", "response_timeout")) == {"interval": 1.0, "response_timeout": "auto"}
    given = mast.model_copy(update={"response_timeout": 0.3})
    assert as_json(given, ("response_timeout",)) == {"response_timeout": 0.3}
    assert as_json(given, ("label",)) == {"label": None}


def test_what_a_change_alters_is_told_by_key_and_devices_as_a_whole(fake: FakeContext, asked: Asked) -> None:
    first = fake.holding.now
    asked("device/options", device="mast-top", enabled=False)
    asked("device/add", slave=9, name="roof", probe=False)
    asked("device/remove", device="slave-3")
    assert altered(first, fake.holding.now) == [
        {"key": "slaves.mast-top.enabled", "from": True, "to": False},
        {"key": "slaves.roof", "from": None, "to": "polled"},
        {"key": "slaves.slave-3", "from": "polled", "to": None},
    ]
    assert altered(first, first) == []
