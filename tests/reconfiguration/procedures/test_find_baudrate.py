"""While every sensor is offline they are asked at the other rate in turn, and what answers there is told."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from lfs10d.line.device import Device, DeviceSpec, Health, PollRules
from lfs10d.line.jobs.job import Hold
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.profiles.library import load_profile
from lfs10d.reconfiguration.procedures.find_baudrate import LOST_AFTER, find_other_rates, message
from tests.support.sensors import Pretence

RTU = Codec(Framing.RTU)


def device(slave: int, *, profile: str = "lfs10", enabled: bool = True) -> Device:
    """Return a device that is offline."""
    spec = DeviceSpec(f"s{slave}", slave, load_profile(profile, relative_to=Path()), RTU, 1.0, enabled=enabled)
    return Device(spec, PollRules(), slave, health=Health.OFFLINE)


class Search:
    """A search among devices, carried on step by step."""

    def __init__(self, pretence: Pretence, *devices: Device) -> None:
        self.pretence = pretence
        self.devices = devices
        self.told: list[object] = []
        self._steps: Generator[Any, Any, None] = find_other_rates(lambda: self.devices, pretence.clock, 9600)

    def go_on(self, seconds: float) -> None:
        """Let it search for so long."""
        until = self.pretence.clock.now + seconds
        value: object = None
        while self.pretence.clock.now < until:
            step = self._steps.send(value)
            value = None
            if isinstance(step, Ask):
                value = self.pretence.outcome(step)
            elif isinstance(step, Hold):
                assert step.until is not None
                self.pretence.clock.now = step.until
            else:
                self.told.append(step.what)


def test_before_half_a_minute_nobody_is_asked_elsewhere(pretence: Pretence) -> None:
    search = Search(pretence, device(3), device(4))
    search.go_on(LOST_AFTER)
    assert pretence.asked == []
    search.go_on(5.0)
    assert {(ask.request.slave, ask.baudrate) for ask in pretence.asked} == {(3, 19200), (4, 19200)}


def test_what_answers_is_told_as_often_as_it_changes(pretence: Pretence) -> None:
    pretence.sensor(3, baudrate=19200)
    pretence.sensor(4, baudrate=19200)
    search = Search(pretence, device(3), device(4))
    search.go_on(60.0)
    assert search.told == [{"s4": 19200}, {"s4": 19200, "s3": 19200}]


def test_while_one_answers_nobody_is_asked_elsewhere(pretence: Pretence) -> None:
    online = device(3)
    online.health = Health.ONLINE
    Search(pretence, online, device(4)).go_on(60.0)
    assert pretence.asked == []


def test_when_one_is_back_what_was_found_is_taken_back_once_and_the_wait_begins_anew(pretence: Pretence) -> None:
    pretence.sensor(3, baudrate=19200)
    sought = device(3)
    search = Search(pretence, sought)
    search.go_on(40.0)
    sought.health = Health.ONLINE
    search.go_on(10.0)
    assert search.told == [{"s3": 19200}, {}]
    sought.health = Health.OFFLINE
    pretence.asked.clear()
    search.go_on(LOST_AFTER)
    assert pretence.asked == []
    search.go_on(5.0)
    assert search.told[2:] == [{"s3": 19200}]


@pytest.mark.parametrize("devices", [(), (device(3, enabled=False),)])
def test_without_enabled_devices_nobody_is_lost(pretence: Pretence, devices: tuple[Device, ...]) -> None:
    Search(pretence, *devices).go_on(60.0)
    assert pretence.asked == []


def test_a_device_whose_profile_knows_no_other_rate_is_not_asked(pretence: Pretence) -> None:
    Search(pretence, device(3, profile="eh600")).go_on(60.0)
    assert pretence.asked == []


def test_a_person_is_told_how_many_answer_at_which_rate_and_what_to_do() -> None:
    assert message({"s4": 19200, "s3": 19200}, 9600, 8, filed=9600) == (
        "no sensor answers at 9600 baud, but 2 of 8 at 19200 baud do (s3, s4); "
        "set line.baudrate to 19200; then line/baudrate can move them"
    )


def test_sensors_at_two_rates_are_to_be_moved_one_rate_at_a_time() -> None:
    assert message({"s4": 19200, "s3": 19200, "s5": 4800}, 9600, 8, filed=9600) == (
        "no sensor answers at 9600 baud, but 1 of 8 at 4800 and 2 of 8 at 19200 baud do (s3, s4, s5); "
        "leave only those of one rate on the line; for 19200: set line.baudrate to 19200; "
        "then line/baudrate can move them"
    )


def test_where_a_request_has_moved_the_line_away_from_the_file_s_rate_the_file_must_be_edited_twice() -> None:
    """The same value once more in the file is no edit; see `lfs10d.config.merge`."""
    assert message({"s3": 9600}, 19200, 1, filed=9600) == (
        "no sensor answers at 19200 baud, but 1 of 1 at 9600 baud do (s3); "
        "set line.baudrate to 19200 and reload, then to 9600 and reload; then line/baudrate can move them"
    )
