"""Profiles of no particular device: values of every type, part, content and place."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from lfs10d.profiles.profile import Profile

WIDTHS = {"int16": 1, "uint16": 1, "int32": 2, "uint32": 2, "int64": 4, "uint64": 4, "float32": 2, "float64": 4}


@st.composite
def a_value(draw: st.DrawFn, number: int, register: int) -> tuple[dict[str, Any], int]:
    """Return the keys of a value at a register, and how many registers it fills."""
    value: dict[str, Any] = {"name": f"x{number}", "register": register, "optional": draw(st.booleans())}
    if draw(st.integers(0, 3)) == 0:
        value["interval"] = draw(st.sampled_from(["2s", "3s"]))
    kind = draw(st.sampled_from([*WIDTHS, "bcd", "string", "bool", "map"]))
    if kind == "bool":
        if draw(st.booleans()):
            value["map"] = {0: "shut", 1: "open"}
        return value | {"function": draw(st.sampled_from([1, 2]))}, 1
    value["function"] = draw(st.sampled_from([3, 4]))
    value["byte_order"] = draw(st.sampled_from(["big", "little"]))
    if kind == "string":
        return value | {"type": kind, "length": (length := draw(st.integers(1, 4)))}, length
    if kind == "map":
        return value | {"type": "uint16", "map": {0: "dry", 1: "rain", 7: "snow"}} | draw(a_part(1, least=3)), 1
    words = WIDTHS.get(kind) or draw(st.integers(1, 3))
    value |= {"type": kind, "unit": "x"}
    if kind == "bcd":
        value["length"] = words
    if words > 1:
        value["word_order"] = draw(st.sampled_from(["high_first", "low_first"]))
    value["scale"] = draw(st.sampled_from([1.0, 0.1] if kind.startswith("float") else [1.0, 0.1, 0.01]))
    part = draw(a_part(words)) if kind in WIDTHS and not kind.startswith("float") else {}
    value |= part
    keys: list[dict[str, Any]] = [{}, {"modulo": 360}, {"modulo": 7.5}]
    keys += [] if part else [{"range": [0, 60]}]
    keys += [] if kind == "bcd" or kind.startswith("float") else [{"offset": -40}, {"offset": 0.5}]
    value |= draw(st.sampled_from(keys))
    if kind != "bcd" and draw(st.booleans()):
        value["unavailable"] = [-1 if kind.startswith("int") else (1 << 16 * words) - 1]
    return value, words


@st.composite
def a_part(draw: st.DrawFn, words: int, least: int = 8) -> dict[str, Any]:
    """Return the keys that say which part of a content is meant, of so many bits at least; none for all."""
    first = draw(st.integers(0, 16 * words - least))
    last = draw(st.integers(first + least - 1, 16 * words - 1))
    parts: list[dict[str, Any]] = [{}, {"bits": [first, last]}, {"mask": (1 << last - first + 1) - 1 << first}]
    return draw(st.sampled_from([*parts, *([{"byte": "high"}, {"byte": "low"}] if words == 1 else [])]))


@st.composite
def halves(draw: st.DrawFn, number: int, register: int) -> list[dict[str, Any]]:
    """Return the keys of two values that are the bytes of one register: what it lacks, both lack."""
    shared: dict[str, Any] = {"type": "uint16", "function": 3, "register": register, "unit": "x"}
    shared |= {"optional": draw(st.booleans()), "byte_order": draw(st.sampled_from(["big", "little"]))}
    if draw(st.booleans()):
        shared["unavailable"] = [draw(st.sampled_from([0xFFFF, 0xFF, 0x7FFF]))]
    if draw(st.booleans()):
        shared["interval"] = "3s"
    order = draw(st.permutations(["high", "low"]))
    return [shared | {"name": f"x{number + n}", "byte": byte} for n, byte in enumerate(order)]


SETTINGS = 0xF000
"""The registers of what a profile sets are from here on, beyond every value."""


@st.composite
def what_is_set(draw: st.DrawFn) -> dict[str, Any]:
    """Return the keys of a profile whose devices have a slave id, a rate and a setting that can be written."""
    codes = draw(st.permutations([1, 2, 96, 192]))[:2]
    keys: dict[str, Any] = {
        "slave_id": {"register": SETTINGS},
        "baudrate": {"register": SETTINGS + 1, "codes": dict(zip([9600, 19200], codes, strict=True))},
        "settings": [{"name": "average", "register": SETTINGS + 2, "range": [1, 60], "writable": True}],
        "write_function": draw(st.sampled_from([6, 16])),
        "factory": {"id": 1, "baudrate": draw(st.sampled_from([4800, 9600]))},
    }
    if draw(st.booleans()):
        holds = draw(st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=2))
        keys["identify"] = [{"register": SETTINGS + 9, "function": draw(st.sampled_from([3, 4])), "holds": holds}]
    return keys


@st.composite
def a_profile(draw: st.DrawFn, settable: bool = False) -> Profile:  # noqa: FBT001, FBT002 - drawn by hypothesis
    values: list[dict[str, Any]] = []
    register = draw(st.integers(0, 0x8000))
    for _ in range(draw(st.integers(1, 6))):
        if draw(st.integers(0, 4)) == 0:
            values += draw(halves(len(values), register))
            register += 1
        else:
            value, words = draw(a_value(len(values), register))
            values.append(value)
            register += words
        register += draw(st.sampled_from([0, 0, 1, 3]))
    keys = {"may_skip": draw(st.sampled_from([0, 0, 2, 9])), "max_words": draw(st.sampled_from([125, 4, 8]))}
    keys |= draw(what_is_set()) if settable else {}
    return Profile.model_validate(
        {"name": "any", "title": "Any device", "values": draw(st.permutations(values)), **keys}
    )


@st.composite
def certificates(draw: st.DrawFn, profile: Profile) -> dict[str, tuple[float, float]]:
    """Return a calibration of some numbers: scale and offset by name."""
    numbers = [each for each in profile.values if not each.is_text and each.range is None]
    made = {}
    for value in numbers:
        if draw(st.integers(0, 2)) == 0:
            scale = 1.0 if value.modulo is not None else draw(st.sampled_from([1.0137, 0.5, 2]))
            made[value.name] = (scale, draw(st.sampled_from([0.061, -3, 0])))
    return made
