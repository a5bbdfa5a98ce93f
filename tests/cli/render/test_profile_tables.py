"""A profile in tables: whatever its file says is there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lfs10d.cli.render.profile_tables import explain
from lfs10d.profiles.library import builtin_names, load_profile, parse_profile
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.values import Value

EVERYTHING = """\
name: everything
title: A mast
manufacturer: ACME
model: E-1
sources: [the manual]
ids: [3, 99]
broadcast: true
framings: [rtu, ascii]
checksums: [crc, sum]
max_words: 20
ascii_max_data: 16
min_interval: 2s
request_gap: 250ms
may_skip: 4
write_function: 16
busy_exceptions: [6, 99]
factory: {id: 7, baudrate: 4800, source: the box}
slave_id: {register: 0x0100, locked_by: DIP switch, unverified: true}
baudrate: {register: 0x0101, codes: {4800: 1, 9600: 2}, locked_by: jumper, notes: at power-up}
identify:
  - {register: 0x0160, function: 4, holds: [0x90, 0x91], source: section 1}
values:
  - {name: wind_direction, register: 0, type: uint16, scale: 0.1, offset: -5, unit: "°", modulo: 360,
     unavailable: [0xFFFF, 0x8000], range: [0, 360], precision: 1, device_class: wind_direction, source: section 2}
  - {name: rain, register: 3, type: uint16, bits: [4, 5], map: {0: dry, 1: rain}, optional: true}
  - {name: flags, register: 3, type: uint16, mask: 0x0F00, unit: "1", unverified: true}
  - {name: low, register: 3, type: uint16, byte: low, unit: "1", precision: 0}
  - {name: ice, register: 3, type: uint16, bits: [7, 7], map: {0: none, 1: ice}}
  - {name: heater, register: 8, function: 1}
  - {name: door, register: 9, function: 2, map: {0: shut, 1: open}}
  - {name: serial, register: 30, type: string, length: 4, byte_order: little, interval: 5m}
  - {name: total, register: 40, type: bcd, length: 2, word_order: low_first, unit: mm}
  - {name: heat, register: 50, type: float32, word_order: high_first, unit: "°C", unavailable: [-9999.0, 0x7FC00000]}
  - {name: dew, register: 60, type: int16, unit: "°C", unavailable: [-32768], notes: computed}
settings:
  - {name: mode, register: 0x0200, values: {0: "off", 1: "on"}, writable: true}
  - {name: average, register: 0x0201, scale: 0.1, unit: s, range: [1, 60], notes: of the wind}
barrier: {register: 0x0180, function: 4, count: 5}
run_commands: [0x0900]
provenance: {ids: section 3}
notes: [Mount it upright.]
"""


def rows(profile: Profile, title: str) -> list[tuple[str, ...]]:
    """Return the rows of the table whose title begins so."""
    return [row for table in explain(profile) if table.title.startswith(title) for row in table.rows]


@pytest.fixture(name="everything")
def _everything() -> Profile:
    return parse_profile(EVERYTHING, "everything.yaml")


def test_what_the_device_is_and_how_it_is_talked_to(everything: Profile) -> None:
    assert rows(everything, "A mast (profile everything)") == [
        ("manufacturer", "ACME"),
        ("model", "E-1"),
        ("slave ids", "3 to 99; 7 from the factory"),
        ("", "set in register 0x0100, unless the DIP switch overrules it"),
        ("baud rates", "4800, 9600; 4800 from the factory"),
        ("", "set in register 0x0101 (1 for 4800, 2 for 9600), unless the jumper overrules it"),
        ("recognised by", "input 0x0160 holding 0x0090 or 0x0091"),
        ("framings", "rtu, ascii"),
        ("check (rtu)", "crc, or sum by a slave's key checksum"),
        (
            "one read",
            "at most 20 registers, 16 data bytes in ascii, and it may span 4 without a name between two values",
        ),
        (
            "one poll",
            (
                "reads coil 0x0008, discrete input 0x0009, 0x0000-0x0003, 0x0028-0x0029, 0x0032-0x0033, 0x003C and "
                "0x001E-0x0021 (every 5m)"
            ),
        ),
        ("after no answer", "input 0x0180-0x0184 is read first (the barrier)"),
        ("writes", "by function 16 (several registers)"),
        ("broadcast", "it obeys writes to slave 0; lfs10d sends none"),
        ("never written", "0x0900: run commands"),
        ("busy", "exception 06 (busy), 63: it is asked again later"),
        ("interval", "at least 2s"),
        ("rest", "250ms between two exchanges"),
    ]


def test_every_value_with_its_part_its_words_and_what_means_no_value(everything: Profile) -> None:
    assert rows(everything, "Values in a sample") == [
        ("wind_direction", "0x0000", "uint16", "x 0.1 -5 °, wraps at 360", "0..360 °", "0xFFFF, 0x8000", ""),
        ("rain", "0x0003", "uint16, bits 4 to 5", "text", "0 = dry, 1 = rain", "", "optional"),
        ("flags", "0x0003", "uint16, mask 0x0F00", "as it is", "any", "", "unverified"),
        ("low", "0x0003", "uint16, low byte", "as it is", "any", "", ""),
        ("ice", "0x0003", "uint16, bit 7", "text", "0 = none, 1 = ice", "", ""),
        ("heater", "coil 0x0008", "bool", "true or false", "any", "", ""),
        ("door", "discrete input 0x0009", "bool", "text", "0 = shut, 1 = open", "", ""),
        ("serial", "0x001E-0x0021", "string of 4 registers, bytes swapped", "text", "any", "", "every 5m"),
        ("total", "0x0028-0x0029", "bcd of 2 registers, low word first", "mm", "any", "", ""),
        ("heat", "0x0032-0x0033", "float32, high word first", "°C", "any", "-9999, 0x7FC00000", ""),
        ("dew", "0x003C", "int16", "°C", "any", "-32768", ""),
    ]


def test_what_displays_are_told(everything: Profile) -> None:
    assert rows(everything, "On displays") == [
        ("wind_direction", "wind_direction", "1 decimal"),
        ("low", "", "0 decimals"),
    ]


def test_settings_and_sources(everything: Profile) -> None:
    assert rows(everything, "Settings of the device") == [
        ("mode", "0x0200", "uint16", "0 = off, 1 = on", "yes", ""),
        ("average", "0x0201", "uint16 x 0.1", "1..60 s", "no", ""),
    ]
    assert rows(everything, "Sources and notes") == [
        ("document", "the manual"),
        ("ids", "section 3"),
        ("factory", "the box"),
        ("slave_id", "unverified on hardware"),
        ("baudrate", "at power-up"),
        ("identify", "section 1"),
        ("wind_direction", "section 2"),
        ("flags", "unverified on hardware"),
        ("dew", "computed"),
        ("average", "of the wind"),
        ("note", "Mount it upright."),
    ]


def test_what_a_profile_does_not_say_is_not_shown() -> None:
    text = "name: a\ntitle: A\nbusy_exceptions: []\nvalues: [{name: x, register: 1, type: uint16, unit: m}]\n"
    profile = parse_profile(text, "a.yaml")
    device, values = explain(profile)
    assert [row[0] for row in device.rows] == [
        "slave ids",
        "baud rates",
        "framings",
        "check (rtu)",
        "one read",
        "one poll",
        "after no answer",
    ]
    assert values.heads == ("name", "registers", "content", "number", "valid", "")
    assert values.rows == (("x", "0x0001", "uint16", "m", "any", ""),)


CHANGED: dict[str, Any] = {
    "manufacturer": "Brand",
    "max_words": 119,
    "min_interval": 3.5,
    "request_gap": 0.75,
    "may_skip": 9,
    "write_function": 16,
    "busy_exceptions": (9,),
    "broadcast": True,
    "notes": ("A note.",),
    "run_commands": (0x7777,),
}


@pytest.mark.parametrize("key", CHANGED)
def test_each_key_of_a_profile_changes_what_is_shown(key: str) -> None:
    profile = load_profile("ecowitt-wn90lp", relative_to=Path())
    assert explain(profile.model_copy(update={key: CHANGED[key]})) != explain(profile)


OTHER_VALUE: dict[str, Any] = {
    "function": 4,
    "type": "int16",
    "byte_order": "little",
    "bits": (0, 9),
    "mask": 0x0FFF,
    "byte": "low",
    "unavailable": (0xFFFE,),
    "optional": True,
    "scale": 0.2,
    "offset": 1.0,
    "modulo": 50.0,
    "unit": "km/h",
    "range": (0.0, 60.0),
    "precision": 3,
    "device_class": "speed",
    "interval": 60.0,
    "source": "elsewhere",
    "unverified": False,
    "notes": "A note.",
    "name": "other",
    "address": 7,
}


@pytest.mark.parametrize("key", OTHER_VALUE)
def test_each_key_of_a_value_changes_what_is_shown(key: str) -> None:
    profile = load_profile("ecowitt-wn90lp", relative_to=Path())
    first, *others = profile.values
    changed = profile.model_copy(update={"values": (first.model_copy(update={key: OTHER_VALUE[key]}), *others)})
    assert explain(changed) != explain(profile)


def test_no_key_of_a_value_is_forgotten_here() -> None:
    elsewhere = {"length", "word_order", "map"}  # in the tables above
    assert OTHER_VALUE.keys() | elsewhere == Value.model_fields.keys()


@pytest.mark.parametrize("name", builtin_names())
def test_every_source_and_note_of_a_shipped_profile_is_shown(name: str) -> None:
    profile = load_profile(name, relative_to=Path())
    shown = "\n".join(cell for table in explain(profile) for row in table.rows for cell in row)
    facts = [*profile.values, *profile.settings, *profile.identify, profile.slave_id, profile.baudrate, profile.barrier]
    said = [text for fact in facts if fact is not None for text in (fact.source, fact.notes) if text]
    assert all(text in shown for text in (*said, *profile.sources, *profile.notes, *profile.provenance.values()))
