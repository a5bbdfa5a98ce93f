"""The simulated line on a pseudo terminal, in real time. Nothing is asserted about how fast it is."""

from __future__ import annotations

import os
import select
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lfs10d.errors import FailedError
from lfs10d.simulator.burst import Burst
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import SECOND, seal, unseal
from tests.support.faulty_sensors import add_fault

PATIENCE = 5.0
T35 = 0.0037
"""The silence (s) before a request, or the judge lets nobody hear it."""
REQUEST = seal(bytes.fromhex("010300050001"))
ANSWER = seal(bytes.fromhex("0103020001"))


@contextmanager
def opened(path: str, rate: int = termios.B9600) -> Iterator[int]:
    """Open a terminal as a master does."""
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(descriptor)
        attributes = termios.tcgetattr(descriptor)
        attributes[4] = attributes[5] = rate
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
        time.sleep(T35)
        yield descriptor
    finally:
        os.close(descriptor)


def read(descriptor: int, count: int, patience: float = PATIENCE) -> bytes:
    data = b""
    end = time.monotonic() + patience
    while len(data) < count and (left := end - time.monotonic()) > 0:
        if select.select([descriptor], [], [], left)[0]:
            data += os.read(descriptor, count)
    return data


def until(holds: Callable[[], bool]) -> bool:
    """Wait until it holds; say whether it did within patience."""
    end = time.monotonic() + PATIENCE
    while not holds() and time.monotonic() < end:
        time.sleep(0.005)
    return holds()


@pytest.fixture
def line() -> SimulatedLine:
    return SimulatedLine([Sensor(1)])


def test_a_master_on_the_terminal_is_answered(line: SimulatedLine) -> None:
    with PtyLine(line) as port, opened(port.path) as descriptor:
        os.write(descriptor, REQUEST)
        assert read(descriptor, 7) == ANSWER
    assert line.judge.counts["heard"] == 1


def test_an_answer_takes_as_long_as_on_a_wire(line: SimulatedLine) -> None:
    with PtyLine(line) as port, opened(port.path) as descriptor:
        begun = time.monotonic()
        os.write(descriptor, REQUEST)
        read(descriptor, 7)
        assert time.monotonic() - begun >= 15 / 960 + 0.005


def test_a_master_that_returns_is_answered_again(line: SimulatedLine) -> None:
    with PtyLine(line) as port:
        for count in (1, 2, 3):
            with opened(port.path) as descriptor:
                os.write(descriptor, REQUEST)
                assert read(descriptor, 7) == ANSWER
            assert until(lambda: not port.present)
            assert port.openings == count


def test_what_comes_while_nobody_listens_is_lost(line: SimulatedLine) -> None:
    add_fault(line.sensor(1), "late", delay=0.2)
    with PtyLine(line) as port:
        with opened(port.path) as descriptor:
            os.write(descriptor, REQUEST)
            assert until(lambda: line.judge.counts["heard"] == 1)
        assert until(lambda: not port.present and line.now > line.log[0].answers[0].burst.ends[-1])
        with opened(port.path) as descriptor:
            assert read(descriptor, 1, patience=0.05) == b""


def test_a_master_at_another_rate_is_noise(line: SimulatedLine) -> None:
    with PtyLine(line) as port, opened(port.path, termios.B19200) as descriptor:
        os.write(descriptor, REQUEST)
        assert read(descriptor, 1, patience=0.1) == b""
        assert until(lambda: line.judge.counts["heard"] == 1)
    assert line.answered == 0


def test_a_change_of_the_rate_is_followed(line: SimulatedLine) -> None:
    rate = seal(bytes.fromhex("010600040002"))
    with PtyLine(line) as port, opened(port.path) as descriptor:
        os.write(descriptor, rate)
        assert read(descriptor, 8) == rate
        time.sleep(T35)
        attributes = termios.tcgetattr(descriptor)
        attributes[4] = attributes[5] = termios.B19200
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
        os.write(descriptor, REQUEST)
        assert read(descriptor, 7) == ANSWER


def test_echo_and_latency_are_the_adapter_s(line: SimulatedLine) -> None:
    with PtyLine(line, echo=True, latency=0.016) as port, opened(port.path) as descriptor:
        os.write(descriptor, REQUEST)
        assert read(descriptor, 15) == REQUEST + ANSWER


def test_the_link_leads_to_the_terminal_and_goes_with_it(line: SimulatedLine, tmp_path: Path) -> None:
    link = tmp_path / "line0"
    link.symlink_to("/nowhere")
    with PtyLine(line, link=link) as port:
        assert port.path == str(link)
        assert str(link.readlink()) == port.terminal
    assert not link.is_symlink()


def test_a_link_that_leads_elsewhere_by_now_is_left_alone(line: SimulatedLine, tmp_path: Path) -> None:
    link = tmp_path / "line0"
    with PtyLine(line, link=link):
        link.unlink()
        link.symlink_to("/elsewhere")
    assert str(link.readlink()) == "/elsewhere"


def test_a_file_is_not_replaced_by_the_link(line: SimulatedLine, tmp_path: Path) -> None:
    link = tmp_path / "line0"
    link.write_text("precious", "utf-8")
    with pytest.raises(FailedError, match="something else has this name"):
        PtyLine(line, link=link).start()
    assert link.read_text("utf-8") == "precious"


def test_without_terminals_it_says_so(line: SimulatedLine, monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> tuple[int, int]:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "openpty", none)
    with pytest.raises(FailedError, match="no pseudo terminal to be had: No space"):
        PtyLine(line).start()


def test_stopped_and_started_again_it_is_an_adapter_unplugged_and_plugged_in(
    line: SimulatedLine, tmp_path: Path
) -> None:
    port = PtyLine(line, link=tmp_path / "line0")
    assert port.now() == 0
    port.start()
    with opened(port.path) as descriptor:
        os.write(descriptor, REQUEST)
        assert read(descriptor, 7) == ANSWER
        before = port.now()
        port.stop()
        port.stop()
        with pytest.raises(OSError, match="Input/output error"):
            os.write(descriptor, REQUEST)
    port.tell(lambda line: line.power_up())
    with port, opened(port.path) as descriptor:
        os.write(descriptor, REQUEST)
        assert read(descriptor, 7) == ANSWER
        assert port.now() > before


def test_what_it_is_told_happens_in_its_own_thread(line: SimulatedLine) -> None:
    told: list[str] = []
    with PtyLine(line, realtime=True) as port:
        port.tell(lambda _: told.append(threading.current_thread().name))
        assert until(lambda: told == ["simulated-line"])


def test_bytes_that_nobody_reads_are_counted_as_lost() -> None:
    line = SimulatedLine()
    with PtyLine(line) as port, opened(port.path):

        def flood(line: SimulatedLine) -> None:
            began = -(1 + len(floods)) * 3600 * SECOND
            floods.append([line.speak("noise", bytes(250), began + n * SECOND) for n in range(100)])

        floods: list[list[Burst]] = []
        for count in (1, 2):
            before = port.lost_bytes
            port.tell(flood)
            assert until(lambda before=before: port.lost_bytes > before)  # type: ignore[misc]  # bound now, not later
            assert len(floods) == count


def test_the_figures_are_those_of_the_judge_and_the_terminal(line: SimulatedLine) -> None:
    with PtyLine(line) as port, opened(port.path) as descriptor:
        os.write(descriptor, REQUEST)
        assert unseal(read(descriptor, 7)) is not None
        figures = port.summary()
    assert figures["heard"] == figures["answers"] == figures["openings"] == 1
    assert figures["lost_bytes"] == 0
    assert 0 < figures["seconds"] < PATIENCE
