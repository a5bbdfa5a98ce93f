"""Verbs as a person types them, at a running daemon: in a pipe, on a terminal, ended by a signal."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.shells import Shell
from tests.support.sites import Site


@pytest.fixture
def shell(site: Site) -> Iterator[Shell]:
    made = Shell(site)
    yield made
    made.close()
