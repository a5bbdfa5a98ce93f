"""Twelve devices of six kinds on one RTU line, and all-ASCII lines of 7E1 and 8N1, from outside."""

from __future__ import annotations

import json
from typing import Any

import pytest

from lfs10d.simulator.wire import Check, unseal
from tests.support.recordings import ASCII, AT_ONCE, ILL, RTU, WELL_SAMPLES, Recording
from tests.support.sites import good

CHECKS: tuple[Check, ...] = ("crc", "sum")

pytestmark = [pytest.mark.needs("mosquitto"), pytest.mark.long(25)]


def test_every_device_has_its_topics_and_is_online(recording: Recording) -> None:
    listed = recording.view.newest("devices")
    assert [(one["name"], one["id"]) for one in listed] == [(unit.name, unit.slave) for unit in recording.units]
    for unit in recording.units:
        profile = recording.profile(unit)
        config = recording.view.newest(f"device/{unit.name}/config")
        assert (config["slave"], config["profile"]) == (unit.slave, profile.name)
        assert recording.view.newest(f"device/{unit.name}/availability") == "online"
        assert recording.view.newest(f"device/{unit.name}/state")["quality"] == "good"


def test_samples_are_flat_with_the_profiles_names_and_units(recording: Recording) -> None:
    for unit in recording.units:
        profile = recording.profile(unit)
        for sample in recording.well[unit.name]:
            assert set(profile.value_names) <= set(sample)
            if len(profile.values) == 1:
                assert sample["unit"] == profile.values[0].unit
                assert "units" not in sample
            else:
                assert sample["units"] == profile.units
                assert "unit" not in sample


def test_every_value_is_the_one_that_the_device_meant(recording: Recording) -> None:
    for unit in recording.units:
        samples = [sample for sample in recording.well[unit.name] if good(sample)]
        assert len(samples) >= WELL_SAMPLES
        for meant in recording.meant(unit):
            answers = iter(meant)  # in order: what was passed over is not found again
            for sample in samples:
                assert any(said == {name: sample[name] for name in said} for said in answers)


def test_values_differ_from_poll_to_poll_and_from_device_to_device(recording: Recording) -> None:
    """Else the test before would prove nothing."""
    first = {unit: recording.profile(unit).value_names[0] for unit in recording.units}
    seen = [sample[name] for unit, name in first.items() for sample in recording.well[unit.name] if good(sample)]
    assert len(set(seen)) > len(seen) / 4  # whole numbers of 0 to 100 repeat


def test_every_byte_on_the_line_belongs_to_a_whole_request(recording: Recording) -> None:
    """The simulator may be late, and take two requests for one; that every frame is whole does not depend on it."""
    assert recording.served.line.judge.counts["torn"] == 0
    for request in recording.served.line.log:
        end = b"\r\n" if recording.framing == "ascii" else None
        frames = request.frame.split(end)[:-1] if end else [*chunks(request.frame, 8)]
        for frame in frames:
            checks = [unseal(frame + (end or b""), recording.framing, check) for check in CHECKS]
            assert any(body is not None for body in checks), frame.hex(" ")


def chunks(data: bytes, size: int) -> list[bytes]:
    return [data[place : place + size] for place in range(0, len(data), size)]


def test_no_error_is_raised_of_a_device_that_is_well(recording: Recording) -> None:
    for unit in recording.units:
        if unit.name not in ILL:
            assert not any(error["active"] for error in recording.view.history_of(f"device/{unit.name}/error"))


def test_no_read_is_longer_than_its_device_answers(recording: Recording) -> None:
    longest: dict[str, int] = {}
    for unit, body, _ in recording.log:
        if body[1] in (3, 4):
            count = int.from_bytes(body[4:6], "big")
            longest[unit.name] = max(count, longest.get(unit.name, 0))
            blueprint = recording.served.line.sensor(unit.slave).blueprint
            assert count <= blueprint.most_words(recording.framing)
    assert longest["pump"] == (5 if recording.framing == "rtu" else 4)
    assert longest["tank"] == 4  # of six neighbours: 10 data bytes in ASCII are the byte count and 4 registers


def test_every_device_is_asked_with_its_own_check(rtu: Recording) -> None:
    asked = {unit.name for unit, _, request in rtu.log if request.answers}
    assert asked == {unit.name for unit in RTU}


def test_a_refusal_is_an_error_of_a_device_that_is_online(recording: Recording) -> None:
    errors = [error for error in recording.view.history_of("device/laser-a/error") if error["active"]]
    assert [(error["code"], error["exception_code"], error["count"]) for error in errors] == [("exception", 2, 3)]
    bad = [one for one in recording.view.samples("laser-a") if one["error"] not in (None, "timeout")]
    assert {(one["error"], one["displacement"], one["rtt_ms"]) for one in bad} == {("exception", None, None)}
    assert "offline" not in recording.view.history_of("device/laser-a/availability")[1:]


def test_silence_makes_a_device_offline_and_every_value_null(recording: Recording) -> None:
    assert recording.view.newest("device/pump/error")["last_code"] == "timeout"
    bad = [one for one in recording.view.samples("pump") if not good(one)]
    names = recording.profile(recording.unit("pump")).value_names
    assert bad
    assert all(one[name] is None for one in bad for name in names)


def test_a_busy_inverter_is_no_error(rtu: Recording) -> None:
    bad = [one for one in rtu.view.samples("belt") if one["error"] not in (None, "timeout")]
    assert {one["error"] for one in bad} == {"exception"}
    assert not any(error["active"] for error in rtu.view.history_of("device/belt/error"))
    assert "offline" not in rtu.view.history_of("device/belt/availability")[1:]


def test_watch_shows_every_device_with_its_values(recording: Recording) -> None:
    lines = [one for one in recording.watched if "device" in one]
    assert all(one["values"] or one["error"] for one in lines)
    newest = {one["device"]: one for one in lines if one["values"]}
    for unit in recording.units:
        profile = recording.profile(unit)
        assert tuple(newest[unit.name]["values"]) == profile.value_names
        assert newest[unit.name]["units"] == profile.units


# -- registers


def answers(recording: Recording) -> list[tuple[str, str | None]]:
    return [(one["status"], one["error"] and one["error"]["code"]) for one in recording.responses.values()]


def test_registers_are_read_and_written_within_what_the_profiles_permit(rtu: Recording) -> None:
    assert answers(rtu) == [
        ("ok", None),
        ("rejected", "invalid_param"),
        ("ok", None),
        ("ok", None),
        ("failed", "refused"),
        ("failed", "timeout"),
        ("ok", None),
        ("ok", None),
        ("rejected", "invalid_param"),
        *[("rejected", "not_allowed")] * 4,
    ]
    assert rtu.responses["r3"]["data"] == {"device": "mast-top", "slave": 2, "address": 5, "registers": [2]}
    assert rtu.responses["r4"]["error"]["exception_code"] == 2
    assert rtu.responses["r7"]["data"] == {"device": "tank", "slave": 41, "address": 768, "value": 42, "before": 0}


def test_registers_are_read_and_written_in_ascii_too(recordings: Any) -> None:  # noqa: ANN401  # a fixture's function
    seen = recordings("ascii-7E1")
    assert answers(seen) == [("ok", None), ("ok", None), ("ok", None), ("rejected", "not_allowed")]


def test_writes_to_one_slave_at_the_same_time_are_each_read_back_before_the_next(recording: Recording) -> None:
    assert [(one["status"], one["data"]["value"], one["data"]["before"]) for one in recording.at_once.values()] == [
        ("ok", 11, 42 if recording.framing == "rtu" else 7),
        ("ok", 12, 11),
        ("ok", 13, 12),
    ]
    assert recording.served.line.sensor(41).words[0x0300] == 13


def _word(value: int) -> bytes:
    return value.to_bytes(2, "big")


def test_nothing_was_ever_written_but_what_was_asked_and_permitted(recording: Recording) -> None:
    written = [(unit.name, body[1:]) for unit, body, _ in recording.log if body[1] not in (3, 4)]
    if recording.framing == "rtu":
        permitted = [("laser-a", bytes.fromhex("06 1000 0001")), ("tank", bytes.fromhex("06 0300 002A"))]
    else:
        permitted = [("laser-b", bytes.fromhex("06 1000 0001")), ("tank", bytes.fromhex("06 0300 0007"))]
    assert written == [*permitted, *(("tank", bytes.fromhex("06 0300") + _word(value)) for value in AT_ONCE)]
    assert all(unit.slave != 0 for unit, _, _ in recording.log)


# -- the verbs, at the port that is free again


@pytest.mark.parametrize("unit", [RTU[0], RTU[3], RTU[5], RTU[7], RTU[8], RTU[10], RTU[11]], ids=lambda unit: unit.name)
def test_one_device_is_read_by_its_profile(rtu: Recording, unit: Any) -> None:  # noqa: ANN401 - plain data of any shape
    check = ["--checksum", unit.check] if unit.check != "crc" else []
    done = rtu.lfs10d(
        "read", str(rtu.site.tty), str(unit.slave), "--profile", unit.profile, "--baudrate", "19200", "--json", *check
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    profile = rtu.profile(unit)
    assert said["profile"] == profile.name
    request = rtu.served.line.log[-1]
    last = {name: said[name] for name in (value.name for value in profile.reads()[-1].values)}
    assert set(last.values()) == set(request.answers[0].values)


def test_one_device_is_read_in_ascii(recordings: Any) -> None:  # noqa: ANN401 - plain data of any shape
    seen: Recording = recordings("ascii-7E1")
    done = seen.lfs10d(
        "read", str(seen.site.tty), "20", "--profile", "fuling-dzb", "--baudrate", "19200", "--json", *seen.line_options
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["units"]["output_current"] == "A"


def test_a_scan_names_what_it_recognises(rtu: Recording) -> None:
    own = [argument for unit in RTU[10:] for argument in ("--profile", unit.profile)]
    assert recognised(rtu, "1-3,10,11,20,21,30-32,40,41,255", *own) == {
        unit.slave: rtu.profile(unit).name for unit in RTU if unit.check == "crc"
    }


def test_a_scan_with_the_other_check_finds_those_that_are_set_to_it(rtu: Recording) -> None:
    assert recognised(rtu, "2,30-33", "--checksum", "sum") == {31: "eh600", 32: "eh600"}


@pytest.mark.parametrize("name", ["ascii-7E1", "ascii-8N1"])
def test_a_scan_in_ascii_names_what_it_recognises(recordings: Any, name: str) -> None:  # noqa: ANN401 - plain data of any shape
    seen: Recording = recordings(name)
    found = recognised(seen, "9-11,20,21,41", "--profile", "profiles/tank.yaml", *seen.line_options)
    assert found == {unit.slave: seen.profile(unit).name for unit in ASCII}


def recognised(recording: Recording, ids: str, *options: str) -> dict[int, str]:
    """Return what a scan of these ids calls those it finds."""
    done = recording.lfs10d("scan", str(recording.site.tty), "--ids", ids, "--baudrate", "19200", "--json", *options)
    assert done.returncode == 0, done.stderr
    return {one["id"]: one["profile"] for one in json.loads(done.stdout)["found"]}
