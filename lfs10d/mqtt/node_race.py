"""Finds a node that answers: connects to several, half a second apart, and takes the first that opens.

A node that swallows everything would cost 5 s each round. MQTT is spoken over the connection that is taken and over no
other: never has the daemon two sessions. A node that fails at once is tried again every second while others are still
waited for, and the next is begun without delay.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Sequence
from queue import SimpleQueue

from lfs10d.mqtt.paho_client import CONNECT_TIMEOUT
from lfs10d.mqtt.reasons import NoNodeError, failed
from lfs10d.mqtt.settings import BrokerSettings

STAGGER = 0.5
"""Seconds from one node to the next: a node that answers slowly is still preferred."""

AGAIN = 1.0
"""Seconds from one attempt at a node to the next."""


def _connect(host: str, port: int) -> socket.socket:
    return socket.create_connection((host, port), CONNECT_TIMEOUT)


class NodeRace:
    """One race between nodes; used by a thread that may block.

    `waits` are the seconds before each node but the first is tried, at the earliest. `connect` opens a TCP connection,
    or raises.
    """

    def __init__(
        self,
        nodes: Sequence[BrokerSettings],
        waits: Sequence[float] = (),
        *,
        connect: Callable[[str, int], socket.socket] = _connect,
        stagger: float = STAGGER,
        again: float = AGAIN,
    ) -> None:
        self.node: BrokerSettings | None = None
        """The node that answered; None while none has."""
        self._nodes = tuple(nodes)
        self._waits = (0.0, *waits) if waits else (0.0,) * len(self._nodes)
        self._connect = connect
        self._stagger = stagger
        self._again = again
        self._results: SimpleQueue[tuple[int, socket.socket | Exception]] = SimpleQueue()
        self._turns = [threading.Event() for _ in nodes]
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._failures: dict[int, Exception] = {}

    @property
    def failures(self) -> tuple[tuple[str, str], ...]:
        """Which nodes failed, in turn, and why, in words."""
        return tuple((node.place, failed(caught, node).message) for node, caught in self._failed())

    def _failed(self) -> list[tuple[BrokerSettings, Exception]]:
        return [(self._nodes[number], self._failures[number]) for number in sorted(self._failures)]

    def run(self) -> tuple[BrokerSettings, socket.socket]:
        """Return the first node that answers, and the connection; raise NoNodeError when all have failed."""
        for number in range(len(self._nodes)):
            threading.Thread(target=self._try, args=(number,), name="connect-node", daemon=True).start()
        try:
            while len(self._failures) < len(self._nodes):
                number, result = self._results.get()
                if isinstance(result, socket.socket):
                    self.node = self._nodes[number]
                    return self.node, result
                self._failures[number] = result
                for turn in self._turns[number + 1 : number + 2]:
                    turn.set()
            raise NoNodeError(self._failed())
        finally:
            self._end()

    def _end(self) -> None:
        with self._lock:
            self._over.set()
        for turn in self._turns:
            turn.set()
        while not self._results.empty():
            _, result = self._results.get()
            if isinstance(result, socket.socket):
                result.close()

    def _try(self, number: int) -> None:
        node = self._nodes[number]
        begun, wait = time.monotonic(), self._waits[number]
        self._turns[number].wait(number * self._stagger)
        self._over.wait(max(0.0, wait - (time.monotonic() - begun)))
        opened: socket.socket | None = None
        while not self._over.is_set() and opened is None:
            begun = time.monotonic()
            result: socket.socket | Exception
            try:
                result = opened = self._connect(node.host, node.port)
            except Exception as caught:  # noqa: BLE001 - whatever it is, another node may answer
                result = caught
            with self._lock:
                if not self._over.is_set():
                    self._results.put((number, result))
                elif opened is not None:
                    opened.close()
            if opened is None:
                self._over.wait(max(0.0, self._again - (time.monotonic() - begun)))
