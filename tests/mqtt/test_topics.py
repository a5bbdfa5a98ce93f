"""Topics are spelled once, and nothing but what is ours is taken for ours."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.mqtt.messages import Incoming
from lfs10d.mqtt.topics import LONGEST_TOPIC, OWNED_LEAVES, Topics

B = Topics.of("site/roof", "line0")


def test_b_is_base_topic_and_line_name() -> None:
    assert B.base == "site/roof/line0"
    assert B.availability == "site/roof/line0/availability"
    assert B.requests == "site/roof/line0/request/#"


def test_filters_of_what_may_be_left_over() -> None:
    assert B.retained_of_devices == (
        "site/roof/line0/device/+/state",
        "site/roof/line0/device/+/config",
        "site/roof/line0/device/+/availability",
        "site/roof/line0/device/+/error",
        "site/roof/line0/device/+/stats",
        "site/roof/line0/device/+/wind",
    )


@given(st.text().filter(lambda text: not text.startswith("/")))
def test_full_and_relative_are_inverse(relative: str) -> None:
    """No topic under `B` begins with a slash: after one stands a topic that is not under it (contract, section 7)."""
    assert B.relative(B.full(relative)) == relative


def test_what_is_elsewhere_is_named_in_full() -> None:
    assert B.full("/homeassistant/device/x/config") == "homeassistant/device/x/config"


@pytest.mark.parametrize("topic", ["site/roof/line00/x", "site/roof/line0", "other/line0/x", ""])
def test_a_topic_not_under_b_is_nobodys(topic: str) -> None:
    assert B.relative(topic) is None
    assert B.command(Incoming(topic, b"", retained=False)) is None


@pytest.mark.parametrize(
    ("relative", "levels"),
    [
        ("request/device/read", ("device", "read")),
        ("request/health", ("health",)),
        ("request", ()),
        ("request/", ("",)),
        ("request/a/b/c", ("a", "b", "c")),
        ("requests/health", None),
        ("response/health", None),
    ],
)
def test_levels_of_a_request(relative: str, levels: tuple[str, ...] | None) -> None:
    command = B.command(Incoming(B.full(relative), b"", retained=False))
    assert (None if command is None else command.levels) == levels


def test_a_response_has_the_levels_of_its_request() -> None:
    assert B.response("device", "read") == "response/device/read"


@pytest.mark.parametrize(
    ("asked", "relative"),
    [
        ("site/roof/line0/response/mine/7", "response/mine/7"),
        ("site/roof/line0/response/ß", "response/ß"),
        (None, None),
        ("site/roof/line0/state", None),
        ("site/roof/line0/response", None),
        ("elsewhere/response/x", None),
        ("site/roof/line0/response/+", None),
        ("site/roof/line0/response/#", None),
        ("site/roof/line0/response/\0", None),
        ("site/roof/line0/response/" + "x" * LONGEST_TOPIC, None),
    ],
)
def test_a_response_topic_counts_only_under_response_and_without_wildcards(
    asked: str | None, relative: str | None
) -> None:
    assert B.response_topic(asked) == relative


@pytest.mark.parametrize("leaf", OWNED_LEAVES)
def test_a_devices_retained_topics_are_owned(leaf: str) -> None:
    assert B.is_owned(f"device/mast-top/{leaf}")


@pytest.mark.parametrize("relative", ["device/a/telemetry", "device/a/b/state", "line/state", "device/state", ""])
def test_other_topics_are_not_owned(relative: str) -> None:
    assert not B.is_owned(relative)
