"""What was announced before is found among what the broker retains."""

from __future__ import annotations

import json

import pytest

from lfs10d.telemetry.homeassistant.search import LARGEST, LONGEST, QUIET, DiscoverySearch

LINE = "homeassistant/device/lfs10d_lfs10d_a/config"
MAST = "homeassistant/device/lfs10d_lfs10d_a_mast/config"


def payload(base: str = "lfs10d/a", **components: object) -> bytes:
    return json.dumps({"availability": [{"topic": f"{base}/availability"}], "components": components}).encode()


def search(*, wide: bool = True) -> DiscoverySearch:
    return DiscoverySearch("homeassistant", "lfs10d/a", 100.0, wide)


def test_all_devices_are_asked_for_or_the_line_alone() -> None:
    assert search().filter == "homeassistant/device/+/config"
    assert search(wide=False).filter == LINE


def test_our_own_are_found_with_their_components() -> None:
    looking = search()
    assert looking.on_message(LINE, payload(load={"platform": "sensor"}), 100.1)
    assert looking.on_message(MAST, payload(), 100.2)
    assert looking.found == {LINE: {"load": "sensor"}, MAST: {}}


@pytest.mark.parametrize(
    ("topic", "content"),
    [
        ("homeassistant/device/0x00124b/config", payload()),
        ("homeassistant/device/lfs10d_lfs10d_a_b/config", payload("lfs10d/a_b")),  # another line
        (MAST, b"not json"),
        (MAST, b"[]"),
        (MAST, b""),
        (MAST, payload() + b" " * LARGEST),
        (MAST, b"[" * 5000),
    ],
)
def test_what_is_not_ours_is_left_alone(topic: str, content: bytes) -> None:
    looking = search()
    assert looking.on_message(topic, content, 100.1)
    assert looking.found == {}


def test_what_is_no_devices_payload_is_left_to_others() -> None:
    looking = search()
    assert not looking.on_message("lfs10d/a/device/mast/config", b"{}", 105.0)
    assert not looking.on_message("homeassistant/sensor/x/config", b"{}", 105.0)
    assert looking.due == 100.0 + QUIET


def test_it_is_over_when_nothing_more_comes_or_the_broker_refuses() -> None:
    looking = search()
    assert looking.due == 100.0 + QUIET
    looking.on_message(MAST, payload(), 101.0)
    assert looking.due == 101.0 + QUIET
    looking.on_message(MAST, payload(), 500.0)
    assert looking.due == 100.0 + LONGEST
    looking.is_refused = True
    assert looking.due == 100.0
