"""How a device is found and recognised, and where its id and rate are set."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from lfs10d.profiles.device_facts import Barrier, Factory, Identity, IdRegister, RateRegister, SlaveIds
from lfs10d.profiles.facts import Facts


def problems(model: type[BaseModel], data: dict[str, Any]) -> list[tuple[tuple[int | str, ...], str]]:
    with pytest.raises(ValidationError) as caught:
        model.model_validate(data)
    return [(wrong["loc"], wrong["msg"]) for wrong in caught.value.errors()]


def test_what_identifies_a_device_holds_one_of_the_contents_named() -> None:
    identity = Identity.model_validate({"register": 0x0160, "holds": [0x90, 0x91]})
    assert (identity.register, identity.function, identity.holds) == (0x0160, 3, (0x90, 0x91))
    assert problems(Identity, {"register": 1, "holds": []}) == [(("holds",), "names no content")]


def test_each_rate_has_a_code_of_its_own() -> None:
    rate = RateRegister.model_validate({"register": 4, "codes": {9600: 1, 19200: 2}})
    assert rate.codes == {9600: 1, 19200: 2}
    again = {"register": 4, "codes": {9600: 1, 19200: 1}}
    assert problems(RateRegister, again) == [(("codes", 19200), "1 is the code of 9600 already")]


@pytest.mark.parametrize(
    ("codes", "problem"),
    [
        ({}, (("codes",), "names no rate")),
        ({9601: 1}, (("codes", 9601), "is no baud rate; write one of 1200 2400 4800 9600 19200 38400 57600 115200")),
    ],
)
def test_only_rates_have_codes(codes: dict[int, int], problem: tuple[tuple[int | str, ...], str]) -> None:
    assert problems(RateRegister, {"register": 4, "codes": codes}) == [problem]


def test_codes_that_are_no_mapping_are_refused() -> None:
    assert [place for place, _ in problems(RateRegister, {"register": 4, "codes": [1]})] == [("codes",)]


def test_a_barrier_a_lock_and_a_factory_are_what_the_file_says() -> None:
    barrier = Barrier.model_validate({"register": 5, "count": 1})
    assert (barrier.function, barrier.count) == (3, 1)
    assert IdRegister.model_validate({"register": 5, "locked_by": "DIP switch"}).locked_by == "DIP switch"
    assert Factory.model_validate({"id": 1, "baudrate": 4800}).baudrate == 4800
    assert [place for place, _ in problems(Factory, {"id": 256, "baudrate": 4801})] == [("id",), ("baudrate",)]


class Numbered(Facts):
    """Something with slave ids."""

    ids: SlaveIds


def test_slave_ids_are_the_first_and_the_last_in_order() -> None:
    assert Numbered.model_validate({"ids": [1, 1]}).ids == (1, 1)
    assert Numbered.model_validate({"ids": [1, 247]}).ids == (1, 247)
    assert problems(Numbered, {"ids": [2, 1]}) == [(("ids",), "the first id is greater than the last")]
    wanted = "must be the first and the last slave id, such as [1, 247], not an empty list"
    assert problems(Numbered, {"ids": []}) == [(("ids",), wanted)]
