"""What the demo says below the table and at its end."""

from __future__ import annotations

import json

from lfs10d.cli.demo.broker import Broker
from lfs10d.cli.demo.page import Page
from lfs10d.cli.demo.texts import remarks, summary
from lfs10d.cli.render.live_state import LiveState

PAGE = Page("http://127.0.0.1:65535/", "0123456789abcdef")


def test_the_remarks_name_the_faulty_sensors_and_how_to_subscribe() -> None:
    text = "\n".join(remarks(Broker("mosquitto", "5", 18830), PAGE))
    assert "mosquitto (MQTT 5, 127.0.0.1:18830)" in text
    assert "newer MQTT" not in text
    assert "crane is silent" in text
    assert "bridge is noisy" in text
    assert "mosquitto_sub -h 127.0.0.1 -p 18830 -t 'lfs10d/#' -v" in text
    assert "http://127.0.0.1:65535/ (token for its controls: 0123456789abcdef)" in text
    assert "Ctrl-C" in text


def test_without_its_extra_the_page_is_named_with_what_to_do() -> None:
    assert "install lfs10d[web], as docs/web.md shows" in "\n".join(remarks(Broker("mosquitto", "5", 1), None))


def test_a_broker_of_mqtt_3_1_1_is_named_with_what_shows_mqtt_5() -> None:
    text = "\n".join(remarks(Broker("amqtt", "3.1.1", 18830), PAGE))
    assert "amqtt (MQTT 3.1.1, 127.0.0.1:18830)" in text
    assert "amqtt supports no newer MQTT; with mosquitto installed this is MQTT 5." in text


def test_no_remark_is_wider_than_a_terminal() -> None:
    assert max(map(len, remarks(Broker("mosquitto", "3.1.1", 65535), PAGE))) <= 80


def test_the_summary_counts_samples_and_sensors() -> None:
    live = LiveState("line0")
    live.on_message("devices", [{"name": "a", "id": 2}, {"name": "b", "id": 3}], old=False, now=0.0, wall=0.0)
    for topic, payload in (
        ("device/a/availability", "online"),
        ("device/a/telemetry", json.loads('{"seq": 7, "boot": "b", "ts": 1, "wind_speed": 1.5, "quality": "good"}')),
    ):
        live.on_message(topic, payload, old=False, now=0.0, wall=0.0)
    assert summary(live, 4.2) == "lfs10d demo: 7 samples in 4 s, 1 of 2 sensors online; nothing is left running"
