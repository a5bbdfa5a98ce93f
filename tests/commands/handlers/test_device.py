"""What requests do to one device."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lfs10d.command import Command
from lfs10d.commands.handlers.device import NewDevice
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.commands.reads import ReadResult
from lfs10d.config.changes import Place
from lfs10d.config.changes_file import FILE_NAME
from lfs10d.line.jobs.ping import Ping
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode
from tests.support.context import Ask, Asked, FakeContext
from tests.support.device_requests import own_profile, slave

GOOD = {"device": "mast-top", "wind_speed": 12.5, "error": None}
BAD = {"device": "mast-top", "wind_speed": None, "error": "timeout"}


def test_a_reading_is_answered_with_its_sample(ask: Ask, fake: FakeContext) -> None:
    fake.read_result = ReadResult(GOOD, None)
    answer = ask("device/read", '{"device":"mast-top"}')
    assert (answer.status, answer.data, answer.error()) == ("ok", GOOD, None)
    assert fake.done == ["read mast-top"]


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (Fault(FaultCode.TIMEOUT, "no answer in 200 ms"), "timeout"),
        *((Fault(code, "something else"), "line_error") for code in FaultCode if code is not FaultCode.TIMEOUT),
    ],
)
def test_silence_is_a_timeout_and_everything_else_a_line_error(
    ask: Ask, fake: FakeContext, fault: Fault, code: str
) -> None:
    fake.read_result = ReadResult(BAD, fault)
    answer = ask("device/read", '{"device":"mast-top"}')
    assert (answer.status, answer.data) == ("failed", BAD)
    assert answer.error() == {"code": code, "message": f"mast-top: {fault.message}", "param": None}


def test_an_exception_is_told_with_its_code(ask: Ask, fake: FakeContext) -> None:
    fake.read_result = ReadResult(BAD, Fault(FaultCode.EXCEPTION, "refused", exception_code=2))
    error = ask("device/read", '{"device":"mast-top"}').error()
    assert error is not None
    assert (error["code"], error["exception_code"]) == ("line_error", 2)


def test_an_unknown_device_is_rejected_without_a_look_at_the_line(ask: Ask, fake: FakeContext) -> None:
    answer = ask("device/read", '{"device":"nobody"}')
    assert answer.status == "rejected"
    assert answer.error() == {
        "code": "unknown_device",
        "message": "there is no device nobody; configured are: mast-top, slave-3",
        "param": "device",
    }
    assert fake.done == []


@pytest.mark.parametrize("payload", ["{}", '{"device":3}', '{"device":null}', '{"device":"Mast Top"}', '{"slave":3}'])
def test_a_device_is_a_name_and_must_be_told(ask: Ask, payload: str) -> None:
    assert ask("device/read", payload).code == "invalid_param"


def test_a_device_that_went_before_it_was_asked_is_a_line_error(ask: Ask) -> None:
    answer = ask("device/read", '{"device":"slave-3"}')
    assert (answer.status, answer.code, answer.data) == ("failed", "line_error", None)


def test_a_device_whose_id_is_another_s_cannot_be_asked(ask: Ask, fake: FakeContext) -> None:
    fake.at = {9}
    assert ask("device/add", '{"slave":9,"name":"roof"}').status == "ok"
    fake.file.write_text(fake.file.read_text() + "  - {id: 9, name: tower}\n")
    fake.start()
    answer = ask("device/read", '{"device":"tower"}')
    assert (answer.status, answer.code) == ("failed", "line_error")
    assert answer.message.startswith("tower cannot be polled: slave id 9 is taken by roof")


# -- device/add

WHOLE = {"label": "Roof", "profile": "ld-e", "interval": 0.25}


def test_what_answers_is_added_with_what_was_said_of_it(asked: Asked, fake: FakeContext) -> None:
    fake.at = {9}
    data = {"slave": 9, **WHOLE, "enabled": True, "response_timeout": "auto"}
    assert asked("device/add", slave=9, name="roof", id="a1", **WHOLE) == ("ok", {"device": "roof", **data})
    assert fake.done == ["ping 9", ("slaves.roof",)]
    assert fake.told == [{"request": "device/add", "id": "a1", "device": "roof", "from": None, "to": data}]
    roof = slave(fake, "roof")
    assert (roof.id, roof.label, roof.profile, roof.interval) == (9, "Roof", "ld-e", 0.25)
    assert fake.holding.now.changes.of("roof").added_at == Place(9)


@pytest.mark.parametrize("nothing", [{}, {"name": None, "label": None, "interval": None}])
def test_what_is_not_said_is_as_for_everybody(asked: Asked, fake: FakeContext, nothing: dict[str, None]) -> None:
    fake.at = {9}
    _, data = asked("device/add", slave=9, **nothing)
    assert (data["device"], data["profile"], data["interval"], data["label"]) == ("slave-9", "lfs10", 2.0, None)
    assert fake.holding.now.changes.of("slave-9").added == {"id": 9}


SILENCE = Fault(FaultCode.TIMEOUT, "no answer in 1000 ms")
NOISE = Fault(FaultCode.CRC, "the check is wrong", heard=b"\x09\x03")


@pytest.mark.parametrize(
    ("fault", "code", "message"),
    [
        (SILENCE, "timeout", "slave 9 does not answer: no answer in 1000 ms; with probe false"),
        (NOISE, "timeout", "slave 9 does not answer: the check is wrong (received 09 03); with probe false"),
        (None, "line_error", "slave 9 could not be probed: the port is lost"),
    ],
)
def test_where_nobody_answers_nothing_is_added_and_what_was_heard_is_told(
    ask: Ask, fake: FakeContext, fault: Fault | None, code: str, message: str
) -> None:
    fake.silence = fault
    answer = ask("device/add", '{"slave":9}')
    assert (answer.status, answer.code, answer.facts) == ("rejected", code, {"param": None})
    assert answer.message.startswith(message)
    assert fake.done == ["ping 9"]
    assert (fake.told, fake.disk.exists(Path("/state") / FILE_NAME)) == ([], False)


def test_unprobed_it_is_added_though_nobody_answers(asked: Asked, fake: FakeContext) -> None:
    assert asked("device/add", slave=9, probe=False)[0] == "ok"
    assert "ping 9" not in fake.done
    assert fake.holding.now.changes.of("slave-9").added_at is None


@pytest.mark.parametrize(
    ("parameters", "code", "param"),
    [
        ({"slave": 2}, "address_in_use", "slave"),
        ({"slave": 3, "name": "other"}, "address_in_use", "slave"),
        ({"slave": 77}, "address_in_use", "slave"),
        ({"slave": 9, "name": "mast-top"}, "invalid_param", "name"),
        ({"slave": 248, "profile": "ld-e"}, "invalid_param", "slave"),
        ({"slave": 0}, "invalid_param", "slave"),
        ({"slave": "9"}, "invalid_param", "slave"),
        ({}, "invalid_param", "slave"),
        ({"slave": 9, "name": ""}, "invalid_param", "name"),
        ({"slave": 9, "name": "Roof"}, "invalid_param", "name"),
        ({"slave": 9, "label": ""}, "invalid_param", "label"),
        ({"slave": 9, "interval": "1"}, "invalid_param", "interval"),
        ({"slave": 9, "interval": "50ms", "profile": "own.yaml"}, "invalid_param", "interval"),
        ({"slave": 9, "probe": 1}, "invalid_param", "probe"),
        ({"slave": 9, "profile": "nonsense"}, "invalid_param", "profile"),
        ({"slave": 9, "profile": "gone.yaml"}, "invalid_param", "profile"),
        ({"slave": 9, "profile": "lfs10d.yaml"}, "invalid_param", "profile"),
        ({"slave": 9, "profile": "../own.yaml"}, "invalid_param", "profile"),
        ({"slave": 9, "profile": "secret"}, "invalid_param", "profile"),
        ({"slave": 9, "profile": "/etc/passwd"}, "invalid_param", "profile"),
        ({"slave": 9, "profile": "/etc/x.yaml"}, "invalid_param", "profile"),
        ({"slave": 9, "enabled": True}, "invalid_param", "enabled"),
    ],
)
def test_what_cannot_be_added_is_rejected_before_anybody_is_asked(
    asked: Asked, fake: FakeContext, parameters: dict[str, Any], code: str, param: str
) -> None:
    own_profile(fake)
    assert asked("device/add", **parameters) == ("rejected", (code, param))
    assert (fake.done, fake.told) == ([], [])


def test_a_profile_beside_the_configuration_can_be_used_and_nothing_of_another_file_is_told(
    ask: Ask, fake: FakeContext
) -> None:
    own_profile(fake)
    fake.file.with_name("login.yaml").write_text("hunter2: hunter2")
    fake.at = {9}
    assert ask("device/add", '{"slave":9,"profile":"own.yaml"}').status == "ok"
    answer = ask("device/add", '{"slave":10,"profile":"login.yaml"}')
    assert "hunter2" not in answer.message
    fake.at = {10}
    assert ask("device/add", '{"slave":10,"profile":"own.yaml"}').status == "ok"


def test_a_default_name_that_is_taken_is_rejected_with_the_name(ask: Ask, fake: FakeContext) -> None:
    fake.at = {9, 10}
    ask("device/add", '{"slave":9,"name":"slave-10"}')
    answer = ask("device/add", '{"slave":10}')
    assert (answer.code, answer.facts["param"]) == ("invalid_param", "name")
    assert answer.message == "name: the default slave-10 is taken; give it another name"
    assert fake.done.count("ping 10") == 0


def test_of_two_that_are_added_at_once_one_is(fake: FakeContext, asked: Asked) -> None:
    fake.at = {9}
    ping = fake.ping

    async def slow(slave: int, profile: Profile) -> Ping:
        fake.ping = ping  # type: ignore[method-assign]  # the other request is not asked again
        answer = await HANDLERS["device/add"].perform(NewDevice(slave=9, name="first"), fake.context, Command())
        assert answer.status == "ok"
        return await ping(slave, profile)

    fake.ping = slow  # type: ignore[method-assign]  # asked while this one waits
    assert asked("device/add", slave=9, name="second") == ("rejected", ("address_in_use", "slave"))
