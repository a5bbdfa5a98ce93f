"""Raw termios by the settings."""

from __future__ import annotations

import termios
from itertools import product
from typing import Any

import pytest

from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.termios_attributes import (
    CC,
    CFLAG,
    CMSPAR,
    IFLAG,
    ISPEED,
    LFLAG,
    OFLAG,
    OSPEED,
    attributes,
    differences,
)
from lfs10d.schema.quantities import BAUDRATES


def cooked() -> list[Any]:
    """Return the attributes of a login terminal, with everything on that a line must not have."""
    characters: list[Any] = [bytes([number]) for number in range(32)]
    flags = termios.CS5 | termios.HUPCL | termios.CRTSCTS | termios.PARENB | CMSPAR
    return [
        termios.ICRNL | termios.IXON | termios.IXOFF | termios.ISTRIP | termios.IGNBRK | termios.BRKINT,
        termios.OPOST | termios.ONLCR,
        flags,
        termios.ICANON | termios.ECHO | termios.ISIG,
        termios.B38400,
        termios.B38400,
        characters,
    ]


@pytest.mark.parametrize(
    ("baudrate", "speed"),
    [
        (1200, termios.B1200),
        (2400, termios.B2400),
        (4800, termios.B4800),
        (9600, termios.B9600),
        (19200, termios.B19200),
        (38400, termios.B38400),
        (57600, termios.B57600),
        (115200, termios.B115200),
    ],
)
def test_both_directions_run_at_the_rate(baudrate: int, speed: int) -> None:
    wanted = attributes(PortSettings("tty", baudrate=baudrate), cooked())

    assert (wanted[ISPEED], wanted[OSPEED]) == (speed, speed)


@pytest.mark.parametrize(
    ("parity", "flags"),
    [("none", 0), ("even", termios.PARENB), ("odd", termios.PARENB | termios.PARODD)],
)
@pytest.mark.parametrize(("databits", "size"), [(7, termios.CS7), (8, termios.CS8)])
@pytest.mark.parametrize(("stopbits", "stop"), [(1, 0), (2, termios.CSTOPB)])
def test_the_character_is_as_set_and_no_other_control_flag_is(
    parity: str, flags: int, databits: int, size: int, stopbits: int, stop: int
) -> None:
    settings = PortSettings("tty", parity=parity, databits=databits, stopbits=stopbits)

    assert attributes(settings, cooked())[CFLAG] == (
        size | flags | stop | termios.CREAD | termios.CLOCAL
    )  # so neither HUPCL nor CRTSCTS


def test_the_line_discipline_changes_nothing() -> None:
    wanted = attributes(PortSettings("tty"), cooked())

    assert (wanted[IFLAG], wanted[OFLAG], wanted[LFLAG]) == (0, 0, 0)


def test_with_parity_a_broken_character_is_marked_by_the_line_discipline() -> None:
    wanted = attributes(PortSettings("tty", parity="even"), cooked())

    assert wanted[IFLAG] == termios.INPCK


def test_a_read_never_waits_and_the_other_control_characters_stay() -> None:
    before = cooked()

    characters = attributes(PortSettings("tty"), before)[CC]

    assert (characters[termios.VMIN], characters[termios.VTIME]) == (0, 0)
    others = set(range(32)) - {termios.VMIN, termios.VTIME}
    assert all(characters[place] == before[CC][place] for place in others)
    assert before == cooked()  # the caller's list is not touched


def test_what_was_taken_as_asked_shows_no_difference() -> None:
    for baudrate, parity, databits, stopbits in product(BAUDRATES, ("none", "even", "odd"), (7, 8), (1, 2)):
        settings = PortSettings("tty", baudrate=baudrate, parity=parity, databits=databits, stopbits=stopbits)

        assert differences(settings, attributes(settings, cooked())) == ()


def changed(settings: PortSettings, **fields: int) -> list[Any]:
    """Return the attributes of `settings` with fields replaced."""
    report = attributes(settings, cooked())
    for name, value in fields.items():
        report[{"cflag": CFLAG, "ispeed": ISPEED, "ospeed": OSPEED}[name]] = value
    return report


def test_another_rate_is_a_difference_even_on_a_pty() -> None:
    settings = PortSettings("tty", baudrate=115200)
    report = changed(settings, ispeed=termios.B9600, ospeed=termios.B9600)

    assert differences(settings, report, pty=True) == ("115200 baud (it says 9600)",)


def test_a_rate_of_one_direction_alone_is_a_difference() -> None:
    settings = PortSettings("tty", baudrate=19200)

    assert differences(settings, changed(settings, ispeed=termios.B0)) == (
        "19200 baud (it says another rate and 19200)",
    )


@pytest.mark.parametrize(
    ("settings", "flags", "said"),
    [
        (PortSettings("tty", databits=7, parity="even"), termios.CS8 | termios.PARENB, ("7 data bits",)),
        (PortSettings("tty", parity="even"), termios.CS8, ("parity even",)),
        (PortSettings("tty", parity="odd"), termios.CS8 | termios.PARENB, ("parity odd",)),
        (PortSettings("tty", parity="even"), termios.CS8 | termios.PARENB | CMSPAR, ("parity even",)),
        (PortSettings("tty"), termios.CS8 | termios.PARENB, ("parity none",)),
        (PortSettings("tty", stopbits=2), termios.CS8, ("2 stop bits",)),
        (PortSettings("tty"), termios.CS8 | termios.CSTOPB, ("1 stop bit",)),
        (PortSettings("tty"), termios.CS8 | termios.CRTSCTS, ("no flow control",)),
        (PortSettings("tty"), termios.CS7 | termios.CSTOPB, ("8 data bits", "1 stop bit")),
    ],
)
def test_each_part_of_the_character_is_compared(settings: PortSettings, flags: int, said: tuple[str, ...]) -> None:
    assert differences(settings, changed(settings, cflag=flags)) == said


def test_a_pty_is_not_blamed_for_characters_it_has_no_wire_for() -> None:
    settings = PortSettings("tty", databits=7, parity="even", stopbits=2)

    assert differences(settings, changed(settings, cflag=termios.CS8), pty=True) == ()


def test_a_parity_bit_that_means_nothing_is_no_difference() -> None:
    settings = PortSettings("tty")

    assert differences(settings, changed(settings, cflag=termios.CS8 | termios.PARODD)) == ()
