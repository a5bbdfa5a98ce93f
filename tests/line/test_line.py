"""The line as the daemon holds it: what `line.realtime` changes. The rest is watched in tests/daemon."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from lfs10d.config.loader import load
from lfs10d.line.line import Line
from lfs10d.line.thread import WAKING, WAKING_REALTIME


@pytest.mark.parametrize(("refusal", "awake"), [(None, WAKING_REALTIME), ("not permitted", WAKING)])
def test_the_thread_is_awake_earlier_while_it_has_precedence(
    refusal: str | None,
    awake: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr("lfs10d.line.line.take_precedence", lambda: refusal)
    monkeypatch.setattr("lfs10d.line.line.yield_precedence", lambda: None)
    file = tmp_path / "lfs10d.yaml"
    file.write_text("line: {port: /dev/absent, realtime: true}\nslaves: [1]\nmqtt: {host: localhost}\n")
    found = load(file)

    async def live() -> list[float]:
        line = Line(found.config.line)
        seen = [line._thread.waking]
        line._prepare()
        seen.append(line._thread.waking)
        line._precede(wanted=False)
        return [*seen, line._thread.waking]

    assert asyncio.run(live()) == [WAKING, awake, WAKING]
    assert [record.getMessage() for record in caplog.records] == ([] if refusal is None else [refusal])
