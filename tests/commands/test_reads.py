"""Polls that requests wait for."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine

from lfs10d.commands.reads import PendingReads, ReadResult, altered
from lfs10d.reading import Fault, FaultCode, Reading
from lfs10d.telemetry.publication import Publication, PublicationKind, retained

SAMPLE = {"device": "a", "wind_speed": 7.5}
PUBLISHED = [
    retained("device/a/availability", "online"),
    Publication("device/a/telemetry", SAMPLE, PublicationKind.SAMPLE, retain=False, qos=1),
    retained("device/a/state", {"v": 1}),
]


def reading(*requests: int, device: str = "a", fault: Fault | None = None) -> Reading:
    return Reading(device, 1.0, None, fault, None, online=True, response_timeout=0.2, requests=requests)


class Line:
    """Notes what is submitted."""

    def __init__(self) -> None:
        self.submitted: list[tuple[str, int]] = []
        self.reads = PendingReads(lambda device, number: self.submitted.append((device, number)))

    async def begin(self, *devices: str) -> list[asyncio.Task[ReadResult | None]]:
        tasks = [asyncio.create_task(self.reads.read(device)) for device in devices]
        await asyncio.sleep(0)
        return tasks


def run(work: Coroutine[None, None, None]) -> None:
    asyncio.run(work)


def test_a_reading_tells_the_request_whose_number_it_has_and_no_other() -> None:
    async def scene() -> None:
        line = Line()
        one, two = await line.begin("a", "a")
        (_, first), (_, second) = line.submitted
        assert first != second
        line.reads.on_reading(reading(), PUBLISHED)
        line.reads.on_reading(reading(second), PUBLISHED)
        assert await two == ReadResult(SAMPLE, None)
        assert not one.done()
        one.cancel()

    run(scene())


def test_one_reading_may_answer_several_and_carries_its_fault() -> None:
    async def scene() -> None:
        line = Line()
        tasks = await line.begin("a", "a")
        fault = Fault(FaultCode.PORT_LOST, "absent")
        line.reads.on_reading(reading(*(number for _, number in line.submitted), fault=fault), PUBLISHED)
        assert await asyncio.gather(*tasks) == [ReadResult(SAMPLE, fault)] * 2

    run(scene())


def test_a_reading_nobody_waits_for_any_more_is_passed_over() -> None:
    async def scene() -> None:
        line = Line()
        (task,) = await line.begin("a")
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        line.reads.on_reading(reading(line.submitted[0][1], 99), PUBLISHED)
        assert task.cancelled()

    run(scene())


def test_what_is_told_twice_counts_once() -> None:
    async def scene() -> None:
        line = Line()
        (task,) = await line.begin("a")
        line.reads.on_reading(reading(line.submitted[0][1]), PUBLISHED)
        line.reads.abandon({"a"})
        assert await task == ReadResult(SAMPLE, None)

    run(scene())


def test_those_who_wait_for_a_device_that_is_gone_are_told_and_the_others_wait_on() -> None:
    async def scene() -> None:
        line = Line()
        gone, stays = await line.begin("a", "b")
        line.reads.abandon({"a", "nobody"})
        assert await gone is None
        assert not stays.done()
        line.reads.on_reading(reading(line.submitted[1][1], device="b"), [])
        assert await stays == ReadResult(None, None)

    run(scene())


def test_what_is_gone_or_another_is_altered_and_what_is_new_is_not() -> None:
    assert altered({"a": 1, "b": 2, "c": 3}, {"a": 1, "b": 5, "d": 4}) == {"b", "c"}
