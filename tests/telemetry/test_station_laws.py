"""Laws that hold whatever happens to a station."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import cast

from hypothesis import given, settings
from hypothesis import strategies as st

from docs.generate.contract import check
from lfs10d.reading import Exchanged, Fault, FaultCode, PortChanged, Purpose, Reading
from lfs10d.system.clock import Instant
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.info import DeviceInfo
from lfs10d.telemetry.publication import Payload, Publication
from lfs10d.telemetry.station import Station
from tests.support.stations import DAEMON, LINE, LOCKED, LOST, ONE_VALUE, THIRD, TWO_VALUES, fields, good, instant

FLEET = (ONE_VALUE, TWO_VALUES, THIRD)
FAULTS = [Fault(code, "why", 6 if code is FaultCode.EXCEPTION else None, b"\x01\xff") for code in FaultCode] + [
    Fault(FaultCode.EXCEPTION, "refused", 2)
]

readings = st.builds(
    lambda device, fault, online, probe, overruns: replace(
        good(device, 0),
        values=good(device, 0).values if fault is None else None,
        rtt=None if fault else 0.02,
        fault=fault,
        online=online,
        probe=probe,
        overruns=overruns,
    ),
    st.sampled_from(["a", "b", "c", "stranger"]),
    st.none() | st.sampled_from(FAULTS),
    st.booleans(),
    st.booleans(),
    st.integers(0, 2),
)
exchanges = st.builds(
    lambda took, gap, late: Exchanged(took, 0, 0, gap, 2, Purpose.POLL, None, b"", b"", late=late),
    st.floats(0, 2),
    st.none() | st.floats(0.001, 10),
    st.integers(0, 2),
)
ports = st.sampled_from([None, LOST, LOCKED]).map(lambda fault: PortChanged(0, fault))
configurations = st.lists(
    st.sampled_from([*FLEET, *(replace(each, enabled=False) for each in FLEET)]),
    unique_by=lambda facts: facts.name,
)
steps = st.one_of(
    readings,
    exchanges,
    ports,
    configurations.map(tuple),
    st.sampled_from(["tick", "burst", "polling", "paused", "full", "empty"]),
)


WORDS: dict[str, Callable[[Station, Instant], list[Publication]]] = {
    "tick": Station.tick,
    "burst": Station.burst,
    "full": lambda running, now: running.set_line_error(FaultCode.STORAGE_FULL, "disk full", now),
    "empty": lambda running, now: running.set_line_error(FaultCode.STORAGE_FULL, None, now),
}


def take(running: Station, step: object, now: Instant) -> list[Publication]:
    """Let one step of a random history happen now."""
    match step:
        case Exchanged():
            return running.on_event(replace(step, at=now.mono, asked=now.mono - step.at), now)
        case Reading() | PortChanged():
            return running.on_event(replace(step, at=now.mono), now)
        case str() if step in WORDS:
            return WORDS[step](running, now)
        case str():
            return running.on_activity(step, now)
        case _:
            return running.configure(LINE, cast("tuple[DeviceInfo, ...]", step), now)


@settings(deadline=None)  # the claim is about truth, not about speed
@given(st.lists(st.tuples(steps, st.floats(0, 20), st.sampled_from(["synced", "unsynced"])), max_size=60))
def test_whatever_happens_the_broker_is_told_the_truth(history: list[tuple[object, float, ClockState]]) -> None:
    """Numbers have no gaps; no value is shown as bad or offline; what is retained is what the daemon stands behind.

    And every payload keeps its promise: valid JSON of its model, without NaN.
    """
    running = Station(DAEMON, LINE, FLEET, instant(0))
    broker = {each.topic: each.payload for each in running.burst(instant(0))}
    numbers = dict.fromkeys("abc", 0)
    mono = 0.0
    for step, wait, clock in history:
        mono += wait
        for each in take(running, step, instant(mono, clock)):
            if each.payload is None:
                broker.pop(each.topic, None)
                continue
            check(each.topic, each.payload if isinstance(each.payload, str) else encode(each.payload))
            if each.sample is not None:
                numbers[each.sample.device] += 1
                assert each.sample.seq == numbers[each.sample.device]
                assert each.topic == f"device/{each.sample.device}/telemetry"
            if each.retain:
                broker[each.topic] = each.payload
            for device in "abc":
                if fields(broker.get(f"device/{device}/state", {"quality": "bad"}), "quality") == ("good",):
                    assert broker[f"device/{device}/availability"] == "online"
        assert set(broker) == running.topics()
        encode(running.snapshot(instant(mono, clock)))
    now = instant(mono, clock) if history else instant(0)
    assert_same_but_for_figures(broker, {each.topic: each.payload for each in running.burst(now)})


def encode(payload: object) -> str:
    return json.dumps(payload, allow_nan=False)


def assert_same_but_for_figures(known: dict[str, Payload], said: dict[str, Payload]) -> None:
    """Whoever heard each change knows what a burst says, but for counts and states that wait for their second."""
    assert known.keys() == said.keys()
    for topic, payload in said.items():
        leaf = topic.rsplit("/", maxsplit=1)[-1]
        if leaf == "error":
            keys: tuple[str, ...] = ("active", "code")
        elif leaf == "state" and topic != "line/state":
            keys = ("quality", "error")
        elif leaf == "stats":
            continue
        else:
            assert known[topic] == payload
            continue
        assert fields(known[topic], *keys) == fields(payload, *keys)
