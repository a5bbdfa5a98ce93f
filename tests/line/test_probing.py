"""The dead are probed within their share, and found in seconds after a power cut."""

from __future__ import annotations

from itertools import pairwise
from math import inf
from pathlib import Path

import pytest

from lfs10d.line.device import Device, DeviceSpec, PollRules
from lfs10d.line.probing import PROBE_CREDIT, PROBE_SHARE, Probing
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Fault, FaultCode

NOBODY: frozenset[int] = frozenset()
SILENCE = Fault(FaultCode.TIMEOUT, "no answer in 200 ms")


def a_line(*devices: Device) -> Probing:
    """Watch devices that answered until some died at 0."""
    living = a_device(255)
    probing = Probing(0.0)
    probing.review([living], 0.0)
    probing.review([living, *devices], 0.0)
    return probing


def a_device(slave: int, *, enabled: bool = True, dead_since: float | None = None) -> Device:
    profile = load_profile("lfs10", relative_to=Path())
    spec = DeviceSpec(f"slave-{slave}", slave, profile, Codec(Framing.RTU), 1.0, enabled=enabled)
    device = Device(spec, PollRules(offline_after=1), slave)
    if dead_since is None:
        device.answered()
    else:
        device.start_polls = 1  # the last of those that are made at once
        device.failed(SILENCE, dead_since)
    return device


def probe_for(probing: Probing, *, until: float, taken: float) -> list[tuple[float, int]]:
    """Probe in vain from 0 to `until`; return when and whom."""
    now = 0.0
    probes = []
    while now < until:
        device = probing.choose(now, NOBODY)
        if device is None:
            assert probing.next_at > now
            now = probing.next_at
            continue
        probes.append((now, device.slave))
        device.last_asked = now
        now += taken
        probing.spend(device, taken, now)
        device.failed(SILENCE, now)
        probing.plan(now)
    return probes


def test_a_single_dead_device_is_probed_after_1_2_4_8_and_then_every_15_s() -> None:
    devices = [a_device(2, dead_since=0.0)]
    probing = a_line(*devices)
    probes = probe_for(probing, until=60.0, taken=0.2)
    waits = [later - earlier - 0.2 for (earlier, _), (later, _) in pairwise(probes)]
    assert probes[0][0] == pytest.approx(1.0)
    assert waits == pytest.approx([2.0, 4.0, 8.0, 15.0, 15.0])


def test_many_dead_take_five_percent_together_and_each_has_its_turn() -> None:
    devices = [a_device(slave, dead_since=0.0) for slave in range(2, 34)]
    probing = a_line(*devices)
    probes = probe_for(probing, until=1000.0, taken=0.4)
    assert len(probes) * 0.4 <= PROBE_SHARE * 1000.0 + PROBE_CREDIT + 0.4
    assert len(probes) * 0.4 >= PROBE_SHARE * 1000.0 * 0.95
    assert {slave for _, slave in probes} == set(range(2, 34))


def test_with_nobody_answering_the_dead_have_the_line_in_turn() -> None:
    devices = [a_device(slave, dead_since=0.0) for slave in range(1, 33)]
    probing = Probing(0.0)
    probing.review(devices, 0.0)
    probes = probe_for(probing, until=13.0, taken=0.2)
    assert len(probes) in {65, 66}
    assert [slave for _, slave in probes[:64]] == [*range(1, 33)] * 2


def test_with_nobody_answering_each_is_probed_at_most_once_a_second() -> None:
    devices = [a_device(1, dead_since=0.0)]
    probing = Probing(0.0)
    probing.review(devices, 0.0)
    assert [when for when, _ in probe_for(probing, until=4.5, taken=0.2)] == pytest.approx([0, 1, 2, 3, 4])


def test_the_first_answer_makes_all_due_at_once_whatever_their_share() -> None:
    devices = [a_device(slave, dead_since=0.0) for slave in range(1, 9)]
    probing = Probing(0.0)
    probing.review(devices, 0.0)
    found = probing.choose(0.0, NOBODY)
    assert found is devices[0]
    found.answered()
    probing.review(devices, 0.2)
    probes = probe_for(probing, until=2.3, taken=0.3)
    assert [slave for _, slave in probes[:7]] == [2, 3, 4, 5, 6, 7, 8]


def test_disabled_busy_and_excluded_devices_are_left_alone() -> None:
    disabled = a_device(1, enabled=False, dead_since=0.0)
    polling = a_device(2, dead_since=0.0)
    polling.polling = True
    excluded = a_device(3, dead_since=0.0)
    probing = a_line(disabled, polling, excluded)
    assert probing.choose(5.0, frozenset({3})) is None
    assert probing.next_at > 5.0
    assert probing.choose(probing.next_at, NOBODY) is excluded


def test_while_the_port_is_lost_nobody_is_probed() -> None:
    probing = Probing(0.0)
    probing.review([a_device(1, dead_since=0.0)], 0.0)
    probing.stop()
    assert probing.next_at == inf
    assert probing.choose(100.0, NOBODY) is None


def test_before_the_first_review_nobody_is_probed() -> None:
    probing = Probing(0.0)
    assert (probing.next_at, probing.anyone_online) == (inf, False)
    assert probing.choose(0.0, NOBODY) is None
    probing.plan(0.0)
    assert probing.next_at == inf


def test_after_a_stop_nobody_is_offline_or_online() -> None:
    probing = a_line(a_device(1, dead_since=0.0))
    probing.stop()
    assert not probing.anyone_online
    probing.plan(5.0)
    assert probing.next_at == inf


def test_one_whose_time_has_not_come_is_not_probed_in_place_of_an_excluded_one() -> None:
    due, later = a_device(1, dead_since=0.0), a_device(2, dead_since=3.0)
    probing = a_line(due, later)
    assert probing.choose(1.5, frozenset({1})) is None
    assert probing.next_at == pytest.approx(4.0)


def exhausted(*devices: Device) -> Probing:
    """Return the probes of a line, with nothing left of their share for a long time."""
    probing = a_line(*devices)
    probing.account.spend(100.0, 0.0)
    return probing


def test_the_share_binds_while_any_device_answers() -> None:
    account = exhausted().account
    assert not account.allows(10.0)
    assert account.ready_at(10.0) == pytest.approx((100.0 - PROBE_CREDIT) / PROBE_SHARE)


def test_while_none_answers_the_share_binds_nobody_and_costs_nothing() -> None:
    dead = a_device(1, dead_since=0.0)
    probing = Probing(0.0)
    probing.review([dead], 0.0)
    probing.account.spend(100.0, 0.0)
    probing.spend(dead, 100.0, 0.0)
    assert probing.account.allows(0.0)
    assert probing.account.ready_at(7.0) == 7.0
    probing.review([dead, a_device(255)], 0.0)
    assert probing.account.allows(0.0)


def test_what_an_exempt_probe_takes_is_not_charged() -> None:
    dead = a_device(1, dead_since=0.0)
    probing = a_line(dead)
    dead.probe_exempt = True
    probing.spend(dead, 100.0, 0.0)
    assert probing.account.allows(0.0)
    dead.probe_exempt = False
    probing.spend(dead, 100.0, 0.0)
    assert not probing.account.allows(0.0)


def test_an_exhausted_share_holds_up_neither_an_exempt_probe_nor_those_of_a_line_where_none_answers() -> None:
    dead = a_device(1, dead_since=0.0)
    probing = exhausted(dead)
    probing.plan(0.0)
    assert probing.next_at > 1000.0
    dead.probe_exempt = True
    probing.plan(0.0)
    assert probing.next_at == dead.next_probe
    dead.probe_exempt = False
    dead.last_asked = 4.0
    probing.review([dead], 4.0)
    assert probing.next_at == pytest.approx(5.0)
    assert probing.account.allows(4.0)
    assert probing.account.ready_at(4.0) == 4.0
