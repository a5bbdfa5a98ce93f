"""A recognition and the sensors it looks at."""

from __future__ import annotations

import struct

import pytest

from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import Outcome
from lfs10d.profiles.library import parse_profile
from lfs10d.reconfiguration.journal import Endpoint
from tests.support.sensors import Pretence

HERE, SILENT = Endpoint(slave=3, baudrate=9600), Endpoint(slave=9, baudrate=9600)
VANE = parse_profile(
    """
name: vane
title: A vane
values:
  - {name: direction, register: 1, type: uint16, unit: "1", range: [0, 360], device_class: wind_direction}
  - {name: bare, register: 2, type: uint16, unit: "1"}
slave_id: {register: 5}
""",
    "vane.yaml",
)


def words(number: float) -> tuple[int, int]:
    """Return the two registers of a float32."""
    high, low = struct.unpack(">HH", struct.pack(">f", number))
    return high, low


# -- one alone


def spoil(pretence: Pretence, monkeypatch: pytest.MonkeyPatch, outcomes: dict[int, Outcome]) -> None:
    """Let the questions of these numbers end so, the others as the line has it."""
    plain = type(pretence).outcome

    def outcome(ask: Ask) -> Outcome:
        number = len(pretence.asked)
        if number not in outcomes:
            return plain(pretence, ask)
        pretence.asked.append(ask)
        return pretence.settle(ask, outcomes[number])

    monkeypatch.setattr(pretence, "outcome", outcome)
