"""The table of requests against the contract's."""

from __future__ import annotations

import pytest

from lfs10d.commands.handlers.registry import HANDLERS
from tests.support.context import Ask, FakeContext

CLASSES = {
    "config/get": "always",
    "health": "always",
    "republish": "always",
    "config/reload": "polling",
    "config/reset": "polling",
    "device/add": "polling",
    "device/remove": "polling",
    "device/options": "polling",
    "device/read": "polling",
    "line/scan": "sensors",
    "line/trace": "sensors",
    "line/pause": "sensors",
    "device/readdress": "sensors",
    "line/cancel": "sensors",
    "register/read": "registers",
    "register/write": "registers",
}


@pytest.mark.parametrize(("name", "klass"), CLASSES.items())
def test_every_request_is_of_the_class_the_contract_says(name: str, klass: str) -> None:
    assert HANDLERS[name].spec.klass == klass


@pytest.mark.parametrize("name", sorted(HANDLERS))
def test_no_request_takes_a_parameter_it_does_not_know(ask: Ask, fake: FakeContext, name: str) -> None:
    answer = ask(name, '{"nonsense":1}')
    assert (answer.status, answer.code, answer.facts["param"]) == ("rejected", "invalid_param", "nonsense")
    assert fake.done == []
