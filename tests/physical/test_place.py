"""The one place that scans and physical changes share."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from lfs10d.requests.request import RefusedError

if TYPE_CHECKING:
    from tests.physical.conftest import Bench


def test_while_a_scan_has_the_place_nothing_is_changed_and_no_other_scan_begun(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    bench.go(life, 2.0)
    with ExitStack() as held:
        held.enter_context(life.physical.place("line/scan"))
        answer = bench.readdress(life, "s3", 9)
        with pytest.raises(RefusedError, match="line/scan is being carried out") as refused:
            held.enter_context(life.physical.place("line/scan"))
        assert refused.value.answer == answer
    assert (answer.status, answer.code) == ("rejected", "busy")
    assert life.physical.busy is None
    assert bench.readdress(life, "s3", 9).status == "ok"
