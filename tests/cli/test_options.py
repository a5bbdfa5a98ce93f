"""How the characters on a line look, as options."""

from __future__ import annotations

from typing import Any

import click
import pytest

from lfs10d.cli.options import DurationType, baudrate, take
from lfs10d.modbus.port_settings import PortSettings


def options(**changes: object) -> dict[str, Any]:
    usual = {"port": "/dev/x", "parity": "none", "databits": None, "stopbits": "1", "framing": "rtu", "timeout": None}
    return {**usual, "other": 1, **changes}


def test_they_are_taken_out_of_a_commands_options() -> None:
    given = options()
    line = take(given)
    assert given == {"other": 1}
    assert line.settings(19200) == PortSettings("/dev/x", 19200)
    assert line.timing(9600).character == 10 / 9600


@pytest.mark.parametrize(
    ("changes", "character"),
    [
        ({}, "8N1"),
        ({"parity": "even"}, "8E1"),
        ({"stopbits": "2", "databits": "8"}, "8N2"),
        ({"framing": "ascii"}, "7N1"),
        ({"framing": "ascii", "databits": "8", "parity": "odd"}, "8O1"),
    ],
)
def test_characters_have_their_usual_short_word(changes: dict[str, str], character: str) -> None:
    assert take(options(**changes)).character == character


def test_rtu_needs_eight_data_bits() -> None:
    with pytest.raises(click.BadParameter, match="8 data bits"):
        take(options(databits="7"))


def test_a_rate_is_one_of_the_known_ones() -> None:
    option = click.Option(["--baudrate"])
    context = click.Context(click.Command("read"))
    assert baudrate(context, option, " 19200 ") == 19200
    for text in ("", "9601", "9600.0", "²"):
        with pytest.raises(click.BadParameter, match="is not one of 1200"):
            baudrate(context, option, text)


@pytest.mark.parametrize(("text", "duration"), [("250ms", 0.25), ("2m", 120.0), ("5", 5.0), ("0.5", 0.5), ("0", 0.0)])
def test_a_duration_is_a_number_of_seconds_or_has_a_unit(text: str, duration: float) -> None:
    assert DurationType("10s").convert(text, None, None) == duration


@pytest.mark.parametrize("text", ["", "-1", "1e3", "inf", ".5", "5 s", "soon", "²"])
def test_what_is_no_duration_is_refused(text: str) -> None:
    with pytest.raises(click.BadParameter, match="is not a duration; write 10s"):
        DurationType("10s").convert(text, None, None)
