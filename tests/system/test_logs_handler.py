"""The handler writes each record with one write, to whatever reader."""

from __future__ import annotations

import logging
import os

from lfs10d.system.logs import (
    LIMIT,
    DescriptorHandler,
    LineFormatter,
    Style,
)
from tests.support.log_records import record


def handler_on(descriptor: int) -> DescriptorHandler:
    """Return a handler of bare lines."""
    handler = DescriptorHandler(descriptor)
    handler.setFormatter(LineFormatter(Style.BARE))
    return handler


def test_each_record_is_a_line(pipe: tuple[int, int]) -> None:
    handler = handler_on(pipe[1])

    handler.handle(record("one"))
    handler.handle(record("two\nlines", level=logging.INFO))

    assert os.read(pipe[0], 4096) == b"warning one\ninfo two\\nlines\n"
    assert handler.dropped == 0


def test_a_line_too_long_for_one_write_loses_its_middle(pipe: tuple[int, int]) -> None:
    handler_on(pipe[1]).handle(record("begin" + "x" * 10_000 + "end"))

    line = os.read(pipe[0], 20_000)

    assert len(line) <= LIMIT
    assert line.startswith(b"warning beginxxx")
    assert line.endswith(b"xxxend\n")


def test_a_reader_who_stops_costs_records_and_is_told_how_many(pipe: tuple[int, int]) -> None:
    handler = handler_on(pipe[1])
    for _ in range(100):
        handler.handle(record("x" * 4000))
    lost = handler.dropped
    assert lost > 0

    os.read(pipe[0], 1_000_000)
    handler.handle(record("again"))

    assert os.read(pipe[0], 4096).decode() == (
        f"warning {lost} log records were lost: standard error was not read\nwarning again\n"
    )
    assert handler.dropped == 0


def test_a_reader_who_is_gone_costs_records_and_nothing_else(pipe: tuple[int, int]) -> None:
    os.close(pipe[0])
    handler = handler_on(pipe[1])

    for _ in range(3):
        handler.handle(record())

    assert handler.dropped == 3


def test_a_closed_descriptor_costs_records_and_nothing_else(pipe: tuple[int, int]) -> None:
    os.close(pipe[1])
    handler = handler_on(pipe[1])

    handler.handle(record())

    assert handler.dropped == 1


def test_a_full_disk_costs_records_and_nothing_else() -> None:
    fd = os.open("/dev/full", os.O_WRONLY)
    handler = handler_on(fd)

    handler.handle(record())

    assert handler.dropped == 1
    os.close(fd)


def test_a_negative_descriptor_costs_records_and_nothing_else() -> None:
    handler = handler_on(-1)

    handler.handle(record())

    assert handler.dropped == 1
