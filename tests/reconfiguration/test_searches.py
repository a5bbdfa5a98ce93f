"""Searches beside the commands: one for each key, ended one by one or all at once."""

from __future__ import annotations

import asyncio
from functools import partial
from unittest.mock import Mock

from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.reconfiguration.searches import Searches


async def look(ended: list[str], key: str, _: ProcedureRun) -> None:
    try:
        await asyncio.sleep(3600)
    finally:
        ended.append(key)


def test_each_key_has_its_own_search_which_sends_no_frame_once_it_is_ended() -> None:
    runs: list[Mock] = []
    ended: list[str] = []

    def new_run() -> ProcedureRun:
        runs.append(Mock(ProcedureRun))
        return runs[-1]

    async def go() -> None:
        searches: Searches[str] = Searches(new_run)
        for key in ("a", "b", "c", "d"):
            searches.begin(key, f"look for {key}", partial(look, ended, key))
        await asyncio.sleep(0)
        searches.end(("a", "unknown"))
        assert ("a" in searches, "b" in searches, "unknown" in searches) == (False, True, False)
        searches.let_end("d")
        searches.end_all(but=("b",))
        assert ("b" in searches, "c" in searches) == (True, False)
        await asyncio.sleep(0)
        assert ended == ["a", "c"]
        assert [run.stop.called for run in runs] == [True, False, True, False]

    asyncio.run(go())


def test_one_that_is_over_can_begin_anew_at_once() -> None:
    async def nothing(_: ProcedureRun) -> None:
        return None

    async def go() -> None:
        searches: Searches[int] = Searches(lambda: Mock(ProcedureRun))
        searches.begin(1, "first", nothing)
        await asyncio.sleep(0)
        assert 1 not in searches
        searches.begin(1, "second", partial(look, [], "1"))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert 1 in searches
        searches.end_all()

    asyncio.run(go())
