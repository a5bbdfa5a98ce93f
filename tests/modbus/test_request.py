"""What can be asked, and what cannot."""

from __future__ import annotations

import pytest

from lfs10d.modbus.request import ReadRegisters, WriteRegister


@pytest.mark.parametrize("slave", [1, 247, 248, 255])
def test_every_slave_id_of_the_sensor_can_be_asked(slave: int) -> None:
    assert ReadRegisters(slave, 0x0001, 2).slave == slave
    assert WriteRegister(slave, 0x0005, 0x00FF).function == 6


def test_a_write_may_go_to_everybody() -> None:
    assert WriteRegister(0, 0xFFFF, 0xFFFF).slave == 0


@pytest.mark.parametrize(
    ("slave", "address", "count", "function"),
    [
        (0, 1, 2, 3),
        (256, 1, 2, 3),
        (-1, 1, 2, 3),
        (1, 1, 0, 3),
        (1, 1, 126, 3),
        (1, 0xFFFF, 2, 3),
        (1, -1, 2, 3),
        (1, 1, 2, 6),
        (1, 1, 2, 5),
        (1, 1, 0, 1),
        (1, 1, 2001, 2),
        (1, 0xFFFF, 2, 1),
    ],
)
def test_an_impossible_read_is_refused(slave: int, address: int, count: int, function: int) -> None:
    with pytest.raises(ValueError, match=r"cannot be read|function 3 or 4|outside"):
        ReadRegisters(slave, address, count, function)


@pytest.mark.parametrize(
    ("slave", "address", "value"),
    [(256, 1, 1), (-1, 1, 1), (1, 0x10000, 1), (1, -1, 1), (1, 1, 0x10000), (1, 1, -1)],
)
def test_an_impossible_write_is_refused(slave: int, address: int, value: int) -> None:
    with pytest.raises(ValueError, match=r"cannot be written|outside"):
        WriteRegister(slave, address, value)
    with pytest.raises(ValueError, match=r"cannot be written|outside"):
        WriteRegister(slave, address, value, 16)


def test_a_register_is_written_by_function_6_or_16() -> None:
    assert WriteRegister(1, 5, 7, 16).function == 16
    with pytest.raises(ValueError, match="by function 6 or 16, not 5"):
        WriteRegister(1, 5, 7, 5)


@pytest.mark.parametrize(
    ("count", "function", "data"), [(1, 1, 1), (8, 2, 1), (9, 1, 2), (2000, 2, 250), (1, 3, 2), (125, 4, 250)]
)
def test_an_answer_has_two_bytes_a_register_and_one_for_eight_bits(count: int, function: int, data: int) -> None:
    assert ReadRegisters(1, 0, count, function).data_bytes == data


def test_the_last_register_can_be_read() -> None:
    assert ReadRegisters(1, 0xFFFF, 1, 4).count == 1
