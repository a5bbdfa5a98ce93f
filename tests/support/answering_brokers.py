"""A broker that refuses messages as the test says: MQTT 5 and 3.1.1, as much of it as a publisher needs."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress

from lfs10d.mqtt.cleanup import SECOND_CLIENT

CONNECT, PUBLISH, SUBSCRIBE, PINGREQ, DISCONNECT = 1, 3, 8, 12, 14
BASE = "lfs10d/line0/"


class Capricious:
    """Takes everything but what `answers` says: for a topic under `BASE`, what it gives instead of its PUBACK.

    `receive_maximum` is announced and enforced: a client that exceeds it is thrown out (`exceeded` counts that),
    and each PUBACK comes `delay` seconds late. `delay` None: none comes.
    In an answer `{mid}` stands for the packet identifier. An answer of no bytes, or a DISCONNECT, ends the connection;
    at the next one the will is published.
    The second connection, over which the daemon looks for what is retained, is served and not counted.
    """

    def __init__(self, receive_maximum: int | None = None, delay: float | None = 0.0) -> None:
        self.exceeded = 0
        self.disconnects = 0
        """DISCONNECTs from clients."""
        self.gone = 0
        """Connections that are over."""
        self._receive_maximum = receive_maximum
        self._unacknowledged = 0
        self.delay = delay
        self.answers: dict[str, bytes] = {}
        self.connects = 0
        self._published: list[tuple[str, bytes]] = []
        self._thrown_out = False
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self._clients: list[socket.socket] = []
        self._second: set[socket.socket] = set()
        threading.Thread(target=self._serve, daemon=True).start()

    def taken(self, topic: str) -> list[bytes]:
        """Return what was published to a topic so far, refused or not."""
        return [payload for each, payload in list(self._published) if each == BASE + topic]

    def close(self) -> None:
        """Let nobody in any more, and throw out who is there."""
        for each in (self._server, *self._clients):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._server.accept()
                self._clients.append(client)
                threading.Thread(target=self._talk, args=(client,), daemon=True).start()

    def _talk(self, client: socket.socket) -> None:
        with client, suppress(OSError, EOFError):
            while self._answer(client, client.makefile("rb", buffering=0)):
                pass
            client.shutdown(socket.SHUT_RDWR)
        self.gone += client not in self._second

    def _answer(self, client: socket.socket, stream: socket.SocketIO) -> bool:
        head = _exactly(stream, 1)[0]
        length = shift = 0
        while (byte := _exactly(stream, 1)[0]) & 0x80:
            length |= (byte & 0x7F) << shift
            shift += 7
        body = _exactly(stream, length | byte << shift)
        match head >> 4:
            case 1:
                if SECOND_CLIENT.encode() in body:
                    self._second.add(client)
                else:
                    self.connects += 1
                    self._unacknowledged = 0
                maximum = self._receive_maximum
                properties = b"" if maximum is None else b"\x21" + maximum.to_bytes(2, "big")
                client.sendall(bytes((0x20, 3 + len(properties), 0, 0, len(properties))) + properties)
            case 8:
                filters = body.count(BASE.encode())
                client.sendall(bytes((0x90, 3 + filters)) + body[:2] + b"\x00" + b"\x01" * filters)
                if self._thrown_out:
                    topic = f"{BASE}availability".encode()
                    client.sendall(
                        bytes((0x30, 3 + len(topic) + 7)) + len(topic).to_bytes(2, "big") + topic + b"\x00offline"
                    )
            case 3:
                return self._publish(client, head, body)
            case 12:
                client.sendall(b"\xd0\x00")
            case 14:
                self.disconnects += client not in self._second
                return False
        return True

    def _publish(self, client: socket.socket, head: int, body: bytes) -> bool:
        end = 2 + int.from_bytes(body[:2], "big")
        topic, mid = body[2:end].decode(), body[end : end + 2] if head & 6 else b""
        self._published.append((topic, body[end + len(mid) + 1 :]))  # behind the length of the properties, which is 0
        answer = self.answers.get(topic.removeprefix(BASE))
        if answer is None:
            return not mid or self._acknowledge(client, mid)
        client.sendall(answer.replace(b"{mid}", mid))
        self._thrown_out = not answer.startswith(b"\x40")
        return not self._thrown_out

    def _acknowledge(self, client: socket.socket, mid: bytes) -> bool:
        self._unacknowledged += 1
        if self._receive_maximum is not None and self._unacknowledged > self._receive_maximum:
            self.exceeded += 1
            client.sendall(b"\xe0\x02\x93\x00")
            return False
        if self.delay == 0:
            self._send_ack(client, mid)
        elif self.delay is not None:
            threading.Timer(self.delay, self._send_ack, (client, mid)).start()
        return True

    def _send_ack(self, client: socket.socket, mid: bytes) -> None:
        self._unacknowledged -= 1
        with suppress(OSError):
            client.sendall(b"\x40\x02" + mid)


def _exactly(stream: socket.SocketIO, count: int) -> bytes:
    data = b""
    while len(data) < count:
        more = stream.read(count - len(data))
        if not more:
            raise EOFError
        data += more
    return data
