"""Several profiles that fit one device: which is named, which are told, and what a device says of itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from lfs10d.line.jobs.identification import by_evidence
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.profile import Profile
from tests.support.identifications import BUILTIN, LFS10, PROFILES, identify, outcome, registers

WN90LP, PR_3000 = BUILTIN["ecowitt-wn90lp"], BUILTIN["pr-3000-fsjt"]


def renke(*values: int, slave: int = 3, rate: int = 2) -> Callable[[ReadRegisters], Outcome]:
    """Return a device of the Renke family, with these contents from register 0 on."""
    return registers({0x07D0: slave, 0x07D1: rate} | dict(enumerate(values)))


def dfrobot(*values: int, slave: int = 3) -> Callable[[ReadRegisters], Outcome]:
    return registers({0x1000: slave} | dict(enumerate(values)))


def named(device: Callable[[ReadRegisters], Outcome], **more: Any) -> list[str]:  # noqa: ANN401 - passed on
    """Return the profile of a device and its alternatives by name; [] where it is unknown."""
    finding, _ = identify(device, **more)
    assert finding is not None
    return [profile.name for profile in (finding.profile, *finding.alternatives) if profile is not None]


@pytest.mark.parametrize(
    ("device", "names"),
    [
        (renke(3, 135), ["renke-rs-fxjt", "renke-rs-fsjt"]),
        (renke(3, 10), ["renke-rs-fxjt", "renke-rs-fsjt", "pr-3000-fsjt"]),
        (renke(87, 5), ["pr-3000-fsjt", "renke-rs-fsjt"]),
        (renke(87), ["renke-rs-fsjt", "pr-3000-fsjt"]),
        (renke(87, 5, rate=7), []),
        (dfrobot(655, 3), ["dfrobot-sen0482"]),
        (dfrobot(37, 3), ["dfrobot-sen0482", "dfrobot-sen0483"]),
        (dfrobot(37), ["dfrobot-sen0483"]),
        (dfrobot(655), []),
    ],
)
def test_of_profiles_with_one_register_of_the_id_the_one_that_explains_more_is_named_and_the_others_told(
    device: Callable[[ReadRegisters], Outcome], names: list[str]
) -> None:
    assert named(device) == names


STATION = dict(enumerate([1, 10, 600, 40, 37, 50, 210, 0, 10130, 18], 0x0165)) | {0x0161: 2, 0x0162: 3}
"""Registers of a WN90LP at slave id 3 and 9600 baud, without the one that identifies it."""
PLAIN = WN90LP.model_copy(update={"name": "plain", "identify": ()})
"""The same registers without any that would identify it."""


def test_a_device_that_identifies_itself_is_no_other() -> None:
    device = registers(STATION | {0x0160: 0x0090})
    assert named(device, profiles=[PLAIN, WN90LP]) == ["plain", "ecowitt-wn90lp"], "a person's own goes first"
    assert named(device, profiles=[WN90LP, PLAIN]) == ["ecowitt-wn90lp"]
    _, asked = identify(device, profiles=[WN90LP, PLAIN, *PROFILES])
    assert [(read.address, read.count) for read in asked] == [(0x0162, 1), (0x0160, 1), (0x0165, 10), (0x0161, 1)]


@pytest.mark.parametrize("identity", [{0x0160: 0x0091}, {}])
def test_a_device_whose_identifying_register_holds_something_else_or_is_absent_is_another(
    identity: dict[int, int],
) -> None:
    assert named(registers(STATION | identity)) == []
    assert named(registers(STATION | identity), profiles=[WN90LP, PLAIN]) == ["plain"]


def test_a_device_that_is_silent_at_its_identifying_register_is_another() -> None:
    def device(request: ReadRegisters) -> Outcome:
        return outcome(request) if request.address == 0x0160 else registers(STATION)(request)

    assert named(device) == []


@pytest.mark.parametrize(("second", "names"), [(7, ["two"]), (8, ["two"]), (9, []), (None, [])])
def test_every_identifying_register_must_hold_one_of_its_contents(second: int | None, names: list[str]) -> None:
    both = [{"register": 0x0160, "holds": [0x0090]}, {"register": 0x0200, "function": 4, "holds": [7, 8]}]
    value = {"name": "level", "register": 0, "type": "uint16", "unit": "m"}
    two = Profile.model_validate({"name": "two", "title": "Two", "identify": both, "values": [value]})
    inputs = registers({} if second is None else {0x0200: second})

    def device(request: ReadRegisters) -> Outcome:
        return inputs(request) if request.function == 4 else registers({0: 5, 0x0160: 0x0090})(request)

    assert named(device, profiles=[two]) == names


def test_a_device_without_an_optional_register_is_recognised_by_the_others() -> None:
    """A WN90LP from before July 2023 has no rain counter."""
    device = registers({address: word for address, word in STATION.items() if address != 0x016E} | {0x0160: 0x0090})
    finding, _ = identify(device)
    assert finding is not None
    assert finding.profile is WN90LP
    assert set(finding.values) == set(WN90LP.value_names) - {"rain_counter"}


def test_a_device_that_lacks_all_its_values_is_unknown() -> None:
    only = {"name": "rain", "register": 1, "type": "uint16", "unit": "mm", "optional": True}
    profile = Profile.model_validate({"name": "p", "title": "P", "values": [only]})
    assert named(registers({}), profiles=[profile]) == []


def test_a_persons_own_profile_goes_before_those_that_are_included() -> None:
    value = {"name": "level", "register": 0, "type": "uint16", "unit": "m"}
    bare = Profile.model_validate({"name": "bare", "title": "Bare", "values": [value]})
    assert named(renke(87, 5), profiles=[bare, PR_3000]) == ["bare", "pr-3000-fsjt"]
    assert named(renke(87, 5), profiles=[PR_3000, bare]) == ["pr-3000-fsjt"], "what can be sure is not asked further"
    assert named(renke(87, 5, slave=9), profiles=[bare, PR_3000]) == ["bare", "pr-3000-fsjt"]
    assert named(registers({0: 87}), profiles=[bare, PR_3000]) == ["bare"]


def test_profiles_whose_values_alone_speak_for_them_are_tried_last() -> None:
    assert [profile.name for profile in by_evidence(BUILTIN.values())][-3:] == ["ld-e", "fuling-dzb", "eh600"]
    assert by_evidence(BUILTIN.values())[0] is LFS10


def test_a_device_is_recognised_by_its_first_value_wherever_that_is_read() -> None:
    heater = {"name": "heater", "register": 3, "function": 1}
    speed = {"name": "wind_speed", "register": 500, "type": "uint16", "unit": "m/s"}
    profile = Profile.model_validate({"name": "p", "title": "P", "values": [speed, heater]})
    finding, asked = identify(registers({500: 7}), profiles=[profile])
    assert finding is not None
    assert (finding.profile, dict(finding.values)) == (profile, {"wind_speed": 7})
    assert asked == [ReadRegisters(3, 500, 1)]


SPARE = [
    {"name": "speed", "register": 1, "type": "uint16", "unit": "m", "optional": True, "range": [0, 60]},
    {"name": "gust", "register": 2, "type": "uint16", "unit": "m", "optional": True},
    {"name": "battery", "register": 9, "type": "uint16", "unit": "V"},
]


@pytest.mark.parametrize(
    ("content", "values"),
    [
        ({1: 7, 9: 12}, {"speed": 7}),
        ({2: 8, 9: 12}, {"gust": 8}),
        ({9: 12}, {"battery": 12}),
        ({1: 61, 9: 12}, None),
        ({}, None),
    ],
)
def test_of_values_that_are_all_optional_one_is_enough(content: dict[int, int], values: dict[str, int] | None) -> None:
    profile = Profile.model_validate({"name": "spare", "title": "S", "values": SPARE, "slave_id": {"register": 5}})
    found, _ = identify(registers({5: 3} | content), profiles=(profile,))
    assert found is not None
    assert (found.profile, found.values) == ((profile, values) if values else (None, {}))


def test_values_alone_speak_for_a_profile_by_the_first_read_only() -> None:
    """Anything may be in the others."""
    profile = Profile.model_validate({"name": "spare", "title": "S", "values": SPARE})
    found, asked = identify(registers({9: 12}), profiles=(profile,))
    assert found is not None
    assert (found.profile, [each.address for each in asked]) == (None, [1, 1, 2])


def test_a_first_value_that_is_unavailable_leaves_it_to_the_others() -> None:
    values = [SPARE[0] | {"unavailable": [0xFFFF], "optional": False}, SPARE[2]]
    profile = Profile.model_validate({"name": "spare", "title": "S", "values": values, "slave_id": {"register": 5}})
    for content, wanted in (({1: 0xFFFF, 9: 12}, profile), ({1: 0xFFFF}, None)):
        found, _ = identify(registers({5: 3} | content), profiles=(profile,))
        assert found is not None
        assert found.profile is wanted
