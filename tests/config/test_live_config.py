"""The configuration that holds: every reload and every request's change, on the disk before it takes effect."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest

from lfs10d.config.changes import Changes, Place
from lfs10d.config.changes_file import FILE_NAME, ChangesFile
from lfs10d.config.effective import Edit, Effective
from lfs10d.config.live_config import LiveConfig, News
from lfs10d.config.loader import load
from lfs10d.config.merge import DroppedChange
from lfs10d.config.reload import ReloadPlan
from lfs10d.errors import ConfigError, StateError
from lfs10d.system.disk import Disk
from tests.support.volatile_disk import ForgetfulFiles, PowerCutError

STATE = Path("/state")
TEXT = "line: {port: x}\nslaves: [{id: 2, interval: 1s}, 3]\n"


class Site:
    """A file, a disk in memory, and what was put into force."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "lfs10d.yaml"
        self.path.write_text(TEXT)
        self.disk = ForgetfulFiles()
        self.taken: list[tuple[str, ...]] = []
        self.kept_when_taken: list[Changes] = []
        self.start()

    def start(self) -> None:
        self._news: list[News] = []
        self.running = LiveConfig(load(self.path), ChangesFile(STATE, Disk(self.disk)))
        self.running.start(self)

    def report(self, news: News) -> None:
        assert news != News()
        self._news.append(news)

    def news(self) -> News:
        """Return what was reported since this was asked last, at most one report."""
        reports, self._news = self._news, []
        (news,) = reports or (News(),)
        return news

    async def apply(self, plan: ReloadPlan, before: Effective) -> None:
        self.taken.append(plan.applied)
        assert plan.loaded == self.running.loaded
        assert before is not self.running.now
        self.kept_when_taken.append(self.kept)

    @property
    def kept(self) -> Changes:
        """What a daemon would find that is started now, after a power cut."""
        kept = ForgetfulFiles(seen=dict(self.disk.kept), kept=dict(self.disk.kept))
        kept.power_cut()
        return ChangesFile(STATE, Disk(kept)).read().changes

    def change(self, edit: Edit) -> tuple[Effective, Effective]:
        changed: tuple[Effective, Effective] = run(self.running.change(edit))
        return changed

    def reload(self, text: str) -> ReloadPlan:
        self.path.write_text(text)
        plan: ReloadPlan = run(self.running.reload())
        return plan

    def interval(self) -> float:
        slave = self.running.now.slave("slave-2")
        assert slave is not None
        return slave.interval


def run(work: Coroutine[Any, Any, Any]) -> Any:  # noqa: ANN401  # whatever the work returns
    return asyncio.run(work)


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path)


def slower(now: Effective) -> Changes:
    return now.changes.setting("slave-2", {"interval": 5.0}, now.file_values)


def test_a_change_takes_effect_and_is_there_after_a_power_cut(site: Site) -> None:
    before, now = site.change(slower)
    assert site.taken == [("slaves.slave-2.interval",)]
    assert site.kept_when_taken == [now.changes]
    assert (before.changes.count, now.changes.count, site.interval()) == (0, 1, 5.0)
    site.disk.power_cut()
    site.start()
    assert site.interval() == 5.0
    assert site.news() == News()


def test_what_changes_nothing_is_neither_kept_nor_taken(site: Site) -> None:
    before, now = site.change(lambda now: now.changes)
    assert before is now
    assert (site.taken, site.running.missing, site.disk.exists(STATE / FILE_NAME)) == ([], True, False)


@pytest.mark.parametrize("step", range(4))
def test_a_change_cut_short_has_taken_no_effect(site: Site, step: int) -> None:
    site.disk.steps_left = step
    with pytest.raises(PowerCutError):
        site.change(slower)
    assert site.taken == []
    site.disk.power_cut((STATE / FILE_NAME,) if step == 3 else ())
    site.start()
    assert site.interval() in (1.0, 5.0)


def test_what_cannot_be_kept_is_not_done(site: Site) -> None:
    site.disk.full = 0
    with pytest.raises(StateError):
        site.change(slower)
    assert (site.taken, site.interval(), site.running.now.changes) == ([], 1.0, Changes())


def test_what_was_learnt_of_the_line_is_so_though_the_disk_does_not_keep_it(site: Site) -> None:
    site.disk.full = 0
    run(site.running.learn(lambda now: now.changes.moving("slave-2", Place(9), now.file_values)))
    assert site.taken == [("slaves.slave-2.id",)]
    news = site.news()
    assert news.storage is not None
    assert "changes.yaml cannot be written" in news.storage
    site.disk.full = None
    run(site.running.learn(lambda now: now.changes.moving("slave-2", Place(10), now.file_values)))
    site.disk.power_cut()
    site.start()
    assert site.running.now.places["slave-2"] == (Place(10, 9600),)


def test_a_file_of_changes_that_is_damaged_is_as_good_as_gone(site: Site) -> None:
    site.change(slower)
    site.start()
    assert not site.running.missing
    site.disk.write(STATE / FILE_NAME, b"nonsense", mode=0o640)
    site.start()
    assert site.running.missing


def test_what_the_edit_refuses_is_not_done(site: Site) -> None:
    def refuse(_: Effective) -> Changes:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        site.change(refuse)
    assert (site.taken, site.kept) == ([], Changes())


def test_changes_at_the_same_time_follow_each_other(site: Site) -> None:
    async def both() -> None:
        await asyncio.gather(
            site.running.change(slower),
            site.running.change(lambda now: now.changes.setting("slave-3", {"enabled": False}, now.file_values)),
        )

    run(both())
    assert site.running.now.changes.count == site.kept.count == 2


def test_a_reload_keeps_what_was_changed_and_applies_the_rest(site: Site) -> None:
    site.change(slower)
    plan = site.reload(TEXT.replace("3]", "3, 4]"))
    assert plan.applied == ("slaves.slave-4",)
    assert site.interval() == 5.0
    assert site.news() == News()


def test_an_edit_wins_at_a_reload_is_told_once_and_forgotten_on_the_disk(site: Site) -> None:
    site.change(slower)
    site.reload(TEXT.replace("1s", "3s"))
    assert (site.interval(), site.kept) == (3.0, Changes())
    (lost,) = site.news().dropped
    assert (lost.key, lost.lost) == ("slaves.slave-2.interval", 5.0)
    assert site.news() == News()
    site.reload(TEXT)
    assert site.interval() == 1.0


def test_an_edit_wins_at_the_start_too(site: Site) -> None:
    site.change(slower)
    site.path.write_text(TEXT.replace("1s", "3s"))
    site.start()
    assert (site.interval(), site.kept) == (3.0, Changes())
    assert [lost.key for lost in site.news().dropped] == ["slaves.slave-2.interval"]
    site.start()
    assert site.news() == News()


@pytest.mark.parametrize("beginning", [True, False])
def test_where_the_disk_fails_the_edit_wins_all_the_same(site: Site, *, beginning: bool) -> None:
    site.change(slower)
    site.disk.full = 0
    if beginning:
        site.path.write_text(TEXT.replace("1s", "3s"))
        site.start()
    else:
        site.reload(TEXT.replace("1s", "3s"))
    assert site.interval() == 3.0
    news = site.news()
    assert news.storage is not None
    assert len(news.dropped) == 1
    assert site.kept.count == 1


def test_a_broken_file_changes_nothing(site: Site) -> None:
    site.change(slower)
    with pytest.raises(ConfigError):
        site.reload("nonsense")
    assert (site.interval(), site.kept.count, len(site.taken)) == (5.0, 1, 1)


def test_a_file_of_changes_that_nobody_understands_is_told_once(site: Site) -> None:
    Disk(site.disk).replace(STATE / FILE_NAME, b"nonsense")
    site.start()
    (lost,) = site.news().dropped
    assert (lost.key, lost.device) == ("changes.yaml", None)
    assert site.running.now.changes == Changes()
    site.start()
    assert site.news() == News()


def test_what_cannot_hold_is_told_when_it_begins_and_not_again(site: Site) -> None:
    site.change(lambda now: now.changes.adding("roof", {"id": 9}))
    assert site.news() == News()
    clash = TEXT.replace("3]", "3, 9]")
    site.reload(clash)
    (warning,) = site.news().warnings
    assert warning == "roof: slave id 9 is taken by slave-9; change the id of one, or remove one"
    site.reload(clash.replace("1s", "3s"))
    assert site.news() == News()
    site.start()
    assert site.news().warnings == [warning]


def test_what_needs_a_restart_waits_for_it_whatever_requests_change(site: Site) -> None:
    plan = site.reload(TEXT.replace("port: x", "port: x, name: north"))
    assert plan.restart_required == ("line.name",)
    site.change(slower)
    assert site.running.loaded.config.line.name == "line0"
    assert site.taken[-1] == ("slaves.slave-2.interval",)


def test_news_is_words_for_people() -> None:
    news = News([DroppedChange("slaves.a.label", "a", "Top", "the file has another value now")], ["roof: cannot hold"])
    assert news.messages == [
        "slaves.a.label: the file has another value now: the change made by request is dropped",
        "roof: cannot hold",
    ]


def test_a_change_that_the_disk_refuses_is_reported(site: Site) -> None:
    site.disk.full = 0
    with pytest.raises(StateError) as refused:
        site.change(slower)
    assert site.news().storage == str(refused.value)
