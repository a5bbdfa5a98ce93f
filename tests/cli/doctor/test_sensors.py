"""What the doctor says of sensors: by the daemon's state, or by what they answer when they are asked."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NoReturn

import pytest

from lfs10d.cli.doctor import sensors
from lfs10d.cli.doctor.sensors import by_asking, by_daemon
from lfs10d.cli.render.live_state import LiveState
from lfs10d.config.loader import load
from lfs10d.errors import PortGoneError
from lfs10d.line.settings import line_rules, port_settings
from lfs10d.modbus.bus import LineRules
from lfs10d.modbus.port_settings import PortSettings

NOW = 1.8e9


def live(*messages: tuple[str, Any]) -> LiveState:
    """Return a line as a broker shows it; its devices are `north` with slave id 2 and `south` with 3."""
    state = LiveState("line0")
    devices = [
        {"name": name, "id": number, "interval": 1.0, "enabled": True} for name, number in (("north", 2), ("south", 3))
    ]
    for topic, payload in (("devices", devices), *messages):
        state.on_message(topic, payload, old=False, now=time.monotonic(), wall=NOW)
    return state


def sample(*, age: float = 0.0, error: str | None = None) -> dict[str, object]:
    good = error is None
    return {
        "seq": 5, "boot": "a", "ts": (NOW - age) * 1000, "wind_speed": 3.0 if good else None, "unit": "m/s",
        "quality": "good" if good else "bad", "error": error, "rtt_ms": 20.0,
    }  # fmt: skip


WELL = (
    ("device/north/availability", "online"), ("device/north/state", sample()),
    ("device/south/availability", "online"), ("device/south/state", sample()),
)  # fmt: skip


def test_sensors_that_answer_well_are_counted() -> None:
    (found,) = by_daemon(live(*WELL), NOW)
    assert (found.level, found.text) == ("ok", "2 of 2 answer well")


@pytest.mark.parametrize(
    ("messages", "level", "text", "advice"),
    [
        (
            [("device/south/availability", "offline"), ("device/south/state", sample(error="timeout") | {"seq": 6}),
             ("device/south/error", {"active": True, "code": "timeout", "since": NOW * 1000})],
            "fail", "south (slave id 3): offline: timeout, since", "is it powered and wired",
        ),
        (
            [("device/south/state", sample(error="duplicate_id") | {"seq": 6})],
            "warn", "south (slave id 3): online, but bad: duplicate_id", "unplug one",
        ),
        (
            [("line/error", {"active": True, "code": "wrong_rate", "message": "sensors answer at 19200"})],
            "fail", "wrong_rate: sensors answer at 19200", "set line.baudrate",
        ),
        ([("line/state", {"activity": "paused"})], "warn", "it is paused", "line/cancel"),
        ([("device/south/state", sample(error="starting") | {"seq": 6})], "warn", "not polled yet", "in a minute"),
    ],
)  # fmt: skip
def test_each_trouble_is_named_with_its_cure(
    messages: list[tuple[str, Any]], level: str, text: str, advice: str
) -> None:
    bad = [each for each in by_daemon(live(*WELL, *messages), NOW) if each.advice]
    assert [each.level for each in bad] == [level]
    assert text in bad[0].text
    assert advice in bad[0].advice


def test_an_old_value_and_no_sensors_are_named() -> None:
    bad = [each for each in by_daemon(live(*WELL), NOW + 60) if each.advice]
    assert [each.text for each in bad] == [f"{name}: its last good value is old" for name in ("north", "south")]
    (none,) = by_daemon(LiveState("line0"), NOW)
    assert (none.level, none.text) == ("warn", "none is configured")


def test_a_line_is_read_as_the_daemon_would_read_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "lfs10d.yaml"
    file.write_text(
        "line: {name: mast, port: /dev/line0, baudrate: 19200, echo: 'off', extra_gap: 5ms, low_latency: false,\n"
        "  rs485: {rts_on_send: true}}\n"
        "slaves: [3]\nmqtt: {host: localhost}\n"
    )
    loaded = load(file)
    opened: list[tuple[PortSettings, LineRules]] = []

    def refused(settings: PortSettings, rules: LineRules) -> NoReturn:
        opened.append((settings, rules))
        raise PortGoneError(settings.path, "it is gone")

    monkeypatch.setattr(sensors, "DirectLine", refused)
    (found,) = by_asking(loaded)
    assert found.level == "fail"
    assert opened == [(port_settings(loaded.config.line), line_rules(loaded.config.line))]
    assert opened[0][0].rs485 is not None
