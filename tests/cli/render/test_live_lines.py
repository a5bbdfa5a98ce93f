"""The live view as lines."""

from __future__ import annotations

from datetime import UTC
from typing import Any

from lfs10d.cli.render.live_lines import LiveLines, health
from lfs10d.cli.render.live_state import LiveState
from lfs10d.cli.render.live_table import DataSource

WALL = 1_795_298_000.0
HERE = DataSource("live from broker localhost:1883", alive=True)
GONE = DataSource("NOT LIVE: the daemon is offline", alive=False)


def status(seq: int = 1, value: float | None = 4.5, **keys: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    device = {
        "name": "a",
        "slave": 2,
        "label": "Mast",
        "online": value is not None,
        "seq": seq,
        "values": {"wind_speed": value},
        "units": {"wind_speed": "m/s"},
        "quality": "bad" if value is None else "good",
        "error": "timeout" if value is None else None,
        "rtt_ms": None if value is None else 18.2,
        "age_s": 0.4 if value is not None else 75.0,
    }
    line = {"name": "line0", "port": "/dev/x", "load_pct": 5.0 * seq}
    return {"ts": round(WALL * 1000), "line": line, "devices": [device], **keys}


class Pipe:
    """Gives a status after the other and keeps the lines."""

    def __init__(self) -> None:
        self.live = LiveState("line0")
        self.lines = LiveLines(UTC)
        self.data: list[dict[str, Any]] = []

    def read(self, told: dict[str, Any], source: DataSource = HERE) -> list[str]:
        self.live.on_status(told, now=1.0)
        news = list(self.lines.changes(self.live, source, now=1.0, wall=WALL))
        self.data += [data for _, data in news if data is not None]
        return [text for text, _ in news]


def test_a_heading_says_where_it_comes_from_and_each_value_is_a_line() -> None:
    assert Pipe().read(status()) == [
        "# line0: /dev/x",
        "# live from broker localhost:1883",
        "2026-11-21 21:53:20.000 UTC  a  2  4.50 m/s  good  answer 18 ms",
    ]


def test_only_what_is_new_is_told() -> None:
    pipe = Pipe()
    pipe.read(status(1))
    assert pipe.read(status(1)) == []
    assert pipe.read(status(2)) == ["2026-11-21 21:53:20.000 UTC  a  2  4.50 m/s  good  answer 18 ms"]


def test_a_failure_is_told_with_the_age_of_the_last_value() -> None:
    pipe = Pipe()
    pipe.read(status(1))
    (line,) = pipe.read(status(2, None))
    assert line == "2026-11-21 21:53:20.000 UTC  a  2  -  offline: timeout, no answer  last value 75s ago  went"


def test_when_the_source_changes_a_new_heading_says_so_and_nothing_is_called_good_any_more() -> None:
    pipe = Pipe()
    pipe.read(status(1))
    assert pipe.read(status(1), GONE) == [
        "# line0: /dev/x",
        "# NOT LIVE: the daemon is offline",
        "2026-11-21 21:53:20.000 UTC  a  2  4.50 m/s  old value  last value 0.4s ago",
    ]


def test_programs_are_told_the_same_as_data() -> None:
    pipe = Pipe()
    pipe.read(status(1))
    pipe.read(status(1), GONE)
    first, second = pipe.data
    assert first == {
        "time": "2026-11-21T21:53:20.000Z",
        "device": "a",
        "slave": 2,
        "label": "Mast",
        "values": {"wind_speed": 4.5},
        "units": {"wind_speed": "m/s"},
        "state": "good",
        "error": None,
        "errors": {},
        "online": True,
        "age_s": 0.4,
        "rtt_ms": 18.2,
        "gust_10m": None,
        "mean_2m": None,
        "just": None,
        "live": True,
    }
    assert (second["live"], second["state"]) == (False, "old value")


def test_health_is_the_line_the_broker_and_every_device() -> None:
    told = list(health(status(broker={"connected": False, "depth": 12, "dropped": 0}), UTC))
    assert told == [
        "line0: /dev/x, load 5.0 %",
        "broker away, 12 samples wait; times: UTC",
        "",
        "  sensor  id     value state      age answer label",
        "  a        2  4.50 m/s good      0.4s  18 ms Mast",
    ]
    assert "broker connected; times: UTC" in list(health(status(broker={"connected": True, "depth": 0}), UTC))


def test_health_of_nothing_says_so() -> None:
    assert list(health({}, UTC))[:2] == ["?: ?", "broker away; times: UTC"]
