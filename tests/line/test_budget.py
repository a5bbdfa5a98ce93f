"""The line's time budget."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from lfs10d.config.defaults import resolved
from lfs10d.config.models import Config, SlaveConfig
from lfs10d.line.budget import Budget, budget, request_gap
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile

VALUES = [
    {"name": name, "register": register, "type": "uint16", "unit": "1"} for name, register in (("a", 1), ("b", 0x900))
]
TWO_READS = Profile.model_validate(
    {"name": "two", "title": "Two", "framings": ["rtu", "ascii"], "checksums": ["crc", "sum"], "values": VALUES}
)
SLOW = Profile.model_validate({"name": "slow", "title": "Slow", "values": [VALUES[0], VALUES[1] | {"interval": "1m"}]})
PROFILES = {"slow": SLOW, "lfs10": load_profile("lfs10", relative_to=Path()), "two": TWO_READS}


def of(slaves: Sequence[object], **line: Any) -> Budget:  # noqa: ANN401  # any key of the line
    config = Config.model_validate({"line": {"port": "/dev/x", **line}, "slaves": list(slaves)})
    return budget(resolved(config, stem="lfs10d", host="gateway"), PROFILES)


@pytest.mark.parametrize(
    ("line", "wire"),
    [
        ({}, 25.0e-3),  # the times of the LFS10 as computed from the Modbus rules by hand
        ({"baudrate": 19200}, 12.5e-3),
        ({"baudrate": 115200}, 4.976e-3),
        ({"extra_gap": "1ms"}, 27.0e-3),
        ({"parity": "even"}, 27.5e-3),
    ],
)
def test_a_poll_of_an_lfs10_takes_its_bits_and_two_silences(line: dict[str, Any], wire: float) -> None:
    (share,) = of([2], **line).shares
    assert share.wire == pytest.approx(wire, rel=1e-3)
    assert share.exchanges == 1


def test_a_device_of_two_reads_takes_two_exchanges() -> None:
    (share,) = of([{"id": 2, "profile": "two", "checksum": "sum", "response_timeout": "100ms"}]).shares
    assert share.exchanges == 2
    characters = 2 * (8 + 7 + 2 * 3.5)
    assert share.wire == pytest.approx(characters * 10 / 9600)
    assert share.slowest == pytest.approx(share.wire + 0.2)


def test_ascii_frames_take_two_characters_a_byte() -> None:
    (share,) = of([{"id": 2, "profile": "two"}], framing="ascii", databits=7, parity="even").shares
    assert share.wire == pytest.approx(2 * (17 + 15 + 2 * 3.5) * 10 / 9600)


def test_the_load_is_what_intervals_ask_for_and_interval_0_takes_the_rest() -> None:
    found = of([2, {"id": 3, "interval": "250ms"}, {"id": 4, "interval": 0}])
    assert [share.load for share in found.shares] == [pytest.approx(0.025), pytest.approx(0.1), None]
    assert found.load == pytest.approx(0.125)
    assert found.load_with_turnaround == pytest.approx(0.15)
    assert found.shortest_cycle == pytest.approx(0.075)
    assert found.slowest_cycle == pytest.approx(3.075)
    assert found.gap == pytest.approx(3645.8e-6, rel=1e-4)


def test_the_rest_of_a_device_counts_in_its_own_load_and_others_are_polled_meanwhile() -> None:
    tired = {"id": 3, "interval": "500ms", "request_gap": "100ms"}
    found = of([2, tired])
    rest = 0.1 - found.gap
    assert found.shares[1].rest == pytest.approx(rest)
    assert found.shares[1].load == pytest.approx((0.025 + rest) / 0.5)
    assert found.load == pytest.approx((0.025 + rest) / 0.5)
    assert found.load_with_turnaround == pytest.approx((0.030 + rest) / 0.5)
    assert [found.wire_load, found.wire_load_with_turnaround] == pytest.approx([0.075, 0.09])
    assert found.shortest_cycle == pytest.approx(0.025 + rest)
    assert found.slowest_cycle == pytest.approx(2.05)
    many = of([{"id": slave, "interval": "500ms", "request_gap": "100ms"} for slave in range(1, 11)])
    assert many.load == pytest.approx(0.5)


def test_a_rest_is_taken_before_each_read_of_a_poll() -> None:
    (share,) = of([{"id": 3, "profile": "two", "request_gap": "100ms"}]).shares
    assert share.rest == pytest.approx(2 * (0.1 - 3645.8e-6))
    (share,) = of([{"id": 3, "request_gap": "1ms"}]).shares  # less than the line's own silence
    assert share.rest == 0


ONE_READ = (8 + 7 + 2 * 3.5) * 10 / 9600
"""Seconds of the wire for a read of one register."""


def test_a_slow_value_counts_as_often_as_it_is_asked() -> None:
    (share,) = of([{"id": 2, "profile": "slow"}]).shares
    assert share.exchanges == 1
    assert [share.wire, share.longest_wire] == pytest.approx([ONE_READ, 2 * ONE_READ])
    assert share.load == share.wire_load == pytest.approx(ONE_READ * (1 + 1 / 60))
    assert share.load_with_turnaround == pytest.approx((ONE_READ + 0.005) * (1 + 1 / 60))
    assert share.slowest == pytest.approx(2 * (ONE_READ + 1))


def test_a_slow_value_is_asked_in_whole_polls_and_in_each_where_it_is_not_slower() -> None:
    (share,) = of([{"id": 2, "profile": "slow", "interval": "40s"}]).shares
    assert share.load == pytest.approx(ONE_READ * (1 + 1 / 2) / 40)
    (share,) = of([{"id": 2, "profile": "slow", "interval": "1m"}]).shares
    assert share.exchanges == 2
    assert share.load == pytest.approx(2 * ONE_READ / 60)
    (share,) = of([{"id": 2, "profile": "slow", "interval": 0}]).shares
    assert (share.exchanges, share.load, share.wire_load) == (1, None, None)


def test_the_rest_before_a_slow_value_counts_as_often_too() -> None:
    found = of([{"id": 2, "profile": "slow", "request_gap": "500ms", "response_timeout": "100ms"}])
    (share,) = found.shares
    rest = 0.5 - found.gap
    assert [share.rest, share.longest_rest] == pytest.approx([rest, 2 * rest])
    assert share.load == found.load == pytest.approx((ONE_READ + rest) * (1 + 1 / 60))
    assert found.wire_load == pytest.approx(ONE_READ * (1 + 1 / 60))
    assert found.slowest_cycle == pytest.approx(2 * (ONE_READ + 0.1 + rest))
    assert found.shortest_cycle == pytest.approx(ONE_READ + rest)


@pytest.mark.parametrize(("of_slave", "of_profile", "kept"), [(0, 0.3, 0.3), (0.2, 0.3, 0.3), (0.4, 0.3, 0.4)])
def test_the_longer_rest_of_slave_and_profile_is_kept(of_slave: float, of_profile: float, kept: float) -> None:
    profile = TWO_READS.model_copy(update={"request_gap": of_profile})
    assert request_gap(SlaveConfig(id=3, request_gap=of_slave), profile) == kept


def test_a_disabled_device_takes_nothing() -> None:
    found = of([{"id": 2, "enabled": False}])
    assert found.shares == ()
    assert found.load == found.load_with_turnaround == found.shortest_cycle == found.slowest_cycle == 0
