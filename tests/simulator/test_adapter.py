"""What an adapter hands over, and when."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.simulator.adapter import Adapter
from lfs10d.simulator.burst import MASTER, NOISE
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.wire import Format

SHAPE = Format(9600)


@given(data=st.binary(min_size=1, max_size=20), steps=st.lists(st.integers(0, 3_000_000), max_size=40))
def test_each_byte_is_readable_when_its_last_bit_has_arrived(data: bytes, steps: list[int]) -> None:
    line = SimulatedLine()
    adapter = Adapter(line, SHAPE)
    burst = line.speak(NOISE, data, 1000)
    now, heard = 0, b""
    for step in steps:
        now += step
        heard += adapter.collect(now)
        assert heard == data[: sum(end <= now for end in burst.ends)]
    if len(heard) < len(data):
        assert adapter.next_ready() == burst.ends[len(heard)]
    else:
        assert adapter.next_ready() is None


@pytest.mark.parametrize("latency", [1_000_000, 16_000_000])
def test_with_latency_bytes_come_in_pieces_at_its_multiples(latency: int) -> None:
    line = SimulatedLine()
    adapter = Adapter(line, SHAPE, latency=latency)
    data = bytes(range(20))
    burst = line.speak(NOISE, data, 5)
    heard = b""
    while (ready := adapter.next_ready()) is not None:
        assert ready % latency == 0
        heard += adapter.collect(ready)
        assert heard == data[: sum(end <= ready for end in burst.ends)]
    assert heard == data


def test_arrived_bytes_are_kept_until_the_adapter_delivers() -> None:
    line = SimulatedLine()
    adapter = Adapter(line, SHAPE, latency=16_000_000)
    line.speak(NOISE, b"abc", 0)
    assert adapter.collect(4_000_000) == b""
    assert adapter.next_ready() == 16_000_000
    assert adapter.collect(16_000_000) == b"abc"


def test_the_own_bytes_come_back_with_echo_only() -> None:
    for echo in (False, True):
        line = SimulatedLine()
        adapter = Adapter(line, SHAPE, echo=echo)
        line.speak(MASTER, b"mine", 0)
        assert adapter.collect(10**9) == (b"mine" if echo else b"")


@pytest.mark.parametrize("latency", [0, 500_000_000])
def test_bytes_of_two_speakers_come_in_the_order_of_the_wire(latency: int) -> None:
    line = SimulatedLine()
    adapter = Adapter(line, SHAPE, latency=latency)
    line.speak(NOISE, b"second", 100_000_000)
    line.speak(NOISE, b"first", 0)
    assert adapter.collect(10**9) == b"firstsecond"


def test_at_another_rate_bytes_are_counted_as_framing_errors() -> None:
    line = SimulatedLine()
    adapter = Adapter(line, Format(19200))
    line.speak(NOISE, b"\x01\x03", 0)
    assert adapter.collect(10**9) not in {b"", b"\x01\x03"}
    assert adapter.framing_errors == 2


def test_what_arrived_before_a_change_of_rate_was_heard_at_the_old_one() -> None:
    line = SimulatedLine()
    adapter = Adapter(line, SHAPE)
    line.speak(NOISE, b"abcd", 0)
    adapter.retune(Format(19200), 2_200_000)
    heard = adapter.collect(10**9)
    assert heard[:2] == b"ab"
    assert len(heard) == 4
    assert adapter.framing_errors == 2


def test_what_was_cut_off_does_not_come() -> None:
    line = SimulatedLine()
    adapter = Adapter(line, SHAPE)
    burst = line.speak(NOISE, b"abcd", 0)
    burst.cut(0)
    assert adapter.next_ready() is None
    assert adapter.collect(10**9) == b""
