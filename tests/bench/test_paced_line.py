"""The bench's line hears what a strict line hears, and nothing else."""

from __future__ import annotations

import struct
import termios
import time
from collections.abc import Callable
from typing import Any

import pytest

from bench.line import PacedLine, read_log
from tests.support.plain_wire import crc16
from tests.support.terminals import CHARACTER, ID, T35, Terminal, request

Starter = Callable[..., PacedLine]

pytestmark = pytest.mark.needs("gcc")


def test_a_request_after_due_silence_is_heard_and_answered(paced: Starter) -> None:
    line = paced()
    with Terminal(line) as terminal:
        answers = [terminal.ask(request(slave)) for slave in (1, 2, 3)]
    counts = line.close()
    assert [answer[0] for answer in answers] == [1, 2, 3]
    assert all(crc16(answer[:-2]) == answer[-2:] for answer in answers)
    assert (counts["requests"], counts["heard"], counts["answered"], counts["too_early"]) == (3, 3, 3, 0)


TRIES = 10
"""A busy machine may bring bytes to the line, or the line to the processor, later than the test has them sent."""


def played(paced: Starter, send: Callable[[Terminal], None], shown: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Return the line's counts after `send`, which is played again while what it is about did not come to be."""
    counts: dict[str, Any] = {}
    for _ in range(TRIES):
        line = paced()
        with Terminal(line) as terminal:
            send(terminal)
            time.sleep(20 * CHARACTER)
        counts = line.close()
        if shown(counts):
            break
    return counts


def test_a_request_begun_before_t35_is_not_heard(paced: Starter) -> None:
    def send(terminal: Terminal) -> None:
        terminal.ask(request(1))
        terminal.send(request(2))

    counts = played(paced, send, lambda counts: counts["gap_us"]["min"] < T35 * 1e6)
    assert (counts["requests"], counts["heard"], counts["too_early"]) == (2, 1, 1)
    assert counts["gap_us"]["min"] < T35 * 1e6


def test_a_request_into_an_answer_destroys_both(paced: Starter) -> None:
    line = paced()
    with Terminal(line) as terminal:
        terminal.rest()
        terminal.send(request(1))
        terminal.hear(2)
        terminal.send(request(2))
        time.sleep(30 * CHARACTER)
    counts = line.close()
    assert (counts["heard"], counts["answered"], counts["garbled"], counts["too_early"]) == (1, 0, 1, 1)


def test_a_request_with_a_pause_inside_is_not_heard(paced: Starter) -> None:
    def send(terminal: Terminal) -> None:
        terminal.rest()
        terminal.send(request(1)[:4])
        time.sleep(4 * CHARACTER + 2.5 * CHARACTER)
        terminal.send(request(1)[4:])

    counts = played(paced, send, lambda counts: bool(counts["pauses"] + counts["bad_frames"]))
    assert counts["heard"] == 0
    assert counts["pauses"] + counts["bad_frames"] > 0


def test_a_request_with_a_long_pause_inside_is_never_heard(paced: Starter) -> None:
    """Nothing is played again: no machine is late by so much."""
    line = paced()
    with Terminal(line) as terminal:
        terminal.rest()
        terminal.send(request(1)[:4])
        time.sleep(0.3)
        terminal.send(request(1)[4:])
        time.sleep(0.3)
    counts = line.close()
    assert counts["heard"] == 0
    assert counts["pauses"] + counts["bad_frames"] > 0


def test_a_request_at_another_rate_is_not_heard(paced: Starter) -> None:
    line = paced()
    with Terminal(line, termios.B9600) as terminal:
        terminal.rest()
        terminal.send(request(1))
        time.sleep(0.3)
    counts = line.close()
    assert (counts["heard"], counts["wrong_rate"]) == (0, 1)


def test_a_request_with_a_wrong_check_is_not_heard(paced: Starter) -> None:
    line = paced()
    with Terminal(line) as terminal:
        terminal.rest()
        terminal.send(request(1)[:-1] + b"\x00")
        time.sleep(20 * CHARACTER)
    counts = line.close()
    assert (counts["heard"], counts["bad_frames"]) == (0, 1)


def test_dead_and_absent_sensors_are_silent(paced: Starter) -> None:
    line = paced("--dead", "2")
    with Terminal(line) as terminal:
        for slave in (2, 4):
            terminal.rest()
            terminal.send(request(slave))
            time.sleep(15 * CHARACTER)
        assert terminal.ask(request(1))[0] == 1
    counts = line.close()
    assert (counts["heard"], counts["unanswered"], counts["answered"]) == (3, 2, 1)


def test_a_sensor_that_dies_later_answers_before(paced: Starter) -> None:
    line = paced("--dead", "2", "--die-after", "3600")
    with Terminal(line) as terminal:
        assert terminal.ask(request(2))[0] == 2


def test_the_log_holds_each_value_as_it_was_sent_and_none_twice(paced: Starter) -> None:
    line = paced()
    with Terminal(line) as terminal:
        answers = [terminal.ask(request(slave)) for slave in (1, 2, 1)]
    line.close()
    values = [struct.unpack(">f", answer[3:7])[0] for answer in answers]
    log = read_log(line.log)
    assert [(each.slave, each.value, each.kind) for each in log] == [
        (slave, value, "ok") for slave, value in zip((1, 2, 1), values, strict=True)
    ]
    assert len(set(values)) == len(values)
    assert all(each.requested + 8 * CHARACTER + T35 < each.ended for each in log)


def test_the_barrier_reads_the_slave_id(paced: Starter) -> None:
    with Terminal(paced()) as terminal:
        assert terminal.ask(request(3, ID), 7)[:5] == bytes((3, 3, 2, 0, 3))


def test_a_write_is_refused(paced: Starter) -> None:
    with Terminal(paced()) as terminal:
        assert terminal.ask(request(1, bytes((6, 0, 3, 0, 1))), 5)[:3] == bytes((1, 0x86, 2))


def test_noise_spoils_every_answer_and_the_log_says_how(paced: Starter) -> None:
    line = paced("--noise", "100")
    with Terminal(line) as terminal:
        for _ in range(6):
            terminal.rest()
            terminal.send(request(1))
            time.sleep(30 * CHARACTER)
    counts = line.close()
    kinds = [each.kind for each in read_log(line.log)]
    assert counts["answered"] == 0
    assert counts["crc"] + counts["truncated"] + counts["garbage"] == counts["heard"] == len(kinds)
    assert set(kinds) <= {"crc", "truncated", "garbage"}


def test_a_late_answer_comes_before_the_answer_to_a_later_request(paced: Starter) -> None:
    line = paced("--late", "100", "--late-by", "400")
    with Terminal(line) as terminal:
        terminal.rest()
        terminal.send(request(1))
        time.sleep(15 * CHARACTER)
        terminal.send(request(1, ID))
        heard = b"".join(terminal.hear(16))
    assert (heard[2], heard[9 + 2]) == (4, 2)
    line.close()
    assert [each.kind for each in read_log(line.log)] == ["stale"]


def test_a_late_answer_that_is_waited_for_is_no_stale_one(paced: Starter) -> None:
    line = paced("--late", "100", "--late-by", "400")
    with Terminal(line) as terminal:
        assert terminal.ask(request(1))[:3] == bytes((1, 3, 4))
    line.close()
    assert [each.kind for each in read_log(line.log)] == ["late"]


def test_an_echo_comes_before_the_answer(paced: Starter) -> None:
    with Terminal(paced("--echo")) as terminal:
        heard = terminal.ask(request(1), 17)
    assert heard[:8] == request(1)
    assert heard[8:11] == bytes((1, 3, 4))


def test_an_adapter_delivers_in_pieces(paced: Starter) -> None:
    line = paced("--adapter", "50")
    with Terminal(line) as terminal:
        terminal.rest()
        terminal.send(request(1))
        pieces = terminal.hear(9)
    assert len(pieces) < 9
    assert crc16(b"".join(pieces)[:-2]) == b"".join(pieces)[-2:]


def test_a_window_counts_from_the_last_one(paced: Starter) -> None:
    line = paced()
    with Terminal(line) as terminal:
        terminal.ask(request(1))
        terminal.rest()
        first = line.window()
        terminal.ask(request(2))
        terminal.rest()
        second = line.window()
    assert (first["answered"], second["answered"]) == (1, 1)
