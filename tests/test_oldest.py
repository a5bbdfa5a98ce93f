"""The lower bounds of pyproject.toml are versions that are tried: `make test-oldest`."""

from __future__ import annotations

import pytest

from tests.oldest import NEEDED_TO_TEST, ROOT, lowest, requirements


@pytest.mark.parametrize(
    ("requirement", "oldest"),
    [
        ("paho-mqtt>=2.2,<3", "paho-mqtt==2.2"),
        ("coverage[toml]>=7.6,<8", "coverage==7.6"),
        ("types-PyYAML>=6.0.12", "types-PyYAML==6.0.12"),
    ],
)
def test_the_lowest_version_of_a_range_is_its_beginning(requirement: str, oldest: str) -> None:
    assert lowest(requirement) == oldest


@pytest.mark.parametrize("requirement", ["rich", "rich<16", "rich==13.7", "rich>=13.7; python_version < '3.12'"])
def test_a_range_that_begins_nowhere_is_an_error(requirement: str) -> None:
    with pytest.raises(ValueError, match="lowest version"):
        lowest(requirement)


def test_every_dependency_and_what_the_tests_need_is_installed_at_its_lowest() -> None:
    found = requirements((ROOT / "pyproject.toml").read_text())
    assert all("==" in each for each in found)
    names = {each.partition("==")[0] for each in found}
    assert {"pymodbus", "paho-mqtt", "pydantic", "PyYAML", "click", "rich"} | NEEDED_TO_TEST == names
