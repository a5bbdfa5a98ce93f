"""A real pseudo terminal: the test holds the far end, the code under test opens the near end by its path."""

from __future__ import annotations

import os
import tty
from collections.abc import Iterator

import pytest

from lfs10d.modbus.port import SerialPort
from lfs10d.modbus.port_settings import PortSettings
from tests.support.far_end import FarEnd
from tests.support.pending_lines import Line


@pytest.fixture
def far_end() -> Iterator[FarEnd]:
    """Give a pty in raw mode whose slave nobody has open."""
    master, slave = os.openpty()
    tty.setraw(slave)
    end = FarEnd(master, os.ttyname(slave))
    os.close(slave)
    yield end
    end.close()


@pytest.fixture
def port(far_end: FarEnd) -> Iterator[SerialPort]:
    """Give an open port."""
    opened = SerialPort(PortSettings(far_end.path))
    opened.open()
    yield opened
    opened.close()


@pytest.fixture
def line() -> Line:
    return Line()
