"""`config/get`, `config/reload` and `config/reset`."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.config.changes import Changes, DeviceChange, Place, Verified
from lfs10d.config.effective import effective
from tests.support.context import FILE, Ask, Asked, FakeContext


def test_the_configuration_is_told(ask: Ask) -> None:
    data = ask("config/get").data
    assert isinstance(data, dict)
    assert [slave["name"] for slave in data["config"]["slaves"]] == ["mast-top", "slave-3"]
    assert data["origins"]["poll.interval"].endswith("lfs10d.yaml:2")
    assert "poll.offline_after" not in data["origins"]


def test_a_reload_tells_what_was_applied_and_what_needs_a_restart(ask: Ask, fake: FakeContext) -> None:
    fake.file.write_text(FILE.replace("2s", "3s").replace("port: tty", "port: tty, name: north"))
    assert ask("config/reload").data == {
        "applied": ["poll.interval", "slaves.slave-3.interval"],
        "restart_required": ["line.name"],
    }


def test_a_broken_file_is_rejected_with_its_first_line(ask: Ask, fake: FakeContext) -> None:
    fake.file.write_text(FILE.replace("name: mast-top", "name: 7").replace("id: 2", "id: 0"))
    answer = ask("config/reload")
    assert (answer.status, answer.code) == ("rejected", "invalid_param")
    assert answer.message.endswith("lfs10d.yaml:4:10: slaves[0].id: must be a whole number from 1 to 255, not 0")


# -- config/reset


@pytest.fixture
def changed(asked: Asked, fake: FakeContext) -> None:
    """Change two options of one device, remove the other, add a third."""
    asked("device/options", device="mast-top", interval="250ms", label="Top")
    asked("device/remove", device="slave-3")
    asked("device/add", slave=9, name="roof", probe=False)
    fake.done.clear()
    fake.told.clear()


INTERVAL = {"key": "slaves.mast-top.interval", "from": 0.25, "to": 1.0}
LABEL = {"key": "slaves.mast-top.label", "from": "Top", "to": None}
BACK = {"key": "slaves.slave-3", "from": None, "to": "polled"}
GONE = {"key": "slaves.roof", "from": "polled", "to": None}


@pytest.mark.usefixtures("changed")
@pytest.mark.parametrize(
    ("parameters", "device", "dropped", "altered"),
    [
        ({"device": "mast-top"}, "mast-top", ["slaves.mast-top.interval", "slaves.mast-top.label"], [LABEL, INTERVAL]),
        ({"key": "slaves.mast-top.interval"}, "mast-top", ["slaves.mast-top.interval"], [INTERVAL]),
        ({"device": "mast-top", "key": "label"}, "mast-top", ["slaves.mast-top.label"], [LABEL]),
        ({"device": "mast-top", "key": "slaves.mast-top.label"}, "mast-top", ["slaves.mast-top.label"], [LABEL]),
        ({"device": "slave-3"}, "slave-3", ["slaves.slave-3"], [BACK]),
        ({"key": "slaves.roof"}, "roof", ["slaves.roof"], [GONE]),
    ],
)
def test_what_was_changed_is_taken_back_and_told(
    asked: Asked,
    fake: FakeContext,
    parameters: dict[str, Any],
    device: str,
    dropped: list[str],
    altered: list[dict[str, Any]],
) -> None:
    data = {"dropped": dropped, "changed": altered}
    assert asked("config/reset", id="r", **parameters) == ("ok", data)
    assert fake.told == [{"request": "config/reset", "id": "r", "device": device, **data}]
    before = fake.holding.now
    fake.disk.power_cut()
    fake.start()
    assert fake.holding.now == before


@pytest.mark.usefixtures("changed")
@pytest.mark.parametrize(
    ("parameters", "code", "param"),
    [
        ({}, "invalid_param", "device"),
        ({"device": "nobody"}, "unknown_device", "device"),
        ({"key": "slaves.nobody.interval"}, "unknown_device", "device"),
        ({"device": "mast-top", "key": "enabled"}, "invalid_param", "key"),
        ({"device": "mast-top", "key": "id"}, "invalid_param", "key"),
        ({"device": "roof", "key": "interval"}, "invalid_param", "key"),
        ({"device": "roof", "key": "slaves.mast-top.label"}, "invalid_param", "key"),
        ({"key": "interval"}, "invalid_param", "key"),
        ({"key": "poll.interval"}, "invalid_param", "key"),
        ({"key": "line.baudrate"}, "invalid_param", "key"),
        ({"key": "slaves.mast-top.interval.x"}, "invalid_param", "key"),
        ({"key": "x" * 101}, "invalid_param", "key"),
        ({"device": ""}, "invalid_param", "device"),
    ],
)
def test_what_was_not_changed_cannot_be_taken_back(
    asked: Asked, fake: FakeContext, parameters: dict[str, Any], code: str, param: str
) -> None:
    assert asked("config/reset", **parameters) == ("rejected", (code, param))
    assert (fake.done, fake.told) == ([], [])


def test_a_device_without_changes_has_none_to_take_back(ask: Ask) -> None:
    answer = ask("config/reset", '{"device":"mast-top"}')
    assert (answer.code, answer.facts["param"]) == ("invalid_param", "device")
    assert answer.message == "device: no request changed anything of mast-top"


@pytest.mark.parametrize("parameters", [{"device": "mast-top"}, {"key": "slaves.mast-top.id"}])
def test_a_slave_id_is_a_fact_that_nobody_takes_back(
    ask: Ask, asked: Asked, fake: FakeContext, parameters: dict[str, Any]
) -> None:
    fake.holding.now = effective(
        fake.holding.now.file, Changes({"mast-top": DeviceChange(verified=Verified(Place(7), 2))})
    )
    status, (code, _) = asked("config/reset", **parameters)
    assert (status, code) == ("rejected", "invalid_param")
    message = ask("config/reset", '{"device":"mast-top"}').message
    assert message.endswith("the slave id of mast-top was verified on the line; device/readdress changes it")


def test_a_device_does_not_come_back_to_an_id_that_is_another_s_now(asked: Asked, fake: FakeContext) -> None:
    asked("device/remove", device="slave-3")
    asked("device/add", slave=3, name="other", probe=False)
    before = fake.holding.now
    assert asked("config/reset", device="slave-3") == ("rejected", ("address_in_use", None))
    assert fake.holding.now is before


def test_what_cannot_be_kept_is_not_taken_back(asked: Asked, fake: FakeContext) -> None:
    asked("device/options", device="mast-top", enabled=False)
    fake.disk.full = 0
    assert asked("config/reset", device="mast-top") == ("rejected", ("storage_full", None))
    assert fake.holding.now.changes.count == 1
