"""docs/commands.md at its word: each request of the page, sent each way it tells, is answered as the page shows."""

from __future__ import annotations

import json
import subprocess
from typing import Any

import pytest

from docs.generate.commands import BAUDRATE, CONFIG, SLAVES, WALK, Step, recorded
from docs.generate.contract import check
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support import forked
from tests.support.brokers import Mosquitto
from tests.support.sites import QUICK, Site, View, eventually, good, tell

BASE = "lfs10d/line0"
SHORT = [number for number, step in enumerate(WALK) if not step.slow]
ANSWERED_WITHIN = 120.0
"""Seconds; an adoption takes about 20."""


def alike(shown: object, got: object) -> bool:
    """Whether two payloads have the same keys with values of the same kinds; null may stand for any."""
    if shown is None or got is None:
        return True
    if isinstance(shown, dict) and isinstance(got, dict):
        return shown.keys() == got.keys() and all(alike(shown[key], got[key]) for key in shown)
    if isinstance(shown, list) and isinstance(got, list):
        return len(shown) == len(got) and all(map(alike, shown, got))
    if isinstance(shown, bool) or isinstance(got, bool):
        return type(shown) is type(got)
    return isinstance(got, int | float if isinstance(shown, int | float) else type(shown))


def begun(site: Site, view: View) -> None:
    """Start the line and the daemon of the page."""
    served = site.line(SLAVES)
    tell(served, lambda line: line.add(Sensor(1, format=Format(9600), turnaround=0.003)))
    site.pace = QUICK
    site.write(line={"baudrate": BAUDRATE}, **CONFIG)
    site.run()
    for device in ("mast-top", "slave-3"):
        view.wait(f"device/{device}/state", good)


def hold(step: Step, number: int, response: dict[str, Any]) -> None:
    """Hold a response to the one that the page shows."""
    shown = recorded()[number]
    told = (response["request"], response["status"], (response["error"] or {}).get("code"))
    assert told == (shown["request"], shown["status"], (shown["error"] or {}).get("code")), step
    assert alike(shown, response), f"{shown} and {response}"


def answered(view: View, topic: str, before: int) -> tuple[dict[str, Any], bytes | None]:
    """Return the one response that came to a topic, and its Correlation Data."""
    where = f"{BASE}/{topic}"
    eventually(lambda: len(view.listener.on(where)) > before, f"a response on {topic}", within=ANSWERED_WITHIN)
    (heard,) = view.listener.on(where)[before:]
    check("response/device/read", heard.payload.decode())
    return json.loads(heard.payload), heard.correlation


def publish(mosquitto: Mosquitto, step: Step, content: dict[str, Any], *options: str) -> None:
    target = ["-h", "127.0.0.1", "-p", str(mosquitto.port), "-t", f"{BASE}/request/{step.name}"]
    subprocess.run(["mosquitto_pub", *target, "-m", json.dumps(content), *options], check=True, timeout=20)


def test_the_page_walks_through_every_request() -> None:
    assert {step.name for step in WALK} == set(HANDLERS)
    assert [response["request"] for response in recorded()] == [step.name for step in WALK]


@pytest.mark.needs("mosquitto_pub")
@pytest.mark.long(20)
def test_by_mqtt_5_every_request_is_answered_where_it_asks_to_be(site: Site, mosquitto: Mosquitto, view: View) -> None:
    begun(site, view)
    for number, step in enumerate(WALK):
        where = f"response/{number}"
        properties = ("response-topic", f"{BASE}/{where}"), ("correlation-data", f"c{number}")
        options = [word for pair in properties for word in ("-D", "publish", *pair)]
        publish(mosquitto, step, dict(step.parameters), "-V", "5", *options)
        response, correlation = answered(view, where, 0)
        assert (response["id"], correlation) == (None, f"c{number}".encode())
        hold(step, number, response)
    usual = [each.topic for each in view.heard if each.topic.startswith(f"{BASE}/response/") and each.topic[-1] > "9"]
    assert usual == [], "each is answered once, there alone"


@pytest.mark.needs("mosquitto_pub")
def test_by_3_1_1_every_request_is_answered_with_its_id(site: Site, mosquitto: Mosquitto, view: View) -> None:
    begun(site, view)
    for number in SHORT:
        step = WALK[number]
        before = len(view.listener.on(f"{BASE}/response/{step.name}"))
        publish(mosquitto, step, {"id": f"p{number}", **step.parameters}, "-V", "mqttv311", "-q", "1")
        response, correlation = answered(view, f"response/{step.name}", before)
        assert (response["id"], correlation) == (f"p{number}", None)
        hold(step, number, response)


def test_on_the_command_line_every_request_is_typed_as_the_page_shows(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    del mosquitto
    begun(site, view)
    for number in SHORT:
        step = WALK[number]
        done = forked.run(["request", *step.arguments, "--json", "-c", str(site.file)])
        response = json.loads(done.stdout)
        assert done.returncode == (0 if response["status"] == "ok" else 1)
        hold(step, number, response)
