"""A verb's loop: a signal ends it in order, whenever it comes."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Iterator
from types import FrameType
from typing import NoReturn

import pytest

from lfs10d.cli import event_loop
from lfs10d.daemon.signals import ENDING


def before_and_after(signum: int, frame: FrameType | None) -> NoReturn:
    del frame
    raise InterruptedError(signum)


@pytest.fixture(autouse=True)
def _the_signals_as_they_were() -> Iterator[None]:
    before = {number: signal.signal(number, before_and_after) for number in ENDING}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


async def three() -> int:
    await asyncio.sleep(0)
    return 3


async def failing() -> None:
    raise ValueError("no")


def test_what_comes_to_its_end_is_returned_and_raised() -> None:
    assert event_loop.run(three()) == 3
    with pytest.raises(ValueError, match="no"):
        event_loop.run(failing())
    assert {signal.getsignal(number) for number in ENDING} == {before_and_after}


@pytest.mark.parametrize("number", ENDING)
def test_a_signal_cancels_it_once_and_it_ends_as_it_wants(number: signal.Signals) -> None:
    ends = []

    async def waiting() -> None:
        try:
            os.kill(os.getpid(), number)
            await asyncio.sleep(3600)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)
            await asyncio.sleep(0.02)
            ends.append("left")

    with pytest.raises(KeyboardInterrupt):
        event_loop.run(waiting())
    assert ends == ["left"]
    assert {signal.getsignal(each) for each in ENDING} == {signal.SIG_IGN}
