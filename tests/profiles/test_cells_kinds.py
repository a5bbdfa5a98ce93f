"""What a profile makes of registers: parts, words, digits, text, booleans, contents that are no value, wrapping."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.profiles.blocks import Block
from lfs10d.profiles.values import Value
from lfs10d.reading import Fault, FaultCode

FLOAT = {"type": "float32", "word_order": "high_first"}


def read(*registers: int, **keys: Any) -> Any:  # noqa: ANN401  # a file's data, and any value
    """Return what a value with these keys becomes; a fault as its code."""
    text = keys.get("type") == "string" or "map" in keys or keys.get("function") in (1, 2)
    plain: dict[str, Any] = {} if text else {"unit": "x"}
    if keys.get("function") not in (1, 2):
        plain["type"] = "uint16"
    value = Value.model_validate({"name": "level", "register": 7} | plain | keys)
    found = value.cell(7).decode(tuple(registers))
    return found.code if isinstance(found, Fault) else found


@pytest.mark.parametrize(
    ("keys", "registers", "wanted"),
    [
        ({"bits": [3, 7]}, (0b1010_1000,), 0b10101),
        ({"bits": [0, 15]}, (0xFFFF,), 0xFFFF),
        ({"mask": 0x0FF0}, (0xABCD,), 0xBC),
        ({"byte": "high"}, (0xABCD,), 0xAB),
        ({"byte": "low"}, (0xABCD,), 0xCD),
        ({"byte": "low", "type": "int16"}, (0x00FE,), -2),
        ({"byte": "low", "scale": 0.5}, (0xFF03,), 1.5),
        ({"bits": [16, 31], "type": "uint32", "word_order": "high_first"}, (0x0007, 0xFFFF), 7),
        ({"bits": [4, 7], "byte_order": "little"}, (0x3000,), 3),
        ({"type": "int64", "word_order": "high_first"}, (0xFFFF, 0xFFFF, 0xFFFF, 0xFFFE), -2),
        ({"type": "uint64", "word_order": "low_first"}, (0x0002, 0x0001, 0, 0), 65538),
        ({"type": "bcd"}, (0x1234,), 1234),
        ({"type": "bcd", "scale": 0.01}, (0x1234,), 12.34),
        ({"type": "bcd", "length": 2, "word_order": "high_first"}, (0x0001, 0x2345), 12345),
        ({"type": "bcd"}, (0x12A4,), FaultCode.OUT_OF_RANGE),
        ({"type": "string", "length": 3}, (0x5631, 0x2E32, 0x2000), "V1.2"),
        ({"type": "string", "length": 1, "byte_order": "little"}, (0x3156,), "V1"),
        ({"type": "string", "length": 1}, (0x0000,), ""),
        ({"type": "string", "length": 1}, (0xFF31,), FaultCode.OUT_OF_RANGE),
        ({"type": "string", "length": 1}, (0x1B31,), FaultCode.OUT_OF_RANGE),
        ({"map": {0: "dry", 1: "rain"}}, (1,), "rain"),
        ({"map": {0: "dry", 1: "rain"}}, (2,), FaultCode.OUT_OF_RANGE),
        ({"map": {-1: "back", 1: "on"}, "type": "int16"}, (0xFFFF,), "back"),
        ({"map": {3: "snow"}, "bits": [4, 5]}, (0x0030,), "snow"),
        ({"function": 1}, (1,), True),
        ({"function": 2}, (0,), False),
        ({"function": 2, "map": {0: "shut", 1: "open"}}, (1,), "open"),
        ({"unavailable": [0xFFFF, 0x8000]}, (0x8000,), FaultCode.UNAVAILABLE),
        ({"unavailable": [0xFFFF, 0x8000]}, (0x7FFF,), 0x7FFF),
        ({"unavailable": [-1], "type": "int16"}, (0xFFFF,), FaultCode.UNAVAILABLE),
        ({"unavailable": [0xFF], "byte": "low"}, (0x00FF,), FaultCode.UNAVAILABLE),
        ({"unavailable": [0xFF], "byte": "high"}, (0x00FF,), 0),
        ({"unavailable": [0xFFFF], "byte": "high"}, (0xFFFF,), FaultCode.UNAVAILABLE),
        (FLOAT | {"unavailable": [-9999.0]}, (0xC61C, 0x3C00), FaultCode.UNAVAILABLE),
        (FLOAT | {"unavailable": [0x7FC00000]}, (0x7FC0, 0), FaultCode.UNAVAILABLE),
        (FLOAT, (0x7FC0, 0), FaultCode.NOT_FINITE),
        ({"scale": 0.1, "offset": 15, "modulo": 360}, (3500,), 5.0),
        ({"scale": 0.1, "modulo": 360}, (3600,), 0.0),
        ({"offset": -90, "modulo": 360}, (10,), 280),
        ({"scale": 0.1, "modulo": 360, "range": [0, 359.9]}, (3599,), 359.9),
        ({"unavailable": [0xFFFF], "range": [0, 100], "scale": 0.1}, (0xFFFE,), FaultCode.OUT_OF_RANGE),
    ],
)
def test_registers_become_what_the_profile_says(
    keys: dict[str, Any], registers: tuple[int, ...], wanted: object
) -> None:
    found = read(*registers, **keys)
    assert (type(found), found) == (type(wanted), wanted)


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_a_float64_is_itself_where_it_is_a_measurement(number: float) -> None:
    registers = struct.unpack(">4H", struct.pack(">d", number))
    found = read(*registers, type="float64", word_order="high_first")
    if not math.isfinite(number):
        assert found is FaultCode.NOT_FINITE
    elif 0 < abs(number) < 1e-6:
        assert found is FaultCode.OUT_OF_RANGE
    else:
        assert found == number


def test_a_float64_that_its_scale_makes_too_large_is_not_finite() -> None:
    registers = struct.unpack(">4H", struct.pack(">d", 1e300))
    assert read(*registers, type="float64", word_order="high_first", scale=1e12) is FaultCode.NOT_FINITE
    assert read(*registers, type="float64", word_order="high_first", scale=2) == 2e300


@given(st.integers(0, 0xFFFF), st.integers(0, 15), st.integers(0, 15))
def test_a_part_is_what_cutting_its_digits_out_gives(content: int, one: int, other: int) -> None:
    first, last = sorted((one, other))
    assert read(content, bits=[first, last]) == int(f"{content:016b}"[15 - last : 16 - first], 2)


def test_faults_say_what_the_device_says() -> None:
    value = Value.model_validate(
        {"name": "level", "register": 7, "type": "uint16", "unit": "x", "unavailable": [0xFFFF]}
    )
    nothing = value.cell(7).decode((0xFFFF,))
    assert isinstance(nothing, Fault)
    assert nothing.message == "level is not available: the device sent 0xFFFF"


def test_what_is_unavailable_leaves_the_other_values_of_a_read_alone() -> None:
    more = {"type": "uint16", "unit": "x"}
    a = Value.model_validate({"name": "a", "register": 7, "unavailable": [0xFFFF], **more})
    b = Value.model_validate({"name": "b", "register": 8, "range": [0, 9], **more})
    block = Block.of((a, b))
    values: dict[str, Any] = {}
    faults: dict[str, Fault] = {}
    assert block.take((0xFFFF, 5), values, faults) is None
    assert values == {"a": None, "b": 5}
    assert {name: fault.code for name, fault in faults.items()} == {"a": FaultCode.UNAVAILABLE}
    assert block.decode((0xFFFF, 5)) == {"b": 5}
    worse = block.decode((0xFFFF, 50))
    assert isinstance(worse, Fault)
    assert worse.code is FaultCode.OUT_OF_RANGE
    short = block.take((1,), values, faults)
    assert short is not None
    assert short.code is FaultCode.MALFORMED
    alone = Block.of((a,)).decode((0xFFFF,))
    assert isinstance(alone, Fault)
    assert alone.code is FaultCode.UNAVAILABLE


def test_bits_come_in_whole_bytes() -> None:
    values = tuple(Value.model_validate({"name": f"b{n}", "register": n, "function": 2}) for n in (3, 12))
    block = Block.of(values)
    assert (block.count, block.answer) == (10, 16)
    assert block.decode((1, *(0,) * 8, 1, *(0,) * 6)) == {"b3": True, "b12": True}
