"""Samples as they come on the two topics."""

from __future__ import annotations

from soak.heard import Message, samples_of


def test_samples_are_read_from_both_topics() -> None:
    sample = b'{"device":"slave-1","boot":"k","seq":1,"ts":2,"wind_speed":3.5,"error":null,"quality":"good"}'
    (live,) = samples_of(Message(0.0, "device/slave-1/telemetry", sample))
    (past,) = samples_of(Message(0.0, "device/slave-1/history", b"[" + sample + b"]"))
    assert (live.seq, live.value, live.historical, past.historical) == (1, 3.5, False, True)
    assert not samples_of(Message(0.0, "device/slave-1/state", sample))
