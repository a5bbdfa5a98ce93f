"""The live table: what a person reads on a terminal of any size."""

from __future__ import annotations

from datetime import UTC, timedelta, timezone
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.cli.render.live_state import LiveState
from lfs10d.cli.render.live_table import DataSource, Line, age_text, header, rows, screen, table

WALL = 1_795_298_000.0
HERE = DataSource("live from broker localhost:1883", alive=True)
GONE = DataSource("NOT LIVE: the daemon is offline", alive=False)


def entry(name: str, slave: int, **keys: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    return {
        "name": name,
        "slave": slave,
        "label": None,
        "enabled": True,
        "interval": 1.0,
        "online": True,
        "seq": 1,
        "values": {"wind_speed": 4.5},
        "units": {"wind_speed": "m/s"},
        "quality": "good",
        "error": None,
        "rtt_ms": 18.2,
        "age_s": 0.4,
        **keys,
    }


def bad(name: str, slave: int, error: str | None = "timeout", **keys: Any) -> dict[str, Any]:  # noqa: ANN401 - plain data of any shape
    nothing = {"values": {"wind_speed": None}, "quality": "bad", "rtt_ms": None, "age_s": 75.0}
    return entry(name, slave, **{**nothing, "error": error, "online": False, **keys})


def live(*entries: dict[str, Any], **line: Any) -> LiveState:  # noqa: ANN401 - plain data of any shape
    shown = LiveState("line0")
    shape = {"port": "/dev/ttyUSB0", "baudrate": 9600, "databits": 8, "parity": "none", "stopbits": 1, "open": True}
    status = {"ts": round(WALL * 1000), "line": {**shape, "load_pct": 34.5, "polls_per_s": 12.0, **line}}
    shown.on_status({**status, "devices": list(entries)}, now=0.0)
    return shown


AN_HOUR_AGO = {"active": True, "code": "timeout", "since": (WALL - 3600) * 1000}
SITE = (
    entry("slave-2", 2),
    entry("mast-top", 3, label="Mast, 10 m", values={"wind_speed": 12.3}),
    bad("north", 4),
    bad("off", 5, error=None, enabled=False),
)


def text(line: Line) -> str:
    return "".join(piece for piece, _ in line)


def texts(lines: list[Line]) -> list[str]:
    return [text(line) for line in lines]


def states(*entries: dict[str, Any], source: DataSource = HERE) -> list[str]:
    return [row.state for row in rows(live(*entries), source, now=0.0, wall=WALL, zone=UTC)]


def test_a_site_at_80_columns() -> None:
    assert texts(screen(live(*SITE), HERE, (80, 24), now=0.0, wall=WALL, zone=UTC)) == [
        "line0: /dev/ttyUSB0, 9600 baud 8N1, load 34.5 %, 12.0 polls/s",
        "live from broker localhost:1883",
        "",
        "  sensor    id     value state                        age answer label",
        "  slave-2    2  4.50 m/s good                        0.4s  18 ms",
        "  mast-top   3 12.30 m/s good                        0.4s  18 ms Mast, 10 m",
        "  north      4         - offline: timeout, no answer  75s",
        "  off        5         - disabled",
        "",
        "> moved just now   + came   - went   times: UTC   Ctrl-C ends",
    ]


def test_the_sensor_that_moved_is_marked_and_stands_out() -> None:
    shown = live(entry("a", 2), entry("b", 3))
    status = {
        "ts": round(WALL * 1000),
        "devices": [entry("a", 2, seq=2), entry("b", 3, seq=2, values={"wind_speed": 1.0})],
    }
    shown.on_status(status, now=1.0)
    shown.on_status(
        {**status, "devices": [entry("a", 2, seq=3), entry("b", 3, seq=3, values={"wind_speed": 9.0})]}, now=2.0
    )
    _, first, second = table(rows(shown, HERE, now=2.0, wall=WALL), 80)
    assert (text(first)[:3], text(second)[:3]) == ("  a", "> b")
    assert [style for piece, style in second if "9.00" in piece] == ["bold green"]


@pytest.mark.parametrize(("online", "mark"), [(True, "+ a"), (False, "- a")])
def test_one_that_just_came_or_went_is_marked_for_five_seconds(online: bool, mark: str) -> None:  # noqa: FBT001 - the test's parameter
    shown = live(entry("a", 2, online=not online))
    shown.on_status({"ts": round(WALL * 1000), "devices": [entry("a", 2, online=online)]}, now=10.0)
    assert [text(table(rows(shown, HERE, now=now, wall=WALL), 80)[1])[:3] for now in (14.9, 15.1)] == [mark, "  a"]


@pytest.mark.parametrize(
    ("device", "state"),
    [
        (entry("a", 2), "good"),
        (bad("a", 2), "offline: timeout, no answer"),
        (bad("a", 2, online=True), "timeout, no answer"),
        (bad("a", 2, "crc", online=True), "crc, garbled answer"),
        (bad("a", 2, "exception", online=True), "exception, refuses"),
        (bad("a", 2, "port_lost"), "port_lost, no port"),
        (bad("a", 2, "port_busy"), "port_busy, another program has the port"),
        (bad("a", 2, "config_conflict"), "config_conflict, two devices with one id"),
        (bad("a", 2, "something new"), "offline: something new"),
        (entry("a", 2, alarm={"active": True, "code": "duplicate_id"}), "duplicate_id, two sensors answer"),
        (entry("a", 2, alarm={**AN_HOUR_AGO, "code": "duplicate_id"}), "duplicate_id, two sensors answer; since 20:53"),
        (entry("a", 2, alarm=AN_HOUR_AGO), "good"),
        (bad("a", 2, None), "no reply yet"),
        (bad("a", 2, "starting"), "starting, not polled yet"),
        (bad("a", 2, alarm={"active": False, "code": None}), "offline: timeout, no answer"),
        (bad("a", 2, alarm=AN_HOUR_AGO), "offline: timeout, no answer; since 20:53"),
        (bad("a", 2, alarm={**AN_HOUR_AGO, "since": 0}), "offline: timeout, no answer; since 1 Jan 00:00"),
        (bad("a", 2, alarm={**AN_HOUR_AGO, "since": "yesterday"}), "offline: timeout, no answer"),
        (bad("a", 2, None, enabled=False), "disabled"),
        (entry("a", 2, enabled=False), "disabled"),
        (entry("a", 2, age_s=6.1), "old value"),
    ],
)
def test_availability_and_error_are_told_in_words(device: dict[str, Any], state: str) -> None:
    assert states(device) == [state]


def test_one_id_with_two_sensors_is_no_good_state_though_its_samples_are_good() -> None:
    """Before, the table showed it as good; only an alarm that has nothing to do with samples outlives a good one."""
    twin = {"v": 1, "active": True, "code": "duplicate_id", "message": "two answers", "since": WALL * 1000}
    shown = live(entry("a", 2))
    shown.on_message("device/a/error", twin, old=True, now=0.0, wall=WALL)
    (row,) = rows(shown, HERE, now=0.0, wall=WALL, zone=UTC)
    assert (row.good, row.state, row.value) == (False, "duplicate_id, two sensors answer; since 21:53", "4.50 m/s")
    shown.on_message("device/a/error", {"active": False, "code": None}, old=False, now=0.0, wall=WALL)
    assert rows(shown, HERE, now=0.0, wall=WALL)[0].good


def test_what_is_old_is_never_shown_as_live() -> None:
    (row,) = rows(live(entry("a", 2)), GONE, now=0.0, wall=WALL + 90)
    assert (row.state, row.stale, row.rtt, row.age, row.just) == ("old value", True, "", "90s", "")
    _, line = table([row], 80)
    assert {style for piece, style in line if piece.strip()} == {"dim"}
    assert header(live(), GONE, 80)[1] == ((GONE.words, "bold yellow"),)


def test_several_values_stand_beside_each_other() -> None:
    values = {"speed": 1450, "current": 1.5}
    units = {"speed": "rpm", "current": "A"}
    (row,) = rows(live(entry("a", 2, values=values, units=units)), HERE, now=0.0, wall=WALL)
    assert row.value == "1450 rpm, 1.50 A"


def test_a_partial_sample_shows_what_is_there_and_why_the_rest_is_not() -> None:
    values = {"speed": 4.5, "humidity": None, "sky": "rain", "heating": True, "dew": None}
    errors = {"humidity": "unavailable", "dew": "not_finite"}
    device = entry("a", 2, values=values, units={"speed": "m/s"}, quality="partial", errors=errors)
    (row,) = rows(live(device), HERE, now=0.0, wall=WALL)
    assert row.value == "4.50 m/s, rain, heating yes"
    assert row.state == "partial: humidity unavailable, dew not_finite"
    assert (row.good, row.stale) == (True, False)
    (row,) = rows(live({**device, "age_s": 60.0}), HERE, now=0.0, wall=WALL)
    assert (row.state, row.stale) == ("old value", True)


@pytest.mark.parametrize(
    ("values", "words"), [({"count": 53493}, "53493"), ({"speed": 1450, "fault": 0}, "1450 rpm, fault 0")]
)
def test_a_bare_number_has_no_unit_but_among_others_its_name(values: dict[str, int], words: str) -> None:
    units = {"speed": "rpm", "count": "1", "fault": "1"}
    (row,) = rows(live(entry("a", 2, values=values, units=units)), HERE, now=0.0, wall=WALL)
    assert row.value == words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.0, "0.0s"), (0.44, "0.4s"), (9.94, "9.9s"), (9.95, "10s"), (99.4, "99s"), (100, "2m"), (5_940, "99m"),
     (6_000, "2h"), (359_000, "100h"), (360_000, "4d"), (8_640_000, "100d")],
)  # fmt: skip
def test_an_age_has_its_unit(seconds: float, words: str) -> None:
    assert age_text(seconds) == words


@pytest.mark.parametrize(
    ("width", "head"),
    [
        (80, "  sensor    id     value state                        age answer label"),
        (75, "  sensor    id     value state                        age answer label"),
        (71, "  sensor    id     value state                        age answer label"),
        (70, "  sensor    id     value state                        age answer"),
        (63, "  sensor    id     value state                        age"),
        (56, "  sensor    id     value state"),
        (51, "  sensor       value state"),
        (20, "  sensor       value"),
    ],
)
def test_a_narrow_terminal_does_without_the_least_important_columns(width: int, head: str) -> None:
    assert text(table(rows(live(*SITE), HERE, now=0.0, wall=WALL), width)[0]) == head


def test_names_too_long_for_their_column_show_that_they_are_cut() -> None:
    (row,) = rows(live(entry("a" * 32, 2)), HERE, now=0.0, wall=WALL)
    assert f"  {'a' * 19}~   2" in text(table([row], 80)[1])


def test_a_line_error_is_told_in_words_above_all() -> None:
    lost = {"active": True, "code": "port_lost", "message": "no such file", "since": (WALL - 3600) * 1000}
    shown = live(bad("a", 2, "port_lost"), open=False, error=lost)
    east = timezone(timedelta(hours=1), "CET")
    assert (("port_lost: no such file; since 21:53", "bold red"),) in header(shown, HERE, 80, wall=WALL, zone=east)
    assert (("port_lost: no such file; since 21 Nov 21:53", "bold red"),) in header(shown, HERE, 80, zone=east)
    wordless = live(open=False, error={"active": True, "code": "port_lost"})
    assert (("port_lost, no port", "bold red"),) in header(wordless, HERE, 80)
    assert (("the port is not open", "bold red"),) in header(live(open=False), HERE, 80)


def test_what_the_line_does_beside_polling_is_told() -> None:
    assert "scanning" in text(header(live(activity="scanning"), HERE, 80)[0])
    assert "polling" not in text(header(live(activity="polling"), HERE, 80)[0])


def test_a_line_of_which_nothing_is_known_has_a_header_too() -> None:
    assert texts(header(LiveState("line0"), HERE, 80)) == ["line0: ?", HERE.words]


def test_a_long_header_is_wrapped_at_words() -> None:
    lines = texts(header(live(port="/dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0"), HERE, 50))
    assert all(len(line) <= 50 for line in lines)
    assert "  9600 baud 8N1, load 34.5 %, 12.0 polls/s" in lines


def test_where_there_are_more_rows_than_lines_those_that_need_a_look_stay() -> None:
    entries = [entry(f"slave-{slave}", slave) for slave in range(1, 33)]
    entries[20] = bad("slave-21", 21)
    entries[30] = bad("slave-31", 31)
    lines = texts(screen(live(*entries), HERE, (80, 14), now=0.0, wall=WALL))
    assert len(lines) <= 14
    names = [line.split()[0] for line in lines if line.startswith("  slave")]
    assert names == ["slave-1", "slave-2", "slave-3", "slave-4", "slave-5", "slave-21", "slave-31"]
    assert lines[-1].startswith("25 more (25 good): a taller window shows them")


def test_where_there_are_more_rows_than_lines_the_one_that_just_moved_stays() -> None:
    shown = live(*(entry(f"slave-{slave}", slave) for slave in range(1, 33)))
    for seq, value in ((2, 1.0), (3, 9.0)):
        spun = entry("slave-30", 30, seq=seq, values={"wind_speed": value})
        others = [entry(f"slave-{slave}", slave) for slave in range(1, 33) if slave != 30]
        shown.on_status({"ts": round(WALL * 1000), "devices": [*others, spun]}, now=float(seq))
    lines = texts(screen(shown, HERE, (80, 9), now=3.0, wall=WALL))
    assert [line.split()[:2] for line in lines if "slave" in line] == [["slave-1", "1"], [">", "slave-30"]]


@given(st.integers(1, 200), st.integers(1, 60), st.integers(0, 40))
def test_the_screen_fits_any_terminal(width: int, height: int, count: int) -> None:
    entries = [bad(f"slave-{slave}", slave) if slave % 3 else entry(f"slave-{slave}", slave) for slave in range(count)]
    lines = texts(screen(live(*entries), HERE, (width, height), now=0.0, wall=WALL))
    assert all(len(line) <= width for line in lines)
    if width >= 80 and height >= 8:
        assert len(lines) <= height


def test_remarks_stand_below_where_all_rows_and_they_fit() -> None:
    shown = live(entry("a", 2), entry("b", 3))
    whole = texts(screen(shown, HERE, (80, 12), now=0.0, wall=WALL, remarks=["first remark", "second remark"]))
    assert whole[-3:] == ["", "first remark", "second remark"]
    short = texts(screen(shown, HERE, (80, len(whole) - 1), now=0.0, wall=WALL, remarks=["first remark", "second"]))
    assert not any("remark" in each for each in short)
    assert len(short) == len(whole) - 3


def test_gust_and_mean_have_columns_where_a_device_has_them_and_room_is_left() -> None:
    live = LiveState("line0")
    live.on_message("devices", [{"name": "mast", "id": 2}, {"name": "fan", "id": 3}], old=True, now=0.0, wall=0.0)
    source = DataSource("live", alive=True)
    heads = ["".join(text for text, _ in table(rows(live, source, now=0.0, wall=0.0), 120)[0])]
    live.on_message("device/mast/wind", {"gust_10m": 9.876, "mean_2m": 5.25}, old=True, now=0.0, wall=0.0)
    shown = rows(live, source, now=0.0, wall=0.0)
    wide, narrow = table(shown, 120), table(shown, 40)
    heads += ["".join(text for text, _ in lines[0]) for lines in (wide, narrow)]
    assert ["gust 10m" in head and "mean 2m" in head for head in heads] == [False, True, False]
    words = "".join(text for text, _ in wide[1]).split()
    assert words[words.index("9.88") + 1] == "5.25"
    assert (shown[1].gust, shown[1].mean) == ("", "")
