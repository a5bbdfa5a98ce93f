"""Of several nodes the first that answers is taken, and those that swallow everything cost nothing."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator
from queue import SimpleQueue

import pytest

from lfs10d.mqtt.node_race import NodeRace
from lfs10d.mqtt.reasons import DisconnectReason, NoNodeError, failed
from lfs10d.mqtt.settings import BrokerSettings

PATIENCE = 30.0
NODES = BrokerSettings("a", 1883, "id", others=(("b", 1883), ("c", 1883))).nodes


class Net:
    """Nodes that answer, refuse, or swallow everything until the end of the test."""

    def __init__(self, **habits: str) -> None:
        self._habits = habits
        self.tried: SimpleQueue[str] = SimpleQueue()
        self.opened: list[socket.socket] = []
        self.end = threading.Event()
        self.late = threading.Event()
        self.refused = 0

    def connect(self, host: str, port: int) -> socket.socket:
        assert port == 1883
        self.tried.put(host)
        habit = self._habits[host]
        if habit == "swallows":
            self.end.wait(PATIENCE)
            raise TimeoutError
        if habit == "late":
            self.late.wait(PATIENCE)
        elif habit == "refuses" or (habit == "refuses once" and not self.refused):
            self.refused += 1
            raise ConnectionRefusedError
        self.opened.append(socket.socket())
        return self.opened[-1]

    def close(self) -> None:
        self.end.set()
        self.late.set()
        for each in threading.enumerate():
            if each.name == "connect-node":
                each.join(PATIENCE)
        for opened in self.opened:
            opened.close()


@contextlib.contextmanager
def net(**habits: str) -> Iterator[Net]:
    there = Net(**habits)
    try:
        yield there
    finally:
        there.close()


def race(there: Net, *, stagger: float = 0.0, again: float = 0.0) -> NodeRace:
    return NodeRace(NODES, connect=there.connect, stagger=stagger, again=again)


@pytest.mark.parametrize("good", ["a", "b", "c"])
def test_two_nodes_that_swallow_everything_keep_nobody_from_the_third(good: str) -> None:
    with net(**{each: "answers" if each == good else "swallows" for each in "abc"}) as there:
        running = race(there)
        node, opened = running.run()
        assert (node.host, opened, running.node, running.failures) == (good, there.opened[0], node, ())


def test_the_first_in_turn_is_preferred() -> None:
    with net(a="answers", b="answers", c="answers") as there:
        node, _ = race(there, stagger=PATIENCE).run()
        assert (node.host, there.tried.qsize()) == ("a", 1)


def test_a_node_that_fails_at_once_makes_room_for_the_next() -> None:
    with net(a="refuses", b="answers", c="answers") as there:
        running = race(there, stagger=PATIENCE, again=PATIENCE)
        node, _ = running.run()
        assert node.host == "b"
        assert running.failures == (
            ("broker a:1883", "broker a:1883: connection refused: is the broker running, and mqtt.port right?"),
        )


def test_a_node_that_comes_back_is_not_kept_waiting_by_those_that_swallow_everything() -> None:
    with net(a="refuses once", b="swallows", c="swallows") as there:
        node, _ = race(there).run()
        assert node.host == "a"
        assert there.refused == 1


def test_a_node_whose_time_has_not_come_is_left_alone_until_then() -> None:
    with net(a="swallows", b="answers", c="answers") as there:
        node, _ = NodeRace(NODES, (PATIENCE, 0.0), connect=there.connect, stagger=0.0).run()
        assert (node.host, there.tried.qsize()) == ("c", 2)


def test_when_all_have_failed_each_is_named_in_the_same_order_whoever_was_first() -> None:
    with net(a="refuses", b="refuses", c="refuses") as there:
        messages = set()
        for nodes in (NODES, NODES[1:] + NODES[:1]):
            with pytest.raises(NoNodeError) as caught:
                NodeRace(nodes, connect=there.connect, stagger=PATIENCE, again=PATIENCE).run()
            ended = failed(caught.value, nodes[0])
            messages.add(ended.message)
            assert ended.ending is DisconnectReason.UNREACHABLE
        refused = "connection refused: is the broker running, and mqtt.port right?"
        assert messages == {"; ".join(f"broker {host}:1883: {refused}" for host in "abc")}


def test_a_node_that_answers_when_another_is_taken_is_closed() -> None:
    with net(a="late", b="answers", c="late") as there:
        node, opened = race(there).run()
        assert node.host == "b"
        there.close()
        assert [each.fileno() >= 0 for each in there.opened if each is not opened] == [False, False]


def test_nodes_that_answer_at_the_same_time_are_closed_but_for_one() -> None:
    with net(a="answers", b="answers", c="answers") as there:
        _, opened = race(there).run()
        for each in threading.enumerate():
            if each.name == "connect-node":
                each.join(PATIENCE)
        assert opened.fileno() >= 0
        assert all(each.fileno() < 0 for each in there.opened if each is not opened)
