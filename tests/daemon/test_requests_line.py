"""Requests that need the line: a poll now, a trace."""

from __future__ import annotations

import json
from collections.abc import Callable

from docs.generate.contract import check
from tests.support.brokers import Listener, Mosquitto
from tests.support.operators import BASE, Operator, operator_of, silence
from tests.support.sites import Site, View, eventually, good, tell


def test_device_read_polls_now_and_its_sample_is_on_telemetry_too(site: Site, mosquitto: Mosquitto, view: View) -> None:
    served = site.line((1, 2, 3))
    tell(served, lambda line: silence(line, 2))
    slaves = [1, 2, {"id": 3, "enabled": False}]
    operator = operator_of(site, mosquitto, slaves=slaves, poll={"interval": "1h", "retries": 0})
    response = operator.ask("device/read", {"id": "r", "device": "slave-1"})
    (sample,) = view.wait_samples("slave-1", 1, lambda one: one["seq"] == response["data"]["seq"])
    assert (response["status"], response["data"]) == ("ok", sample)
    assert good(sample)

    silent = operator.ask("device/read", {"device": "slave-2"})
    assert (silent["status"], silent["error"]["code"]) == ("failed", "timeout")
    assert (silent["data"]["quality"], silent["data"]["error"]) == ("bad", "timeout")

    disabled = operator.ask("device/read", {"device": "slave-3"})
    assert (disabled["status"], disabled["data"]["quality"]) == ("ok", "good")
    assert view.newest("device/slave-3/state")["wind_speed"] is None

    served.stop()
    view.wait("line/error", lambda error: error["active"])
    lost = operator.ask("device/read", {"device": "slave-1"})
    assert (lost["status"], lost["error"]["code"], lost["data"]["error"]) == ("failed", "line_error", "port_lost")


def test_a_trace_tells_frames_until_it_ends_by_itself_or_is_cancelled(operator: Operator) -> None:
    topic = f"{BASE}/trace"
    assert operator.ask("line/trace", {"for": "400ms"})["data"] == {"for": 0.4}
    operator.listener.wait_for(topic, 4)
    eventually(_stands_still(operator.listener, topic), "the trace ends by itself")
    for each in operator.listener.on(topic):
        check("trace", each.payload.decode())
    texts = [json.loads(each.payload)["text"] for each in operator.listener.on(topic)]
    assert "slave-1: read 2 registers at 0x0001 of slave 1" in texts

    operator.ask("line/trace", {"for": "10m"})
    operator.listener.wait_for(topic, len(texts) + 2)
    assert operator.ask("line/cancel")["data"] == {"cancelled": ["trace"]}
    eventually(_stands_still(operator.listener, topic), "the trace is cancelled")
    assert operator.ask("line/cancel")["data"] == {"cancelled": []}


def _stands_still(listener: Listener, topic: str) -> Callable[[], bool]:
    """Return the claim that telemetry went on twenty times since a topic was heard last."""

    def still() -> bool:
        heard = [each.topic for each in list(listener.heard) if each.topic == topic or each.topic.endswith("telemetry")]
        return topic not in heard[-20:]

    return still
