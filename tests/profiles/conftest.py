"""What the tests of profiles share: a small profile as data, to be altered and checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from lfs10d.profiles.profile import Profile


@pytest.fixture
def profile_of() -> Callable[..., Profile]:
    """Return a function that builds a profile of one uint16 value, with keys replaced or added."""

    def build(**changed: Any) -> Profile:  # noqa: ANN401  # whatever a file may hold
        value = {"name": "level", "register": 1, "type": "uint16", "unit": "m"}
        return Profile.model_validate({"name": "tank", "title": "Tank", "values": [value], **changed})

    return build
