"""One line per record, whatever is in it and wherever it goes."""

from __future__ import annotations

import logging
import os
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.system.logs import (
    LineFormatter,
    Style,
    escape,
    is_journal,
    likes_colour,
    shortened,
    style_of,
)
from tests.support.log_records import raised, record


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("Mast, 10 m \u2013 Nord\u00f6st \U0001f32c", "Mast, 10 m \u2013 Nord\u00f6st \U0001f32c"),
        ("a\nb\r\tc", "a\\nb\\r\\tc"),
        ("\x1b[2J\x07\x7f\x9b", "\\x1b[2J\\x07\\x7f\\x9b"),
        ("a\u2028b\u202ec", "a\\u2028b\\u202ec"),
        ("\udc80\U000e0041", "\\udc80\\U000e0041"),
        ("C:\\new", "C:\\new"),
        ("", ""),
    ],
)
def test_what_could_fool_a_reader_is_spelled_out(text: str, safe: str) -> None:
    assert escape(text) == safe


@given(st.text())
def test_escaped_text_is_printable_and_stays_as_it_is(text: str) -> None:
    once = escape(text)

    assert once.isprintable()
    assert escape(once) == once
    if text.isprintable():
        assert once == text


@given(st.text(max_size=200), st.integers(20, 100))
def test_a_shortened_line_is_within_its_limit_and_keeps_both_ends(text: str, limit: int) -> None:
    line = escape(text)
    cut = shortened(line, limit)

    assert len(cut.encode()) <= limit
    if len(line.encode()) <= limit:
        assert cut == line
    else:
        begin, _, end = cut.partition(" ... ")
        assert line.startswith(begin)
        assert line.endswith(end)


@pytest.mark.parametrize(
    ("wanted", "journal", "terminal", "coloured", "style"),
    [
        ("auto", True, False, True, Style.JOURNAL),
        ("auto", False, True, True, Style.COLOUR),
        ("auto", False, True, False, Style.PLAIN),
        ("auto", False, False, True, Style.PLAIN),
        ("journal", False, True, True, Style.JOURNAL),
        ("text", False, True, True, Style.COLOUR),
        ("text", False, False, True, Style.PLAIN),
        ("text", True, False, True, Style.BARE),
    ],
)
def test_the_style_suits_where_the_lines_go(
    wanted: str, style: Style, *, journal: bool, terminal: bool, coloured: bool
) -> None:
    assert style_of(wanted, journal=journal, terminal=terminal, coloured=coloured) is style


@pytest.mark.parametrize(
    ("variables", "liked"),
    [
        ({}, True),
        ({"TERM": "xterm"}, True),
        ({"TERM": "dumb"}, False),
        ({"NO_COLOR": "1"}, False),
        ({"NO_COLOR": ""}, True),
    ],
)
def test_colour_is_left_out_where_it_is_not_liked(variables: dict[str, str], *, liked: bool) -> None:
    assert likes_colour(variables) == liked


def test_the_journal_is_known_by_device_and_inode(tmp_path: Path) -> None:
    fd = os.open(tmp_path / "stream", os.O_WRONLY | os.O_CREAT)
    status = os.fstat(fd)

    assert is_journal(fd, {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino}"})
    assert not is_journal(fd, {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino + 1}"})
    assert not is_journal(fd, {})
    os.close(fd)
    assert not is_journal(fd, {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino}"})


@pytest.mark.parametrize(
    ("level", "priority"),
    [(logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6), (logging.DEBUG, 7), (1, 7)],
)
def test_the_journal_is_told_the_priority(level: int, priority: int) -> None:
    line = LineFormatter(Style.JOURNAL).format(record(level=level))

    assert line == f"<{priority}>slave 3 is offline"


@pytest.mark.parametrize(
    ("style", "line"),
    [
        (Style.PLAIN, "2026-11-21T21:53:42.003Z warning slave 3 is offline"),
        (Style.BARE, "warning slave 3 is offline"),
    ],
)
def test_a_line_says_when_how_bad_and_what(style: Style, line: str) -> None:
    assert LineFormatter(style).format(record()) == line


@pytest.mark.parametrize(
    ("level", "colour"),
    [(logging.ERROR, "\x1b[31m"), (logging.WARNING, "\x1b[33m"), (logging.INFO, ""), (logging.DEBUG, "\x1b[2m")],
)
def test_on_a_terminal_colour_says_how_bad(level: int, colour: str) -> None:
    line = LineFormatter(Style.COLOUR).format(record(level=level))

    name = logging.getLevelName(level).lower()
    assert line.endswith(f"\x1b[0m {colour}{name:<7} slave 3 is offline\x1b[0m")
    assert re.match(r"\x1b\[2m\d\d:\d\d:\d\d \S+\x1b", line)  # the time has the name of its zone


@pytest.mark.parametrize("style", list(Style))
@given(words=st.text(), argument=st.text())
def test_no_record_breaks_its_line(style: Style, words: str, argument: str) -> None:
    line = LineFormatter(style, tracebacks=True).format(record(words + "%s", argument, error=raised(argument)))

    plain = line.replace("\x1b[0m", "").replace("\x1b[2m", "").replace("\x1b[33m", "")
    assert plain.isprintable()


def test_an_error_is_its_type_and_text_on_the_same_line() -> None:
    line = LineFormatter(Style.BARE).format(record("slave %d", 3, error=raised()))

    assert line == "warning slave 3: ValueError: no such\\nregister"


def test_an_error_without_text_is_its_type() -> None:
    assert LineFormatter(Style.BARE).format(record("slave 3", error=raised(""))) == "warning slave 3: ValueError"


def test_a_traceback_is_told_on_the_same_line_where_it_is_wanted() -> None:
    line = LineFormatter(Style.BARE, tracebacks=True).format(record("slave 3", error=raised()))

    assert line.startswith("warning slave 3: ValueError: no such\\nregister | Traceback (most recent call last):\\n")
    assert "in fail" in line


def test_exc_info_without_an_exception_says_nothing_more() -> None:
    made = record()
    made.exc_info = (None, None, None)

    assert LineFormatter(Style.BARE).format(made) == "warning slave 3 is offline"


def test_another_packages_record_begins_with_its_name() -> None:
    line = LineFormatter(Style.BARE).format(record("Task was destroyed", name="asyncio"))

    assert line == "warning asyncio: Task was destroyed"


def test_a_faulty_log_call_is_told_as_it_is() -> None:
    line = LineFormatter(Style.BARE).format(record("%d slaves", "two"))

    assert line.startswith("warning %d slaves ('two',) (")
