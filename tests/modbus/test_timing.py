"""How long things take: the table of the serial-line specification, and its laws."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.timing import LineTiming

RATES = st.sampled_from([1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200])
PARITIES = st.sampled_from(["none", "even", "odd"])


@pytest.mark.parametrize(
    ("baudrate", "character", "t35", "exchange"),
    [
        (9600, 1041.7, 3645.8, 25.0),
        (19200, 520.8, 1822.9, 12.5),
        (115200, 86.8, 1750.0, 4.98),
    ],
)
def test_the_times_of_the_usual_rates(baudrate: int, character: float, t35: float, exchange: float) -> None:
    timing = LineTiming.of(baudrate)
    assert timing.baudrate == baudrate
    assert timing.character * 1e6 == pytest.approx(character, abs=0.05)
    assert timing.t35 * 1e6 == pytest.approx(t35, abs=0.05)
    assert timing.exchange(8, 9) * 1e3 == pytest.approx(exchange, abs=0.01)


@pytest.mark.parametrize(
    ("databits", "parity", "stopbits", "bits"),
    [(8, "none", 1, 10), (8, "even", 1, 11), (8, "odd", 1, 11), (8, "none", 2, 11), (7, "even", 1, 10)],
)
def test_a_character_has_start_data_parity_and_stop_bits(databits: int, parity: str, stopbits: int, bits: int) -> None:
    timing = LineTiming.of(9600, databits=databits, parity=parity, stopbits=stopbits)
    assert timing.character == bits / 9600


def test_above_19200_the_interval_is_fixed() -> None:
    timing = LineTiming.of(38400)
    assert timing.t35 == 1750e-6


def test_the_gap_is_the_silent_interval_and_what_was_asked_for() -> None:
    assert LineTiming.of(9600).gap == LineTiming.of(9600).t35
    assert LineTiming.of(9600, extra_gap=0.002).gap == pytest.approx(0.002 + 3.5 * 10 / 9600)


def test_a_turnaround_lengthens_the_exchange() -> None:
    assert LineTiming.of(9600).exchange(8, 9, 0.005) * 1e3 == pytest.approx(30.0, abs=0.01)


def test_at_a_change_of_rate_the_slower_gap_holds() -> None:
    slow, fast = LineTiming.of(9600), LineTiming.of(19200)
    assert slow.slower(fast) == fast.slower(slow) == slow.gap


@pytest.mark.parametrize(
    ("baudrate", "databits", "parity", "stopbits", "extra_gap"),
    [
        (0, 8, "none", 1, 0.0),
        (9600, 9, "none", 1, 0.0),
        (9600, 8, "mark", 1, 0.0),
        (9600, 8, "none", 3, 0.0),
        (9600, 8, "none", 1, -0.001),
        (9600, 8, "none", 1, float("nan")),
        (9600, 8, "none", 1, float("inf")),
    ],
)
def test_an_impossible_line_is_refused(
    baudrate: int, databits: int, parity: str, stopbits: int, extra_gap: float
) -> None:
    with pytest.raises(ValueError, match=r"a baud rate is|no such character|an extra gap is"):
        LineTiming.of(baudrate, databits=databits, parity=parity, stopbits=stopbits, extra_gap=extra_gap)


@given(RATES, PARITIES, st.sampled_from([1, 2]), st.integers(0, 513), st.integers(0, 513))
def test_times_add_up(baudrate: int, parity: str, stopbits: int, request: int, answer: int) -> None:
    timing = LineTiming.of(baudrate, parity=parity, stopbits=stopbits)
    assert timing.transmission(request) + timing.transmission(answer) == pytest.approx(
        timing.transmission(request + answer)
    )
    assert timing.exchange(request, answer) == pytest.approx(2 * timing.gap + timing.transmission(request + answer))
    assert timing.t35 >= 1750e-6


def test_the_slowest_line_there_is_has_one_bit_a_second() -> None:
    assert LineTiming.of(1).character == 10.0
