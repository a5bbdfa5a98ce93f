"""The whole, its changes, and the stream that resumes."""

from __future__ import annotations

import json
from typing import Any

import pytest

from lfs10d.web.line_model import LineModel
from lfs10d.web.site_model import MOST_LINES, SiteModel, Stream, event_bytes
from tests.web.lines import PLACE, PublishedLine, entry


def nothing(line: LineModel) -> dict[str, Any]:
    del line
    return {"requests": []}


@pytest.fixture
def site() -> SiteModel:
    return SiteModel()


@pytest.fixture
def line(site: SiteModel) -> PublishedLine:
    return PublishedLine(entry(), entry("roof"), line=site.line("lfs10d", "line0", PLACE))


def merged(whole: dict[str, Any], delta: dict[str, Any]) -> dict[str, Any]:
    """Return what a viewer has after a change, as the page merges it; without curves."""
    for key, changed in delta.items():
        shown = whole["lines"].setdefault(key, {"devices": {}})
        for name, device in changed.pop("devices", {}).items():
            device.pop("points", None)
            shown["devices"].setdefault(name, {}).update(device)
        shown.update(changed)
        shown["devices"] = {name: shown["devices"][name] for name in shown["order"]}
    return whole


def bare(whole: dict[str, Any]) -> dict[str, Any]:
    """Return the lines without curves."""
    lines: dict[str, Any] = json.loads(json.dumps(whole["lines"]))
    for each in lines.values():
        for device in each["devices"].values():
            device.pop("curve", None)
    return lines


def test_a_line_is_found_again_and_two_of_one_name_have_two_keys(site: SiteModel) -> None:
    first = site.line("a/b", "line0", PLACE)
    assert first is site.line("a/b", "line0", PLACE)
    other = site.line("c/d", "line0", PLACE)
    assert first is not None
    assert other is not None
    assert (first.key, other.key) == ("line0", "c.d.line0")
    assert site.line("c.d", "line0", PLACE) is None, "a third of the same key has no place"


def test_a_flood_of_invented_lines_ends(site: SiteModel) -> None:
    made = [site.line("lfs10d", f"line{number}", PLACE) for number in range(MOST_LINES + 1)]
    assert made[-1] is None
    assert len(site.lines) == MOST_LINES


def test_the_whole_and_its_changes_give_the_whole_again(site: SiteModel, line: PublishedLine) -> None:
    viewer = {"lines": {}} | site.whole(line.wall, nothing)
    site.changes(line.wall, nothing)
    for seq in range(1, 30):
        line.measure(seq, 5.0 + seq % 3 if seq % 7 else None, name="roof" if seq % 2 else "mast")
        if seq == 10:
            line.publish("devices", [entry(label="Other"), entry("roof"), entry("new")])
        if seq == 20:
            line.publish("devices", [entry("new"), entry()])
            line.publish("line/error", {"active": True, "code": "port_lost", "message": "gone"})
        viewer = merged(viewer, site.changes(line.wall, nothing))
    viewer["lines"]["line0"].pop("frames")
    again = bare(site.whole(line.wall, nothing))
    again["line0"].pop("frames")
    assert bare(viewer) == again


def test_only_what_changed_is_sent(site: SiteModel, line: PublishedLine) -> None:
    line.measure(1, 5.0)
    site.changes(line.wall, nothing)
    assert site.changes(line.wall, nothing) == {}
    line.measure(2, 6.0)
    changed = site.changes(line.wall, nothing)
    assert set(changed["line0"]) == {"devices"}
    assert set(changed["line0"]["devices"]["mast"]) <= {"values", "seq", "good_at", "rtt_ms", "points"}


def test_a_step_of_the_curve_is_sent_once_when_it_is_over(site: SiteModel, line: PublishedLine) -> None:
    sent: list[Any] = []
    for seq in range(1, 41):
        line.measure(seq, float(seq))
        changed = site.changes(line.wall, nothing)
        sent += changed["line0"]["devices"]["mast"].get("points", [])
    curve = line.model.recent("mast")
    assert sent == curve[-len(sent) :]
    assert len(sent) >= len(curve) - 1
    assert site.whole(line.wall, nothing)["lines"]["line0"]["devices"]["mast"]["curve"] == curve


def test_frames_are_sent_once_and_not_all_of_a_flood(site: SiteModel, line: PublishedLine) -> None:
    for number in range(3):
        line.publish("trace", {"ts": number})
    assert [each["ts"] for each in site.changes(line.wall, nothing)["line0"]["frames"]] == [0, 1, 2]
    assert "frames" not in site.changes(line.wall, nothing).get("line0", {})
    for number in range(500):
        line.publish("trace", {"ts": number})
    assert [each["ts"] for each in site.changes(line.wall, nothing)["line0"]["frames"]] == list(range(400, 500))


def test_an_event_as_it_goes_over_the_wire() -> None:
    assert event_bytes("change", '{"a":1}', "e-1") == b'id: e-1\nevent: change\ndata: {"a":1}\n\n'


def test_a_viewer_resumes_where_it_lost_the_stream() -> None:
    stream = Stream("e")
    events = [stream.add(str(number)) for number in range(5)]
    assert stream.last_id == "e-5"
    assert stream.since("e-2") == events[2:]
    assert stream.since("e-5") == []


@pytest.mark.parametrize(
    "last", [None, "", "e", "5", "x-2", "e-6", "e--1", "e-x", "e-²", "e-" + "9" * 400, "e-1\nid: 7"]
)
def test_an_id_that_is_none_gets_the_whole(last: str | None) -> None:
    stream = Stream("e")
    for number in range(5):
        stream.add(str(number))
    assert stream.since(last) is None


def test_what_is_no_longer_kept_is_sent_as_a_whole() -> None:
    stream = Stream("e", kept=3)
    for number in range(5):
        stream.add(str(number))
    assert stream.since("e-1") is None
    assert len(stream.since("e-2") or []) == 3
    small = Stream("e", most_bytes=50)
    small.add("x" * 100)
    assert small.since("e-0") is None
    assert small.since("e-1") == []
