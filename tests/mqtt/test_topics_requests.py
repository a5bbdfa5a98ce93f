"""A request is taken as it came, and shows neither payload nor correlation when it is printed."""

from __future__ import annotations

from lfs10d.mqtt.messages import Incoming
from lfs10d.mqtt.topics import InboundRequest, Topics

B = Topics("b/line0")


def test_everything_about_a_request_is_kept() -> None:
    message = Incoming(
        "b/line0/request/device/read", b"{}", retained=True, response_topic="b/line0/response/x", correlation=b"\0"
    )
    assert B.command(message) == InboundRequest(
        "request/device/read", ("device", "read"), b"{}", retained=True, response_topic="response/x", correlation=b"\0"
    )


def test_a_foreign_response_topic_is_ignored() -> None:
    request = B.command(Incoming("b/line0/request/health", b"", retained=False, response_topic="c/d"))
    assert request is not None
    assert request.response_topic is None


def test_other_messages_are_no_requests() -> None:
    assert B.command(Incoming("b/line0/availability", b"offline", retained=True)) is None
    assert B.command(Incoming("c/request/health", b"", retained=False)) is None


def test_a_payload_is_not_printed() -> None:
    request = InboundRequest("request/x", ("x",), b"hostile\x1b[2J", retained=False, correlation=b"hostile")
    assert "hostile" not in repr(request)
