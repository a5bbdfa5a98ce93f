"""Responses, events and traces wait in order, and apart while their topic is refused."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.outbox.items import Message
from lfs10d.outbox.message_queue import MESSAGES_MOST, MessageQueue
from tests.support.outbox_items import event, trace

NONE: frozenset[str] = frozenset()
EVENTS = frozenset({"event"})


def filled(*messages: Message) -> MessageQueue:
    queue = MessageQueue()
    queue.messages.extend(messages)
    return queue


def test_the_oldest_goes_first() -> None:
    first, second = event("a"), event("b")
    queue = filled(first, second)
    assert queue
    assert [queue.take(queue.messages, NONE) for _ in range(3)] == [first, second, None]
    assert not queue


def test_what_is_refused_waits_apart_and_goes_first_once_lifted() -> None:
    first, second, third = event("a"), event("b"), event("c")
    queue = filled(first, second)
    assert queue.take(queue.messages, EVENTS) is None
    assert not queue
    queue.messages.append(third)
    queue.lifted(frozenset({"response/health"}))
    queue.lifted(EVENTS)
    queue.lifted(EVENTS)
    assert list(queue.messages) == [first, second, third]


def test_a_refused_trace_is_dropped() -> None:
    queue = MessageQueue()
    kept = trace()
    queue.traces.append(trace())
    assert queue.take(queue.traces, frozenset({"line/trace"})) is None
    queue.lifted(frozenset({"line/trace"}))
    assert not queue
    queue.traces.append(kept)
    assert queue.take(queue.traces, NONE) is kept


def test_what_was_under_way_goes_first_if_it_is_of_qos_1_and_there_is_room() -> None:
    first, second = event("a"), event("b")
    queue = filled(second)
    queue.put_back(first)
    queue.put_back(Message(replace(first.publication, qos=0)))
    assert list(queue.messages) == [first, second]
    queue.messages.extend(event("x") for _ in range(MESSAGES_MOST))
    newest = queue.messages[0]
    queue.put_back(first)
    assert queue.messages[0] is newest
