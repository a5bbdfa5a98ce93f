"""The plain view."""

from __future__ import annotations

import pytest

from lfs10d.cli.demo.broker import Broker
from lfs10d.cli.demo.line_view import HEAD_EVERY, Lines, LinesView
from tests.support.demo_states import Told

BROKER = Broker("mosquitto", "5", 18830)
NOW = "21:53:42"
NAMES = ["mast-top", "mast-mid", "mast-low", "roof-n", "roof-s", "crane", "bridge", "harbour"]


def test_it_opens_with_who_is_silent_who_is_noisy_and_how_to_look_on(told: Told) -> None:
    text = "\n".join(Lines(told.picture).opening(BROKER))
    assert "crane is silent" in text
    assert "bridge is noisy" in text
    assert "mosquitto_sub -h 127.0.0.1 -p 18830 -t 'lfs10d/#' -v" in text
    assert "Ctrl-C" in text


def test_a_line_has_the_time_and_a_speed_or_a_fault_for_each_sensor(told: Told) -> None:
    told.sample("mast-top", 7.5)
    told.sample("crane", None, "timeout")
    head, line = Lines(told.picture).turn(NOW)
    assert head.split() == ["m/s", *NAMES]
    assert line.split() == [NOW, "7.50", "-", "-", "-", "-", "timeout", "-", "-"]


def test_no_line_is_wider_than_a_terminal(told: Told) -> None:
    for name in NAMES:
        told.sample(name, 99.99)
    lines = Lines(told.picture)
    assert max(map(len, [*lines.opening(BROKER), *lines.turn(NOW)])) == 80


def test_a_change_of_state_is_a_line_of_its_own_and_told_once(told: Told) -> None:
    lines = Lines(told.picture)
    list(lines.turn(NOW))
    told.availability("crane", "offline")
    assert next(iter(lines.turn(NOW))) == f"{NOW} crane is offline"
    told.error("crane", "timeout", "no answer in 200 ms")
    assert next(iter(lines.turn(NOW))) == f"{NOW} crane is offline: timeout: no answer in 200 ms"
    assert not any("crane" in line for line in lines.turn(NOW))


def test_the_head_comes_again_after_a_page(told: Told) -> None:
    lines = Lines(told.picture)
    turns = [list(lines.turn(NOW)) for _ in range(HEAD_EVERY + 1)]
    assert [len(turn) for turn in turns] == [2, *[1] * (HEAD_EVERY - 1), 2]


def test_the_view_prints_the_opening_then_the_turns(told: Told, capsys: pytest.CaptureFixture[str]) -> None:
    told.sample("mast-top", 7.5)
    with LinesView(told.picture, BROKER) as view:
        view.turn()
    printed = capsys.readouterr().out
    assert printed.startswith("lfs10d demo: ")
    assert "7.50" in printed.splitlines()[-1]
    assert "\x1b" not in printed
