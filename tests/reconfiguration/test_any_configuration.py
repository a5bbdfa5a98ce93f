"""Every request over every kind of configuration (none, disabled, foreign, mixed) has one answer, none internal.

The whole daemon but its thread, its port and its broker, in virtual time: `LineAccess` as the daemon builds them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any, cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.commands.context import Context, Handler
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.commands.line_access import LineAccess
from lfs10d.config.effective import Effective
from lfs10d.config.reload import ReloadPlan
from lfs10d.daemon.settings import device_infos, line_info
from lfs10d.line.line import Line
from lfs10d.mqtt.discovery import Discovery
from lfs10d.mqtt.publisher import Publisher
from lfs10d.mqtt.topics import Topics
from lfs10d.mqtt.uplink import Uplink
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Event, Exchanged, Reading
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.sensor import Sensor
from lfs10d.system.clock import Clock, Instant
from lfs10d.telemetry.publication import BacklogStats, Publication
from lfs10d.telemetry.station import Station
from tests.support.lives import EPOCH, Bench, Life, Wire
from tests.support.stations import DAEMON

CONFIGURATIONS = {
    "none": "[]",
    "disabled": "[{id: 3, name: s3, enabled: false}, {id: 4, name: s4, profile: eh600, enabled: false}]",
    "foreign": "[{id: 4, name: s3, profile: eh600}]",
    "mixed": "[{id: 3, name: s3}, {id: 4, name: s4, profile: eh600}, {id: 5, name: s5, enabled: false}]",
}
CALLS: list[tuple[str, dict[str, Any]]] = [
    ("health", {}),
    ("republish", {}),
    ("config/get", {}),
    ("config/reload", {}),
    ("config/reset", {"device": "s3"}),
    ("config/reset", {"key": "line.baudrate"}),
    ("device/add", {"slave": 7}),
    ("device/add", {"slave": 7, "probe": False}),
    ("device/add", {"slave": 3, "profile": "eh600"}),
    ("device/remove", {"device": "s3"}),
    ("device/options", {"device": "s3", "enabled": False}),
    ("device/options", {"device": "s3", "enabled": True}),
    ("device/read", {"device": "s3"}),
    ("device/readdress", {"device": "s3", "to": 9}),
    ("device/readdress", {"device": "s4", "to": 9, "dry_run": True}),
    ("line/baudrate", {"to": 19200}),
    ("line/baudrate", {"to": 38400}),
    ("line/baudrate", {"to": 19200, "power_cycle": True}),
    ("line/scan", {"ids": "1-5", "share": 100}),
    ("line/scan", {"ids": [3, 4], "add": True}),
    ("line/adopt", {}),
    ("line/adopt", {"profile": "eh600"}),
    ("line/trace", {"for": "1s"}),
    ("line/pause", {"for": "1s"}),
    ("line/cancel", {}),
    ("register/read", {"slave": 3, "address": 5, "count": 1}),
    ("register/read", {"device": "s3", "address": 5, "count": 1}),
    ("register/write", {"slave": 3, "address": 5, "value": 9}),
    ("register/write", {"device": "s4", "address": 64512, "value": 1}),
]


class VirtualLine(Wire):
    """The line as `LineAccess` sees it."""

    def read(self, device: str, request: int) -> None:
        self.poller.read(device, request)

    async def pause(self) -> None:
        self.poller.pause(lambda: None)

    def resume(self) -> None:
        self.poller.resume()


class NoBroker:
    """An uplink to nowhere."""

    backlog = BacklogStats()
    connected = False

    def __init__(self) -> None:
        self.discovery = Discovery(Topics("lfs10d/line0"), self.publish, is_out=lambda: True)

    def publish(self, publications: Iterable[Publication]) -> None:
        """Send nothing."""

    def republish(self) -> None:
        """Send nothing."""


class BenchClock:
    """Both clocks, in virtual time."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def now(self) -> Instant:
        now = self._bench.clock.now
        return Instant(now, EPOCH + now, "synced")

    def epoch_ms(self) -> int:
        return self.now().ts()


class Whole(Life):
    """One life of the daemon with all its requests."""

    @property
    def handlers(self) -> Mapping[str, Handler]:
        return HANDLERS

    def context(self) -> Context:
        config, profiles = self.running.now.config, self.running.loaded.profiles
        self.clock = cast("Clock", BenchClock(self.bench))
        infos = device_infos(config, profiles)
        station = Station(DAEMON, line_info(config.line), infos, self.clock.now())
        self.publisher = Publisher(station, DAEMON, cast("Uplink", NoBroker()), self.clock)
        line = cast("Line", VirtualLine(self.poller))
        self.access = LineAccess(line, self.running, self.publisher, self.physical)
        return Context(self.running, self.access, self.physical, self.publisher)

    def _heard(self, events: list[Event]) -> None:
        super()._heard(events)
        for event in events:
            now = self.clock.now()
            known = self.publisher.on_event(event, now)
            if isinstance(event, Exchanged):
                self.access.on_exchange(event, now)
            elif isinstance(event, Reading):
                self.access.on_reading(event, known)

    async def apply(self, plan: ReloadPlan, before: Effective) -> None:
        now = self.running.now
        self.publisher.configure(line_info(now.config.line), device_infos(now.config, now.loaded.profiles))
        self.access.on_config(before.config, now.config)
        await super().apply(plan, before)


@pytest.fixture
def whole(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Whole]]:
    """Give the function that begins a life with a configuration, on a line with a newcomer, an LFS10 and an EH600."""

    async def at_once(call: Callable[[], Any], name: str) -> Any:  # noqa: ANN401 - passed on
        del name
        return call()

    monkeypatch.setattr("lfs10d.commands.line_access.run_in_thread", at_once)

    async def born() -> Whole:
        return Whole(bench)

    def begin(configuration: str) -> Whole:
        bench.renew()
        bench.sensors(1, 3, names=False)
        bench.line.add(Sensor(4, blueprint=blueprint_of(load_profile("eh600", relative_to=bench.file))))
        text = bench.file.read_text().replace("slaves: []", f"slaves: {CONFIGURATIONS[configuration]}")
        bench.file.write_text(text)
        bench.cut()
        life = bench.loop.run_until_complete(born())
        bench.go(life, 3.0)
        return life

    yield begin
    bench.renew()


def answered(bench: Bench, life: Whole, number: int, name: str, parameters: dict[str, Any]) -> dict[str, Any]:
    """Ask a request, and go on until it is answered and a while longer; return its one answer."""
    life.request(name, id=number, **parameters)
    mine = partial(_mine, bench, name, number)
    until = bench.clock.now + 400.0
    while not mine():
        assert bench.clock.now < until, "no answer"
        bench.turn(life)
    bench.go(life, 4.0)
    (answer,) = mine()
    return answer


def _mine(bench: Bench, name: str, number: int) -> list[dict[str, Any]]:
    return [each for each in bench.responses if (each["request"], each["id"]) == (name, number)]


def test_every_request_is_asked_here() -> None:
    assert {name for name, _ in CALLS} == set(HANDLERS)


@pytest.mark.parametrize("configuration", CONFIGURATIONS)
def test_every_request_has_one_answer_over_every_configuration(
    bench: Bench, whole: Callable[[str], Whole], configuration: str
) -> None:
    for name, parameters in CALLS:
        life = whole(configuration)
        answer = answered(bench, life, 1, name, parameters)
        assert answer["status"] in {"ok", "rejected", "failed"}
        error = answer["error"]
        assert (error is None) is (answer["status"] == "ok")
        assert error is None or error["code"] not in {"internal", "unknown_request", "invalid_json"}


@given(st.sampled_from(list(CONFIGURATIONS)), st.lists(st.sampled_from(CALLS), min_size=2, max_size=4))
@settings(max_examples=15, derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck))
def test_requests_one_after_the_other_have_one_answer_each(
    bench: Bench, whole: Callable[[str], Whole], configuration: str, calls: list[tuple[str, dict[str, Any]]]
) -> None:
    life = whole(configuration)
    for number, (name, parameters) in enumerate(calls, 1):
        answered(bench, life, number, name, parameters)
    assert len(bench.responses) == len(calls)
