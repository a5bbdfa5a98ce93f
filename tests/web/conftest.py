"""The page's server with one line and one device."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.pages import PageServer, serving
from tests.web.lines import PLACE, PublishedLine


@pytest.fixture
def server() -> Iterator[PageServer]:
    with serving() as made:
        made.do(lambda: PublishedLine(line=made.site.line("lfs10d", "line0", PLACE)))
        yield made
