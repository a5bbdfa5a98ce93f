"""States of the page as a person may meet them, made without a daemon: for its tests and for `make screens`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from lfs10d.web.actions import RequestRecord
from lfs10d.web.line_model import LineModel
from tests.support.pages import PageServer

PLACE: Final = "broker 192.168.1.5:1883"
LONG: Final = "The anemometer on the north-western corner of the tall chimney behind the old boiler house " * 2
HOSTILE: Final = "<img src=x onerror=\"document.title='owned'\"><script>document.title='owned'</script>"


class ShownLine:
    """A line with sensors, an hour of wind behind it, and the time that is now."""

    def __init__(self, server: PageServer, name: str = "line0", sensors: int = 8, *, interval: float = 1.0) -> None:
        made = server.site.line("lfs10d", name, PLACE)
        assert made is not None
        self.model: LineModel = made
        self.names = [f"mast-{number}" for number in range(2, sensors + 2)]
        self.labels: dict[str, str] = {}
        self.seq = 0
        self._good_ts: dict[str, int] = {}
        self._interval = interval
        self.model.link.connected = True
        self.model.link.place = PLACE
        self.publish("availability", "online")
        self.publish("info", {"version": "1.0", "host": "roof-gateway", "clock": "synced", "started": self.ts(3700)})
        self.state()
        stats = {"load_pct": 31.0, "polls_per_s": 8.0, "cycle_s": 1.01, "exchanges": 4711, "errors": {}}
        self.publish("line/stats", stats | {"gap_us": {"min": 3701.0}, "store": {"depth": 0, "dropped": 0}})
        self.devices()

    def ts(self, ago: float = 0.0) -> int:
        """Return a time, epoch ms."""
        return round((time.time() - ago) * 1000)

    def publish(self, topic: str, payload: Any, *, old: bool = False) -> None:  # noqa: ANN401 - any JSON
        """Take a message."""
        self.model.on_message(topic, payload, old=old, now=time.monotonic(), wall=time.time())

    def state(self, **changed: Any) -> None:  # noqa: ANN401 - any JSON
        """Publish the line's state."""
        usual = {"port": "/dev/ttyUSB0", "baudrate": 9600, "databits": 8, "parity": "none", "stopbits": 1,
                 "framing": "rtu", "open": True, "activity": "polling", "requests": "ok"}  # fmt: skip
        self.publish("line/state", usual | changed)

    def devices(self, **changed: Any) -> None:  # noqa: ANN401 - any JSON
        """Publish which devices there are."""
        entries = [
            {"name": name, "id": 2 + place, "label": self.labels.get(name, f"Mast, {10 - place} m"), "profile": "lfs10",
             "enabled": True, "interval": self._interval} | changed
            for place, name in enumerate(self.names)
        ]  # fmt: skip
        self.publish("devices", entries)

    def hour(self, speed: float = 6.0, *, until: float = 4.0, gone: Mapping[str, float] | None = None) -> None:
        """Publish an hour of wind, of many sensors ten minutes, `until` so long ago; each of `gone` failed since."""
        long, step = (3600, 4) if len(self.names) <= 8 else (600, 12)
        for place, name in enumerate(self.names):
            since = (gone or {}).get(name, 0.0)
            history = [
                self._sample(name, value if ago > since else None, ago, seq=-ago)
                for ago in range(long, int(until), -step)
                for value in (speed * (1 + 0.4 * math.sin(ago / 90 + place)),)
            ]
            for start in range(0, len(history), 100):
                self.publish(f"device/{name}/history", history[start : start + 100])

    def measure(self, speed: float = 6.0, *, only: str | None = None, ago: float = 0.0, **more: Any) -> None:  # noqa: ANN401 - any JSON
        """Publish a sample of each sensor."""
        self.seq += 1
        for place, name in enumerate(self.names):
            if only in {None, name}:
                self.publish(f"device/{name}/availability", "online")
                sample = self._sample(name, speed + 0.7 * place, ago, seq=self.seq) | more
                self.publish(f"device/{name}/telemetry", sample, old=ago > 0)
                self._good_ts[name] = self.ts(ago)

    def wind(self, speed: float = 6.0, *, beaufort: int = 4) -> None:
        """Publish wind statistics of each sensor."""
        for name in self.names:
            self.publish(
                f"device/{name}/wind",
                {"unit": "m/s", "mean_2m": speed, "mean_10m": speed * 0.9, "gust_10m": speed * 1.7, "lull_10m": 1.1,
                 "gust_10m_ts": self.ts(90), "max_10m": speed * 1.8, "beaufort": beaufort, "coverage_10m": 0.998},
            )  # fmt: skip
            self.publish(f"device/{name}/stats", {"polls": 3600, "good": 3597, "errors": {"crc": 3},
                                                  "rtt_ms": {"p50": 18.2, "p95": 21.0}, "response_timeout_ms": 90.1,
                                                  "last_good_ts": self._good_ts.get(name)})  # fmt: skip

    def fail(self, name: str, code: str, message: str, *, offline: bool = True, ago: float = 0.0) -> None:
        """Publish that a sensor fails, for `ago` s."""
        self.seq += 1
        if offline:
            self.publish(f"device/{name}/availability", "offline")
            none = dict.fromkeys(("mean_2m", "mean_10m", "gust_10m", "lull_10m", "gust_10m_ts", "max_10m", "beaufort"))
            self.publish(f"device/{name}/wind", none | {"unit": "m/s", "coverage_10m": 0.0})
        self.publish(f"device/{name}/telemetry", self._sample(name, None, 0.0, seq=self.seq) | {"error": code})
        self.publish(f"device/{name}/error", {"active": True, "code": code, "message": message, "since": self.ts(ago),
                                              "last": self.ts(), "count": 37,
                                              "heard": "02 03 04 41 20" if code == "crc" else ""})  # fmt: skip

    def _sample(self, name: str, value: float | None, ago: float, *, seq: int) -> dict[str, Any]:
        return {
            "v": 1, "device": name, "boot": "boot0001", "seq": seq, "ts": self.ts(ago), "unit": "m/s",
            "wind_speed": None if value is None else round(value, 2), "quality": "bad" if value is None else "good",
            "error": "timeout" if value is None else None, "rtt_ms": 18.2,
        }  # fmt: skip


USUAL_INTERVAL: Final = 20.0
"""s: a screenshot of each width takes less than three of them."""


def _line(server: PageServer, sensors: int = 8, name: str = "line0", speed: float = 6.0) -> ShownLine:
    line = ShownLine(server, name, sensors, interval=USUAL_INTERVAL)
    line.hour(speed)
    line.measure(speed)
    line.wind(speed, beaufort=12 if speed > 32 else 4)
    return line


def _nothing(server: PageServer) -> None:
    assert server.site.lines == {}


def _three_lines(server: PageServer) -> None:
    for name in ("roof", "crane", "harbour"):
        _line(server, 3, name)


def _not_there(server: PageServer) -> None:
    line = server.site.line("lfs10d", "line0", PLACE)
    assert line is not None
    line.link.why = f"{PLACE}: connection refused"


def _broker_away(server: PageServer) -> None:
    model = _line(server).model
    model.link.connected, model.link.why = False, f"{PLACE}: connection refused"


class _WrittenStatus:
    """In place of a feed: a status file that the daemon writes, while the broker is away."""

    def __init__(self, line: ShownLine) -> None:
        self._line = line

    def look(self) -> None:
        """Take the file as it is now."""
        line = self._line
        line.seq += 1
        devices = [
            {"name": name, "slave": 2 + place, "label": "Mast", "profile": "lfs10", "enabled": True, "interval": 1.0,
             "online": True, "seq": line.seq, "ts": line.ts(), "values": {"wind_speed": 5.5 + place},
             "units": {"wind_speed": "m/s"}, "quality": "good", "error": None, "rtt_ms": 18.0, "age_s": 0.1}
            for place, name in enumerate(line.names)
        ]  # fmt: skip
        port = {"name": "line0", "port": "/dev/ttyUSB0", "baudrate": 9600, "open": True}
        broker = {"connected": False, "depth": 4312}
        status = {"ts": line.ts(), "info": {}, "line": port, "broker": broker, "devices": devices}
        line.model.on_status("/run/lfs10d/status.json", status, now=time.monotonic())


def _status_file(server: PageServer) -> None:
    line = _line(server)
    line.model.link.connected, line.model.link.why = False, f"{PLACE}: connection refused"
    feed: Any = _WrittenStatus(line)
    server.viewers._feeds = [feed]


def _daemon_dead(server: PageServer) -> None:
    _line(server).publish("availability", "offline")


def _offline(server: PageServer) -> None:
    line = ShownLine(server, interval=USUAL_INTERVAL)
    gone = {"mast-4": 1500.0, "mast-6": 30.0}
    line.hour(gone=gone)
    for name in line.names:
        line.measure(only=name, ago=gone.get(name, 0.0))
    line.wind()
    line.fail("mast-4", "timeout", "no answer in 200 ms", ago=1500)
    line.fail("mast-6", "crc", "the answer's check is wrong", offline=False, ago=30)


def _port_lost(server: PageServer) -> None:
    line = ShownLine(server, interval=USUAL_INTERVAL)
    line.hour(gone=dict.fromkeys(line.names, 65.0))
    line.measure(ago=65)
    line.wind()
    line.state(open=False)
    line.publish("line/error", {"active": True, "code": "port_lost", "message": "/dev/ttyUSB0 is not there",
                                "since": line.ts(65), "count": 1})  # fmt: skip
    for name in line.names:
        line.fail(name, "port_lost", "/dev/ttyUSB0 is not there", ago=65)
        line.publish(f"device/{name}/error", {"active": False, "code": None})  # masked by the line's


def _stale(server: PageServer) -> None:
    line = ShownLine(server)
    line.hour(until=500)
    line.measure(ago=500)


def _partial(server: PageServer) -> None:
    line = _line(server, 2)
    units = {"wind_speed": "m/s", "direction": "°", "temperature": "°C"}
    line.measure(only="mast-2", direction=270, temperature=None, units=units, quality="partial",
                 errors={"temperature": "unavailable"})  # fmt: skip


def _labels(server: PageServer) -> None:
    line = ShownLine(server, sensors=4, interval=USUAL_INTERVAL)
    line.labels = {"mast-2": LONG, "mast-3": "מד רוח על הגג הצפוני, 10 מטר", "mast-4": HOSTILE, "mast-5": "x" * 190}
    line.devices()
    line.measure()


def _clock(server: PageServer) -> None:
    line = _line(server)
    line.publish("info", {"version": "1.0", "host": "roof-gateway", "clock": "unsynced"})


def _request(status: str, words: str) -> Callable[[PageServer], None]:
    def make(server: PageServer) -> None:
        _line(server)
        record = RequestRecord(1, "device/read", {"device": "mast-2"}, round(time.time() * 1000), status, words)
        server.answers("line0", {}).records.append(record)

    return make


def _scanning(server: PageServer) -> None:
    line = _line(server)
    line.state(activity="scanning")
    line.publish("event", {"type": "scan_progress", "percent": 42, "remaining_s": 31, "baudrate": 9600, "slave": 14})


class _Mounting:
    """Mounting that goes on: one sensor is there, the next is awaited."""

    running = True

    def shown(self) -> dict[str, Any]:
        adopted = [{"device": "mast-2", "slave": 2, "baudrate": 9600, "words": "mast-2: slave id 2, 9600 baud"}]
        return {"running": True, "began": 0, "words": "Plug in the next one.", "problem": "", "names": [],
                "adopted": adopted}  # fmt: skip


def _mounting(server: PageServer) -> None:
    _line(server, 1)
    actions: Any = server.answers("line0", {})
    actions.mounting = _Mounting()


def _with_frames(server: PageServer) -> None:
    line = _line(server)
    for number in range(20):
        frame = {"ts": line.ts(20 - number), "direction": "rx" if number % 2 else "tx", "gap_us": 4000}
        line.publish("trace", frame | {"hex": "02 03 00 00 00 01 84 39", "text": "slave 2: read 1 register from 0"})


STATES: Final[Mapping[str, tuple[str, Callable[[PageServer], object]]]] = {
    "nothing-configured": ("/", _nothing),
    "never-there": ("/", _not_there),
    "broker-away": ("/", _broker_away),
    "status-file": ("/", _status_file),
    "daemon-dead": ("/", _daemon_dead),
    "port-lost": ("/", _port_lost),
    "all-well": ("/", _line),
    "three-lines": ("/", _three_lines),
    "one-sensor": ("/", lambda server: _line(server, 1)),
    "no-sensor": ("/", lambda server: _line(server, 0)),
    "32-sensors": ("/", lambda server: _line(server, 32)),
    "247-sensors": ("/", lambda server: _line(server, 247)),
    "offline": ("/", _offline),
    "offline-device": ("/device/line0/mast-4", _offline),
    "stale": ("/", _stale),
    "partial": ("/", _partial),
    "storm": ("/", lambda server: _line(server, 3, speed=70.0)),
    "storm-device": ("/device/line0/mast-2", lambda server: _line(server, 3, speed=70.0)),
    "labels": ("/", _labels),
    "clock-unsynced": ("/", _clock),
    "device": ("/device/line0/mast-2", _with_frames),
    "line": ("/line/line0", _with_frames),
    "request-running": ("/device/line0/mast-2", _request("running", "")),
    "request-refused": (
        "/device/line0/mast-2",
        _request("rejected", "Nothing was changed: another job is under way. Wait for its end, then try again."),
    ),
    "request-failed": (
        "/device/line0/mast-2",
        _request("failed", "It failed: does not answer. Check its power."),
    ),
    "request-done": ("/device/line0/mast-2", _request("ok", "Done.")),
    "scan-running": ("/line/line0", _scanning),
    "mounting": ("/line/line0", _mounting),
}
"""State: the page's path, and what makes it."""
