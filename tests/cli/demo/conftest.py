"""What the tests of the demo share: messages as the daemon sends them."""

from __future__ import annotations

import pytest

from tests.support.demo_states import Told


@pytest.fixture
def told() -> Told:
    """Give a picture that has heard nothing yet."""
    return Told()
