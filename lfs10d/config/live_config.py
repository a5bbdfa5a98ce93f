"""The configuration that holds while the daemon runs: the file and what requests changed. One path for every change.

A request's change is on the disk before anything of it takes effect, and a person's edit of the file always wins.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeAlias

from lfs10d.config.changes import Changes
from lfs10d.config.changes_file import FILE_NAME, ChangesFile
from lfs10d.config.effective import Effective, effective
from lfs10d.config.loader import LoadedConfig
from lfs10d.config.merge import DroppedChange
from lfs10d.config.reload import ConfigFiles, ReloadPlan, imprint, plan, read
from lfs10d.errors import StateError
from lfs10d.system.threads import run_in_thread
from lfs10d.telemetry.publication import Publication, event

Edit: TypeAlias = "Callable[[Effective], Changes]"
"""What a request makes of the changes, given what holds; raises what refuses the request. Called in any thread."""


@dataclass(slots=True)
class News:
    """What a person should know: changes that were `dropped`, other `warnings`, and why the disk fails, if it does."""

    dropped: list[DroppedChange] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    storage: str | None = None

    @property
    def sayings(self) -> list[str]:
        """All of it in words, but for the disk."""
        lost = (f"{each.key}: {each.message}: what a request changed there is dropped" for each in self.dropped)
        return [*lost, *self.warnings]

    def events(self, ts: int) -> list[Publication]:
        """Return what the broker is told of it at `ts`, epoch ms."""
        return [
            event("change_dropped", ts, key=lost.key, device=lost.device, lost=lost.lost, message=lost.message)
            for lost in self.dropped
        ]


class LiveConfig:
    """`take(plan, before)` puts another configuration into force; `now` holds it already then.

    Built before the loop runs: the file of changes is read at once, and one that cannot be understood put aside.
    """

    def __init__(
        self, file: LoadedConfig, changes: ChangesFile, take: Callable[[ReloadPlan, Effective], Awaitable[None]]
    ) -> None:
        self._file = changes
        self._take = take
        self._lock = asyncio.Lock()
        self._news = News()
        self._login: Mapping[str, bytes] = imprint(file)
        found = changes.take()
        self.missing = found.missing or found.trouble is not None
        """No changes were known when the daemon began: there never were any, or their file is gone or damaged."""
        if found.trouble is not None:
            self._news.dropped.append(DroppedChange(FILE_NAME, None, None, found.trouble))
        self.now = effective(file, found.changes)
        self._news.dropped += self.now.dropped
        self._note(self.now, {})
        if self.now.changes != found.changes:
            self._save(self.now.changes)

    @property
    def loaded(self) -> LoadedConfig:
        """What holds, as one configuration."""
        return self.now.loaded

    def news(self) -> News:
        """Return what a person was not told yet."""
        news, self._news = self._news, News()
        return news

    async def reload(self) -> ReloadPlan:
        """Read the file again and apply what changed; raises ConfigError and changes nothing if it is wrong."""
        async with self._lock:
            before = self.now.changes
            found = await run_in_thread(partial(read, self.now.file.path), "reload")
            now = await run_in_thread(partial(effective, found.loaded, before), "reload")
            if now.changes != before:
                await run_in_thread(partial(self._save, now.changes), "changes")
            self._news.dropped += now.dropped
            return await self._hold(now, found.login)

    async def change(self, edit: Edit) -> tuple[Effective, Effective]:
        """Change what holds, on the disk first; return what held before and what holds now.

        Raises StateError if it cannot be put on the disk, and what `edit` raises; nothing is changed then.
        """
        return await self._change(edit, self._file.save)

    async def learn(self, edit: Edit) -> tuple[Effective, Effective]:
        """Take up what was learnt of the line. It is so whether or not the disk keeps it: that is told as news."""
        return await self._change(edit, self._save)

    async def _change(self, edit: Edit, save: Callable[[Changes], None]) -> tuple[Effective, Effective]:
        async with self._lock:
            before = self.now
            changes = await run_in_thread(partial(edit, before), "changes")
            if changes == before.changes:
                return before, before
            now = await run_in_thread(partial(effective, before.file, changes), "changes")
            await run_in_thread(partial(save, now.changes), "changes")
            await self._hold(now, self._login)
            return before, self.now

    def _save(self, changes: Changes) -> None:
        """Keep what a person's edit left of the changes; if that fails the next start finds the same."""
        try:
            self._file.save(changes)
        except StateError as error:
            self._news.storage = str(error)

    def _note(self, now: Effective, told: Mapping[str, str]) -> None:
        """Note what cannot hold, unless it was `told` already."""
        self._news.warnings += (
            f"{name}: {why}" for name, why in {**now.suspended, **now.conflicts}.items() if told.get(name) != why
        )

    async def _hold(self, now: Effective, login: Mapping[str, bytes]) -> ReloadPlan:
        before = self.now
        self._note(now, {**before.suspended, **before.conflicts})
        found = plan(ConfigFiles(before.loaded, self._login), ConfigFiles(now.loaded, login))
        self.now, self._login = replace(now, loaded=found.loaded), login
        await self._take(found, before)
        return found
