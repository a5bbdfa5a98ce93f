"""An MQTT client that sends requests to a daemon and notes the responses."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import count
from typing import Any

from docs.generate.contract import check
from lfs10d.simulator.line import SimulatedLine
from tests.support.brokers import Heard, Listener, Mosquitto
from tests.support.sites import Run, Site, eventually

BASE = "lfs10d/line0"


@dataclass
class Operator:
    """Somebody who sends requests and hears every response."""

    listener: Listener
    run: Run

    def __post_init__(self) -> None:
        self._fences = count()

    def send(self, name: str, payload: object = None, **how: Any) -> None:  # noqa: ANN401 - as Listener.publish
        """Publish a request and wait until the broker has it; "." is the topic above all requests."""
        content = payload if isinstance(payload, bytes) else json.dumps({} if payload is None else payload)
        topic = f"{BASE}/request" if name == "." else f"{BASE}/request/{name}"
        self.listener.publish(topic, content, **how)

    @property
    def responses(self) -> list[Heard]:
        """Every response so far, each as the documentation promises."""
        found = [each for each in list(self.listener.heard) if each.topic.startswith(f"{BASE}/response/")]
        for each in found:
            levels = each.topic.removeprefix(f"{BASE}/").split("/")
            check("/".join(levels if len(levels) < 3 else ["response", "any", "topic"]), each.payload.decode())
            assert not each.retain
            assert each.qos == 1
        return found

    def settled(self) -> list[Heard]:
        """Return every response once the daemon has answered all that was sent before, without the question for it."""
        token = f"fence-{next(self._fences)}"
        self.send("health", {"id": token})
        eventually(lambda: any(id_of(each) == token for each in self.responses), "the answer to the last request")
        return [each for each in self.responses if not str(id_of(each)).startswith("fence-")]

    def ask(self, name: str, payload: object = None, **how: Any) -> dict[str, Any]:  # noqa: ANN401 - plain data of any shape
        """Send one request and return its one response."""
        before = len(self.responses)
        self.send(name, payload, **how)
        eventually(lambda: len(self.responses) > before, f"a response to {name}")
        (response,) = self.responses[before:]
        parsed: dict[str, Any] = json.loads(response.payload)
        return parsed


def id_of(heard: Heard) -> object:
    return json.loads(heard.payload)["id"]


def operator_of(site: Site, mosquitto: Mosquitto, **sections: Any) -> Operator:  # noqa: ANN401 - plain data of any shape
    """Start the daemon and return somebody who is subscribed before anything is answered."""
    listener = mosquitto.subscribe(f"{BASE}/#")
    site.write(**sections)
    run = site.run()
    listener.wait_for(f"{BASE}/availability")
    eventually(lambda: listener.on(f"{BASE}/availability")[-1].payload == b"online", "online")
    return Operator(listener, run)


def silence(line: SimulatedLine, slave: int) -> None:
    for sensor in line.sensors:
        if sensor.slave == slave:
            sensor.powered = False
