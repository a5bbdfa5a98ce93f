"""`register/read` and `register/write`: what is permitted, and how each end is told."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.command import Result
from lfs10d.line.jobs.access_end import End
from lfs10d.modbus.request import ReadRegisters, WriteRegister
from lfs10d.profiles.library import builtin_names
from lfs10d.reading import Fault, FaultCode
from tests.support.context import Ask, FakeContext

VANE = """\
name: vane
title: Vane
slave_id: {register: 0x0BB8}
values: [{name: direction, register: 0, type: uint16, unit: deg}]
max_words: 8
settings:
  - {name: averaging, register: 0x0010, type: int16, scale: 0.1, unit: s, range: [-1, 60], writable: true}
  - {name: serial, register: 0x0011}
"""
FILE = """\
line: {port: tty}
slaves:
  - {id: 2, name: mast-top}
  - {id: 3, name: motor, profile: eh600}
  - {id: 4, name: pump, profile: fuling-dzb, enabled: false}
  - {id: 5, name: vane, profile: vane.yaml}
  - {id: 6, name: laser, profile: ld-e}
"""
NAMES = {"lfs10": "mast-top", "eh600": "motor", "fuling-dzb": "pump", "ld-e": "laser"}
OFTEN = [0x1000, 0x1001, 0x2000, 0x2001, 0x3000, 0xF002, 0xFC00, 4, 5, 0x0161, 0x0162, 0x07D0, 0x07D1]
"""Addresses at which one of them keeps what must not be written."""
OTHERS = [name for name in builtin_names() if name not in NAMES]
FILE += "".join(f"  - {{id: {slave}, name: {name}, profile: {name}}}\n" for slave, name in enumerate(OTHERS, 20))
REFUSED = Fault(FaultCode.EXCEPTION, "exception 02 illegal register address", 2)
SILENCE = Fault(FaultCode.TIMEOUT, "no answer in 1000 ms")
NOISE = Fault(FaultCode.CRC, "check failed")
BUSY = Fault(FaultCode.EXCEPTION, "exception 06 busy", 6, busy=True)


@pytest.fixture(autouse=True)
def _devices(fake: FakeContext) -> None:
    fake.file.with_name("vane.yaml").write_text(VANE)
    fake.file.write_text(FILE)
    fake.start()
    fake.came = {"end": End.DONE, "registers": (7,), "before": 1, "sent": True}


def told(ask: Ask, name: str, **parameters: Any) -> Result:  # noqa: ANN401  # as JSON has it
    return ask(f"register/{name}", json.dumps(parameters))


# -- what is asked


@pytest.mark.parametrize(
    ("whom", "device", "slave"),
    [
        ({"device": "motor"}, "motor", 3),
        ({"slave": 3}, "motor", 3),
        ({"slave": 88}, None, 88),
        ({"slave": 4}, "pump", 4),
    ],
)
def test_registers_are_read_of_a_device_or_of_any_slave(
    ask: Ask, fake: FakeContext, whom: dict[str, Any], device: str | None, slave: int
) -> None:
    fake.came["registers"] = (1, 2)
    answer = told(ask, "read", **whom, address=16, count=2)
    assert fake.done == [(device, ReadRegisters(slave, 16, 2))]
    assert answer.status == "ok"
    assert answer.data == {"device": device, "slave": slave, "address": 16, "registers": [1, 2]}


def test_one_register_is_read_where_no_count_is_given(ask: Ask, fake: FakeContext) -> None:
    told(ask, "read", slave=88, address=0)
    assert fake.done == [(None, ReadRegisters(88, 0, 1))]


def test_a_device_that_knows_function_16_only_is_written_by_it(ask: Ask, fake: FakeContext) -> None:
    fake.file.with_name("vane.yaml").write_text(VANE + "write_function: 16\n")
    fake.start()
    assert told(ask, "write", device="vane", address=16, value=600).status == "ok"
    assert fake.done == [("vane", WriteRegister(5, 16, 600, 16))]


def test_a_setting_is_written_and_everybody_told_from_what_to_what(ask: Ask, fake: FakeContext) -> None:
    answer = ask("register/write", '{"id":"w1","device":"vane","address":16,"value":600}')
    place = {"device": "vane", "slave": 5, "address": 16}
    assert fake.done == [("vane", WriteRegister(5, 16, 600))]
    assert (answer.status, answer.data) == ("ok", {**place, "value": 600, "before": 1})
    assert fake.told == [{"request": "register/write", "id": "w1", **place, "from": 1, "to": 600}]


@pytest.mark.parametrize(("slave", "address"), [(88, 0x0010), (88, 0), (200, 0xFFFF)])
def test_a_slave_that_is_not_configured_is_written_as_asked(
    ask: Ask, fake: FakeContext, slave: int, address: int
) -> None:
    assert told(ask, "write", slave=slave, address=address, value=65535).status == "ok"
    assert fake.done == [(None, WriteRegister(slave, address, 65535))]


# -- what is not permitted


@pytest.mark.parametrize(
    ("whom", "address", "words"),
    [
        ({"device": "mast-top"}, 0x0005, "sets its slave id: use device/readdress"),
        ({"device": "mast-top"}, 0x0004, "sets its baud rate: use line/baudrate"),
        ({"slave": 2}, 0x0005, "sets its slave id"),
        ({"slave": 88}, 0x0005, "0x0005 of a LFS10 wind speed sensor sets its slave id"),
        ({"slave": 88}, 0x0004, "0x0004 of a LFS10 wind speed sensor sets its baud rate"),
        ({"slave": 88}, 0x0BB8, "0x0BB8 of a Vane sets its slave id"),
        ({"slave": 88}, 0x2000, "0x2000 of a Fuling DZB inverter triggers an action: it is never written"),
        ({"device": "motor"}, 0x2000, "triggers an action"),
        ({"device": "mast-top"}, 0x0003, "0x0003 is no setting in profile lfs10; writable are: none"),
        ({"device": "motor"}, 0xF002, "0xF002 is no setting in profile eh600"),
        ({"device": "motor"}, 0xFC00, "0xFC00 is fc_00, which is not marked writable, in profile eh600"),
        ({"device": "pump"}, 0x3000, "set_frequency, which is not marked writable"),
        ({"device": "vane"}, 0x0011, "serial, which is not marked writable, in profile vane; "),
        ({"device": "vane"}, 0x0012, "writable are: 0x0010 (averaging)"),
    ],
)
def test_what_must_not_be_written_is_not_allowed(
    ask: Ask, fake: FakeContext, whom: dict[str, Any], address: int, words: str
) -> None:
    answer = told(ask, "write", **whom, address=address, value=1)
    assert (answer.status, answer.code, answer.facts["param"]) == ("rejected", "not_allowed", "address")
    assert words in answer.message
    assert fake.done == []


@pytest.mark.parametrize(("name", "more"), [("read", {}), ("write", {"value": 1})])
def test_nothing_is_sent_to_everybody(ask: Ask, fake: FakeContext, name: str, more: dict[str, int]) -> None:
    answer = told(ask, name, slave=0, address=16, **more)
    assert (answer.status, answer.code, answer.facts["param"]) == ("rejected", "not_allowed", "slave")
    assert fake.done == []


def test_where_a_physical_change_is_open_registers_are_read_but_not_written(ask: Ask, fake: FakeContext) -> None:
    answer = told(ask, "write", slave=77, address=16, value=1)
    assert (answer.status, answer.code, fake.done) == ("rejected", "busy", [])
    assert answer.message == "slave id 77 is reserved by the open change of slave-3; write when that is over"
    assert told(ask, "read", slave=77, address=16).status == "ok"


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (601, "value: averaging takes -1..60 s; register content 601 is 60.1 s"),
        (0x8000, "value: averaging takes -1..60 s; register content 32768 is -3276.8 s"),
    ],
)
def test_a_value_outside_the_settings_range_is_an_invalid_parameter(
    ask: Ask, fake: FakeContext, value: int, words: str
) -> None:
    answer = told(ask, "write", device="vane", address=16, value=value)
    assert (answer.status, answer.code, answer.facts["param"]) == ("rejected", "invalid_param", "value")
    assert (answer.message, fake.done) == (words, [])


@pytest.mark.parametrize(
    ("name", "parameters", "param"),
    [
        ("read", {"address": 1}, "device"),
        ("read", {"device": "vane", "slave": 5, "address": 1}, "device"),
        ("read", {"device": None, "address": 1}, "device"),
        ("read", {"slave": 256, "address": 1}, "slave"),
        ("read", {"slave": True, "address": 1}, "slave"),
        ("read", {"slave": 5}, "address"),
        ("read", {"slave": 5, "address": 65536}, "address"),
        ("read", {"slave": 5, "address": "0x0010"}, "address"),
        ("read", {"slave": 5, "address": 1, "count": 0}, "count"),
        ("read", {"slave": 88, "address": 1, "count": 126}, "count"),
        ("read", {"slave": 88, "address": 65535, "count": 2}, "count"),
        ("read", {"device": "motor", "address": 1, "count": 6}, "count"),
        ("read", {"device": "vane", "address": 1, "count": 9}, "count"),
        ("read", {"slave": 5, "address": 1, "value": 1}, "value"),
        ("write", {"slave": 88, "address": 16}, "value"),
        ("write", {"slave": 88, "address": 16, "value": -1}, "value"),
        ("write", {"slave": 88, "address": 16, "value": 65536}, "value"),
        ("write", {"slave": 88, "address": 16, "value": 1.0}, "value"),
        ("write", {"slave": 88, "address": 16, "value": 1, "count": 1}, "count"),
    ],
)
def test_what_cannot_be_asked_is_an_invalid_parameter(
    ask: Ask, fake: FakeContext, name: str, parameters: dict[str, Any], param: str
) -> None:
    answer = told(ask, name, **parameters)
    assert (answer.status, answer.code, answer.facts["param"]) == ("rejected", "invalid_param", param)
    assert fake.done == []


def test_a_read_longer_than_the_device_gives_is_told_with_its_limit(ask: Ask) -> None:
    assert told(ask, "read", device="motor", address=1, count=6).message == (
        "count: one read of a EH600 inverter brings at most 5 registers"
    )


def test_an_unknown_device_is_told_which_there_are(ask: Ask, fake: FakeContext) -> None:
    answer = told(ask, "write", device="nobody", address=1, value=1)
    assert (answer.status, answer.code, fake.done) == ("rejected", "unknown_device", [])


@pytest.mark.parametrize(("name", "more"), [("read", {}), ("write", {"value": 60})])
def test_a_device_whose_id_is_another_ones_now_is_not_asked(
    ask: Ask, fake: FakeContext, name: str, more: dict[str, int]
) -> None:
    fake.holding.now = replace(fake.holding.now, conflicts={"vane": "its id is that of motor"})
    answer = told(ask, name, device="vane", address=16, **more)
    assert (answer.status, answer.code, answer.message) == (
        "rejected",
        "line_error",
        "vane cannot be accessed: its id is that of motor",
    )
    assert fake.done == []


@pytest.mark.parametrize("name", builtin_names())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30, deadline=None)
@given(
    address=st.integers(0, 0xFFFF) | st.sampled_from(OFTEN),
    value=st.integers(0, 0xFFFF),
)
def test_nothing_but_documented_settings_is_ever_written(
    ask: Ask, fake: FakeContext, name: str, address: int, value: int
) -> None:
    """LD-E's 0x1000 is the only writable register of all that come with lfs10d, and 1 its only content."""
    fake.done.clear()
    answer = told(ask, "write", device=NAMES.get(name, name), address=address, value=value)
    permitted = (name, address, value) == ("ld-e", 0x1000, 1)
    assert bool(fake.done) is permitted
    assert (answer.status == "ok") is permitted


# -- how it ends


@pytest.mark.parametrize(
    ("end", "fault", "code", "words"),
    [
        (End.REFUSED, REFUSED, "refused", "slave 5: exception 02 illegal register address"),
        (End.BUSY, BUSY, "busy", "slave 5: exception 06 busy"),
        (End.UNANSWERED, SILENCE, "timeout", "slave 5: no answer in 1000 ms"),
        (End.UNANSWERED, NOISE, "line_error", "slave 5: check failed"),
        (End.CUT_OFF, None, "line_error", "slave 5: the port is lost"),
    ],
)
def test_a_read_that_brought_nothing_failed(
    ask: Ask, fake: FakeContext, end: End, fault: Fault | None, code: str, words: str
) -> None:
    fake.came = {"end": end, "fault": fault}
    answer = told(ask, "read", device="vane", address=16)
    assert (answer.status, answer.code, answer.message) == ("failed", code, words)
    assert answer.facts.get("exception_code") == (fault and fault.exception_code)


@pytest.mark.parametrize("sent", [True, False])
@pytest.mark.parametrize(
    ("end", "fault", "code"),
    [
        (End.REFUSED, REFUSED, "refused"),
        (End.BUSY, BUSY, "busy"),
        (End.UNANSWERED, SILENCE, "timeout"),
        (End.ECHO_UNKNOWN, None, "line_error"),
        (End.CUT_OFF, None, "line_error"),
    ],
)
def test_a_write_that_was_not_even_sent_is_rejected_and_any_other_failed(
    ask: Ask, fake: FakeContext, end: End, fault: Fault | None, code: str, *, sent: bool
) -> None:
    fake.came = {"end": end, "fault": fault, "sent": sent}
    answer = told(ask, "write", device="vane", address=16, value=2)
    assert (answer.status, answer.code) == ("failed" if sent else "rejected", code)
    assert answer.message.endswith("; nothing was written") is not sent
    assert answer.facts.get("exception_code") == (fault and fault.exception_code)
    assert fake.told == []


def test_a_write_that_did_not_take_tells_what_the_register_holds(ask: Ask, fake: FakeContext) -> None:
    fake.came = {"end": End.NOT_VERIFIED, "registers": (1,), "before": 1, "sent": True}
    answer = told(ask, "write", device="vane", address=16, value=2)
    assert (answer.status, answer.code) == ("failed", "not_verified")
    assert answer.message == "slave 5: the register holds 1 and not what was written"
    assert answer.data == {"device": "vane", "slave": 5, "address": 16, "value": 1, "before": 1}
    assert fake.told == []


def test_a_write_that_cannot_be_read_back_is_not_verified(ask: Ask, fake: FakeContext) -> None:
    fake.came = {"end": End.NOT_VERIFIED, "fault": REFUSED, "sent": True}
    answer = told(ask, "write", slave=88, address=16, value=2)
    assert (answer.status, answer.code, answer.data) == ("failed", "not_verified", None)
    assert answer.message == ("slave 88: what was written cannot be read back: exception 02 illegal register address")
    assert answer.facts["exception_code"] == 2
