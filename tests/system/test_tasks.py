"""No background task ends unheard."""

from __future__ import annotations

import asyncio

import pytest

from lfs10d.system.tasks import BackgroundTasks


async def broken() -> None:
    raise KeyError("factory")


async def endless() -> None:
    await asyncio.Event().wait()


async def brief() -> None:
    await asyncio.sleep(0)


def test_a_task_that_raises_is_logged_with_its_name_and_trace_and_its_owner_is_called(
    caplog: pytest.LogCaptureFixture,
) -> None:
    failures: list[str] = []

    async def story() -> None:
        tasks = BackgroundTasks(lambda: failures.append("failed"))
        await asyncio.wait([tasks.start("rate watch", broken())])
        await asyncio.sleep(0)

    asyncio.run(story())
    (record,) = caplog.records
    assert (record.levelname, record.getMessage()) == (
        "ERROR",
        "background task rate watch failed: an internal error",
    )
    assert record.exc_info is not None
    assert isinstance(record.exc_info[1], KeyError)
    assert failures == ["failed"]


def test_a_task_that_raises_is_logged_without_anybody_to_call(caplog: pytest.LogCaptureFixture) -> None:
    async def story() -> None:
        await asyncio.wait([BackgroundTasks().start("rate watch", broken())])
        await asyncio.sleep(0)

    asyncio.run(story())
    assert [record.levelname for record in caplog.records] == ["ERROR"]


def test_a_task_that_ends_or_is_cancelled_is_no_failure(caplog: pytest.LogCaptureFixture) -> None:
    failures: list[str] = []
    ended: list[str] = []

    async def story() -> None:
        tasks = BackgroundTasks(lambda: failures.append("failed"))
        for name, work in (("brief", brief()), ("endless", endless())):
            tasks.start(name, work, lambda task: ended.append(task.get_name()))
        for _ in range(3):
            await asyncio.sleep(0)
        assert ended == ["brief"]
        tasks.cancel_all()
        for _ in range(3):
            await asyncio.sleep(0)

    asyncio.run(story())
    assert ended == ["brief", "endless"]
    assert (failures, caplog.records) == ([], [])


def test_cancelling_leaves_nothing_running() -> None:
    async def story() -> set[str]:
        tasks = BackgroundTasks()
        for n in range(3):
            tasks.start(f"endless {n}", endless())
        await asyncio.sleep(0)
        tasks.cancel_all()
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        return {task.get_name() for task in asyncio.all_tasks()} - {"story"}

    async def named() -> set[str]:
        current = asyncio.current_task()
        assert current is not None
        current.set_name("story")
        return await story()

    assert asyncio.run(named()) == set()
