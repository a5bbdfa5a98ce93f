"""Which registers are read together, and what comes of them."""

from __future__ import annotations

import struct
from fractions import Fraction
from itertools import pairwise

from hypothesis import example, given
from hypothesis import strategies as st

from lfs10d.profiles.blocks import Block, batch
from lfs10d.profiles.values import Value
from lfs10d.reading import Fault, FaultCode

FORMATS = {"int16": "h", "uint16": "H", "int32": "i", "uint32": "I"}


def value(name: str, register: int, kind: str = "uint16", **more: object) -> Value:
    words = {} if kind.endswith("16") else {"word_order": "high_first"}
    return Value.model_validate({"name": name, "register": register, "type": kind, "unit": "1", **words, **more})


@st.composite
def some_values(draw: st.DrawFn) -> tuple[Value, ...]:
    places = draw(
        st.lists(
            st.tuples(st.sampled_from(sorted(FORMATS)), st.integers(0, 20), st.sampled_from([3, 4])),
            min_size=1,
            max_size=12,
        )
    )
    return tuple(
        value(f"v{index}", register, kind, function=function) for index, (kind, register, function) in enumerate(places)
    )


def summary(blocks: tuple[Block, ...]) -> list[tuple[int, int, int]]:
    return [(block.function, block.address, block.count) for block in blocks]


def test_neighbours_come_in_one_read() -> None:
    values = [value("b", 2), value("a", 1), value("c", 3, "int32")]
    assert summary(batch(values, 5)) == [(3, 1, 4)]


def test_a_gap_of_one_register_is_never_read_across() -> None:
    assert summary(batch([value("a", 1), value("b", 3)], 5)) == [(3, 1, 1), (3, 3, 1)]


def test_values_of_two_functions_are_never_read_together() -> None:
    assert summary(batch([value("a", 1), value("b", 2, function=4)], 5)) == [(3, 1, 1), (4, 2, 1)]


def test_neighbours_beyond_the_limit_are_split_between_values() -> None:
    values = [value("a", 0, "int32"), value("b", 2, "int32"), value("c", 4)]
    assert summary(batch(values, 3)) == [(3, 0, 2), (3, 2, 3)]


def test_overlapping_values_share_their_registers() -> None:
    assert summary(batch([value("a", 0, "int32"), value("low", 1), value("high", 0)], 5)) == [(3, 0, 2)]


def test_no_values_need_no_read() -> None:
    assert batch([], 5) == ()


@given(values=some_values(), most=st.integers(2, 6))
@example(values=(value("a", 0, "int32"), value("b", 0), value("c", 1, "int32")), most=2)
def test_batching_loses_nothing_reads_nothing_unlisted_and_keeps_the_limit(
    values: tuple[Value, ...], most: int
) -> None:
    blocks = batch(values, most)
    listed = {(v.function, v.register + word) for v in values for word in range(v.words)}
    asked = [(b.function, b.address + word) for b in blocks for word in range(b.count)]
    assert set(asked) == listed
    assert sorted(v.name for b in blocks for v in b.values) == sorted(v.name for v in values)
    assert all(b.count <= most for b in blocks)
    for b in blocks:
        assert all(b.address <= v.register and v.end <= b.address + b.count for v in b.values)
    for first, second in pairwise(blocks):
        touch = first.function == second.function and second.address <= first.address + first.count
        assert not touch or second.values[0].end - first.address > most


@given(values=some_values(), most=st.integers(2, 9), skips=st.integers(0, 9), data=st.data())
def test_a_read_of_some_values_touches_no_register_that_only_others_name(
    values: tuple[Value, ...], most: int, skips: int, data: st.DataObject
) -> None:
    read = data.draw(st.lists(st.sampled_from(values), unique_by=lambda each: each.name))
    unasked = [each for each in values if each not in read]
    blocks = batch(read, most, skips, values)
    assert sorted(each.name for block in blocks for each in block.values) == sorted(each.name for each in read)
    for block in blocks:
        own = {word for each in block.values for word in range(each.register, each.end)}
        spanned = set(range(block.address, block.address + block.count)) - own
        for each in unasked:
            assert each.function != block.function or spanned.isdisjoint(range(each.register, each.end))
        assert block.count <= most


@given(values=some_values(), most=st.integers(2, 6), data=st.data())
def test_a_block_decodes_what_each_value_alone_would_be(
    values: tuple[Value, ...], most: int, data: st.DataObject
) -> None:
    memory = {function: data.draw(st.binary(min_size=46, max_size=46)) for function in (3, 4)}
    numbers: dict[str, object] = {}
    for block in batch(values, most):
        words = struct.unpack_from(f">{block.count}H", memory[block.function], 2 * block.address)
        decoded = block.decode(words)
        assert not isinstance(decoded, Fault)
        numbers |= decoded
    assert numbers == {
        v.name: struct.unpack_from(">" + FORMATS[v.type], memory[v.function], 2 * v.register)[0] for v in values
    }


def test_one_bad_value_makes_the_whole_block_a_fault() -> None:
    (block,) = batch([value("a", 1), value("b", 2, range=[0, 10])], 5)
    assert block.decode((7, 10)) == {"a": 7, "b": 10}
    assert block.decode((7, 11)) == Fault(FaultCode.OUT_OF_RANGE, "b 11 is outside 0..10")


def test_a_value_that_is_not_finite_leaves_the_others_of_its_device() -> None:
    """A direction in calm is often NaN; of a single value it is the fault of the read."""
    nan = (0x7FC0, 0x0000)
    (block,) = batch([value("speed", 1), value("direction", 2, type="float32", word_order="high_first")], 5)
    assert block.decode((7, *nan)) == {"speed": 7}
    (alone,) = batch([value("direction", 2, type="float32", word_order="high_first")], 5)
    fault = alone.decode(nan)
    assert isinstance(fault, Fault)
    assert fault.code is FaultCode.NOT_FINITE


def test_another_number_of_registers_than_asked_is_malformed() -> None:
    (block,) = batch([value("a", 1)], 5)
    assert block.decode((1, 2)) == Fault(FaultCode.MALFORMED, "2 registers came, 1 were requested")


LETTERS = {
    ("high_first", "big"): "ABCD",
    ("high_first", "little"): "BADC",
    ("low_first", "big"): "CDAB",
    ("low_first", "little"): "DCBA",
}
"""In which order the bytes of a number, A the most significant, lie on the wire."""


@st.composite
def any_value(draw: st.DrawFn, index: int) -> Value:
    """Draw a value of any type, layout, scale and offset that a file may have."""
    kind = draw(st.sampled_from([*FORMATS, "float32"]))
    words = {} if kind.endswith("16") else {"word_order": draw(st.sampled_from(["high_first", "low_first"]))}
    return Value.model_validate(
        {
            "name": f"v{index}",
            "register": draw(st.integers(0, 20)),
            "type": kind,
            "unit": "1",
            "function": draw(st.sampled_from([3, 4])),
            "byte_order": draw(st.sampled_from(["big", "little"])),
            "scale": draw(st.sampled_from([1, 0.1, 0.01, -0.5, 3.6, 10])),
            "offset": draw(st.sampled_from([0, -40, 0.25])),
            **words,
        }
    )


NOT_FINITE = "not finite"


def by_hand(value: Value, memory: bytes) -> Fraction | str | None:
    """Decode by shuffling bytes and calculating in fractions; None for what no sensor measures."""
    wire = memory[2 * value.register :][: 2 if value.type.endswith("16") else 4]
    letters = LETTERS[value.word_order or "high_first", value.byte_order]
    if len(wire) == 2:
        letters = {"big": "AB", "little": "BA"}[value.byte_order]
    straight = bytes(wire[letters.index(letter)] for letter in sorted(letters))
    if value.type != "float32":
        raw = Fraction(int.from_bytes(straight, "big", signed=value.type.startswith("i")))
    else:
        if int.from_bytes(straight, "big") >> 23 & 0xFF == 0xFF:
            return NOT_FINITE
        raw = Fraction(struct.unpack(">f", straight)[0])
        if 0 < abs(raw) < Fraction(struct.unpack(">f", struct.pack(">f", 1e-6))[0]):
            return None
    return raw * Fraction(repr(value.scale)) + Fraction(repr(value.offset))


def test_a_number_that_is_not_finite_is_left_out_beside_one_that_is_there() -> None:
    whole = Value.model_validate({"name": "whole", "register": 20, "type": "int16", "unit": "1"})
    real = Value.model_validate(
        {"name": "real", "register": 20, "type": "float32", "word_order": "high_first", "unit": "1"}
    )
    [block] = batch((whole, real), 2)
    assert block.decode((0x7F80, 0)) == {"whole": 0x7F80}


@given(data=st.data(), most=st.integers(2, 6))
def test_any_content_of_any_profile_is_decoded_as_by_hand(data: st.DataObject, most: int) -> None:
    values = tuple(data.draw(any_value(index)) for index in range(data.draw(st.integers(1, 6))))
    memory = {function: data.draw(st.binary(min_size=46, max_size=46)) for function in (3, 4)}
    for block in batch(values, most):
        words = struct.unpack_from(f">{block.count}H", memory[block.function], 2 * block.address)
        decoded = block.decode(words)
        wanted = {each.name: by_hand(each, memory[each.function]) for each in block.values}
        if isinstance(decoded, Fault):
            assert None in wanted.values() or set(wanted.values()) == {NOT_FINITE}
            continue
        assert decoded
        for each in block.values:
            expected = wanted[each.name]
            if expected == NOT_FINITE:  # beside a value that is there
                assert each.name not in decoded
                continue
            assert isinstance(expected, Fraction)
            if each.type == "float32":  # its number is the shortest decimal, half a unit in the last place off at most
                slack = abs(expected - Fraction(repr(each.offset))) / 2**24 * 2
                assert abs(Fraction(decoded[each.name]) - expected) <= slack + abs(expected) / 2**50
            else:
                assert decoded[each.name] == float(expected)
