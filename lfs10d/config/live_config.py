"""The effective configuration while the daemon runs. Every change of it goes through here.

A request's change is on the disk before anything of it takes effect, and a person's edit of the file always wins.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from functools import partial
from typing import Protocol

from lfs10d.config.changes import Changes
from lfs10d.config.changes_file import FILE_NAME, ChangesFile
from lfs10d.config.effective import Edit, Effective, effective
from lfs10d.config.loader import LoadedConfig
from lfs10d.config.merge import DroppedChange
from lfs10d.config.reload import ConfigFiles, ReloadPlan, imprint, plan, read
from lfs10d.errors import StateError
from lfs10d.system.dataclass import dataclass
from lfs10d.system.threads import run_in_thread


@dataclass(slots=True)
class News:
    """News for a person: changes by request that were `dropped`, other `warnings`, and an error of the disk."""

    dropped: list[DroppedChange] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    storage: str | None = None

    @property
    def messages(self) -> list[str]:
        """All messages, without the error of the disk."""
        lost = (f"{each.key}: {each.message}: the change made by request is dropped" for each in self.dropped)
        return [*lost, *self.warnings]


class ConfigEvents(Protocol):
    """The events of a change of the configuration. Called in the loop's thread."""

    async def apply(self, plan: ReloadPlan, before: Effective) -> None:
        """Apply the new `LiveConfig.now` to the daemon's parts."""

    def report(self, news: News) -> None:
        """Report dropped changes, warnings and errors of the disk."""


class LiveConfig:
    """Built before the loop runs: the file of changes is read at once, and a damaged one put aside."""

    def __init__(self, file: LoadedConfig, changes: ChangesFile) -> None:
        self._file = changes
        self._events: ConfigEvents
        """Given at the start."""
        self._lock = asyncio.Lock()
        self._news = News()
        self._login: Mapping[str, bytes] = imprint(file)
        found = changes.take()
        self.missing = found.missing or found.trouble is not None
        """At the start there was no readable file of changes: none was made yet, or it is lost or damaged."""
        if found.trouble is not None:
            self._news.dropped.append(DroppedChange(FILE_NAME, None, None, found.trouble))
        self.now = effective(file, found.changes)
        self._news.dropped += self.now.dropped
        self._note(self.now, {})
        if self.now.changes != found.changes:
            self._try_save(self.now.changes)

    @property
    def loaded(self) -> LoadedConfig:
        """The effective configuration in the form of a loaded file."""
        return self.now.loaded

    def start(self, events: ConfigEvents) -> None:
        """Call `events` from now on; report what was found when this was built."""
        self._events = events
        self._report()

    async def reload(self) -> ReloadPlan:
        """Read the file again and apply what changed; raises ConfigError and changes nothing if it has errors."""
        async with self._lock:
            before = self.now.changes
            found = await run_in_thread(partial(read, self.now.file.path), "reload")
            now = await run_in_thread(partial(effective, found.loaded, before), "reload")
            if now.changes != before:
                await run_in_thread(partial(self._try_save, now.changes), "changes")
            self._news.dropped += now.dropped
            plan = await self._apply(now, found.login)
        self._report()
        return plan

    async def change(self, edit: Edit) -> tuple[Effective, Effective]:
        """Change the configuration, on the disk first; return the one before and the new one.

        Raises StateError if it cannot be put on the disk, and what `edit` raises; nothing is changed then.
        """
        return await self._change(edit, self._save)

    async def learn(self, edit: Edit) -> tuple[Effective, Effective]:
        """Take a fact found on the line; it holds even if it cannot be saved, which is reported."""
        return await self._change(edit, self._try_save)

    async def _change(self, edit: Edit, save: Callable[[Changes], None]) -> tuple[Effective, Effective]:
        try:
            async with self._lock:
                before = self.now
                changes = await run_in_thread(partial(edit, before), "changes")
                if changes == before.changes:
                    return before, before
                now = await run_in_thread(partial(effective, before.file, changes), "changes")
                await run_in_thread(partial(save, now.changes), "changes")
                await self._apply(now, self._login)
                return before, self.now
        finally:
            self._report()

    def _save(self, changes: Changes) -> None:
        """Save the changes; raises StateError and reports it."""
        try:
            self._file.save(changes)
        except StateError as error:
            self._news.storage = str(error)
            raise

    def _try_save(self, changes: Changes) -> None:
        """Save the changes if possible; otherwise the next start finds the same facts or edits again."""
        with contextlib.suppress(StateError):
            self._save(changes)

    def _note(self, now: Effective, reported: Mapping[str, str]) -> None:
        """Note changes that cannot hold, unless they were `reported` already."""
        self._news.warnings += (
            f"{name}: {why}" for name, why in {**now.suspended, **now.conflicts}.items() if reported.get(name) != why
        )

    def _report(self) -> None:
        """Report the news, once."""
        news, self._news = self._news, News()
        if news != News():
            self._events.report(news)

    async def _apply(self, now: Effective, login: Mapping[str, bytes]) -> ReloadPlan:
        before = self.now
        self._note(now, {**before.suspended, **before.conflicts})
        found = plan(ConfigFiles(before.loaded, self._login), ConfigFiles(now.loaded, login))
        self.now, self._login = replace(now, loaded=found.loaded), login
        await self._events.apply(found, before)
        return found
