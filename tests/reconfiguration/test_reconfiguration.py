"""The one place that scans and physical changes share."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import ExitStack

import pytest

from lfs10d.command import RefusedError
from lfs10d.reconfiguration.runner import REFUSALS_SAVED_AFTER
from tests.support.lives import Bench


def test_while_a_scan_has_the_place_nothing_is_changed_and_no_other_scan_begun(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    bench.go(life, 2.0)
    with ExitStack() as held:
        held.enter_context(life.physical.place("line/scan"))
        answer = bench.readdress(life, "s3", 9)
        with pytest.raises(RefusedError, match="line/scan is being carried out") as refused:
            held.enter_context(life.physical.place("line/scan"))
        assert refused.value.result == answer
    assert (answer.status, answer.code) == ("rejected", "busy")
    assert life.physical.busy is None
    assert bench.readdress(life, "s3", 9).status == "ok"


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("device/readdress", {"device": "s3", "to": 4}),
        ("device/readdress", {"device": "s9", "to": 4}),
        ("line/baudrate", {"to": 9600}),
        ("line/baudrate", {"to": 115200}),
        ("line/adopt", {"from": 3}),
    ],
)
def test_a_request_refused_without_asking_the_line_is_answered_alike_in_the_next_life(
    bench: Bench, name: str, parameters: dict[str, object]
) -> None:
    life = bench.sensors(3, 4)
    bench.go(life, 2.0)
    life.request(name, id="x", **parameters)
    bench.go(life, REFUSALS_SAVED_AFTER + 1.0)
    bench.cut()
    life = bench.begin()
    bench.line.sensors.clear()
    life.request(name, id="x", **parameters)
    first, again = ({**response, "took_ms": 0} for response in bench.responses)
    assert first == again


def test_what_was_found_out_is_kept_and_answered_though_the_daemon_ends(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    life = bench.sensors(3, 4)
    bench.go(life, 2.0)
    held: list[asyncio.Future[None]] = []

    async def slowly(step: Callable[[], object], name: str) -> object:
        if len(held) == 0 and bench.line.sensors[0].slave == 9:
            held.append(bench.loop.create_future())
            await held[0]
        del name
        return step()

    monkeypatch.setattr("lfs10d.config.live_config.run_in_thread", slowly)
    life.request("device/readdress", id="x", device="s3", to=9)
    while not held:
        bench.turn(life)
    bench.loop.call_soon(bench.loop.call_later, 0.0, held[0].set_result, None)
    life.end()
    (response,) = bench.responses
    assert (response["status"], response["data"]) == ("ok", {"device": "s3", "from": 3, "to": 9})
    bench.cut()
    assert bench.begin().place("s3") == 9
