"""The client finds, keeps and leaves a broker, and says in words why it cannot."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import subprocess
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import TypeAlias

import pytest

from lfs10d.errors import BrokerError
from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.mqtt.messages import Accepted, Filter, Incoming
from lfs10d.mqtt.reasons import Disconnect, DisconnectReason
from lfs10d.mqtt.settings import BrokerSettings, Tls, Version
from lfs10d.system.secret import Secret
from tests.support.brokers import Authority, Mosquitto
from tests.support.old_brokers import Answer, OldBroker

Serving: TypeAlias = Callable[[Answer], AbstractAsyncContextManager[int]]

PATIENCE = 10.0


class Witness:
    """Keeps what a client tells."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.acceptances: list[Accepted] = []
        self.endings: list[Disconnect] = []
        self.acknowledgements: dict[int, int] = {}
        self.subscriptions: dict[int, tuple[int, ...]] = {}
        self.messages: list[Incoming] = []
        self._news = asyncio.Event()

    def accepted(self, accepted: Accepted) -> None:
        self.acceptances.append(accepted)
        self._tell("accepted")

    def ended(self, ended: Disconnect) -> None:
        self.endings.append(ended)
        self._tell("ended")

    def acknowledged(self, mid: int, reason: int) -> None:
        self.acknowledgements[mid] = reason
        self._tell("acknowledged")

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        self.subscriptions[mid] = reasons
        self._tell("subscribed")

    def arrived(self, message: Incoming) -> None:
        self.messages.append(message)
        self._tell("arrived")

    def _tell(self, what: str) -> None:
        self.told.append(what)
        self._news.set()

    async def until(self, claim: Callable[[], bool]) -> None:
        """Wait for news until the claim holds."""
        async with asyncio.timeout(PATIENCE):
            while not claim():
                self._news.clear()
                await self._news.wait()


def settings_of(port: int, **changes: object) -> BrokerSettings:
    facts: dict[str, object] = {"host": "127.0.0.1", "port": port, "client_id": "tester", **changes}
    return BrokerSettings(**facts)  # type: ignore[arg-type]  # the test says which are changed


@contextlib.asynccontextmanager
async def connecting(settings: BrokerSettings) -> AsyncIterator[tuple[BrokerClient, Witness]]:
    """Give a client that has begun, and leave at the end."""
    witness = Witness()
    client = BrokerClient(settings, witness, chance=lambda: 1.0)
    client.start()
    try:
        yield client, witness
    finally:
        await client.leave(1.0)


async def refusal(settings: BrokerSettings) -> str:
    """Return what a person is told when no connection can be made."""
    async with connecting(settings) as (client, _):
        with pytest.raises(BrokerError) as caught:
            await client.opened(PATIENCE)
        return str(caught.value)


# What a connection can do


def test_messages_go_and_come_with_all_that_belongs_to_them(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port)) as (client, witness):
            accepted = await client.opened(PATIENCE)
            assert accepted is await client.opened(PATIENCE)
            assert accepted.version is Version.V5
            connection = client.standing
            assert connection is not None
            subscription = connection.subscribe([Filter("in/#"), Filter("in/too", qos=0)])
            await witness.until(lambda: subscription in witness.subscriptions)
            assert subscription is not None
            assert witness.subscriptions[subscription] == (1, 0)
            mid = connection.publish("in/x", b"payload", retain=True, correlation=b"\0\1")
            await witness.until(lambda: len(witness.messages) == 1 and mid in witness.acknowledgements)
            assert witness.messages == [Incoming("in/x", b"payload", retained=True, correlation=b"\0\1")]
            connection.unsubscribe(["in/#", "in/too"])
            later = connection.publish("in/y", b"")
            await witness.until(lambda: later in witness.acknowledgements)
            assert witness.acknowledgements == {mid: 0, later: 0x10}
            assert len(witness.messages) == 1

    asyncio.run(scenario())


def answering(*packets: bytes) -> Answer:
    """Return a broker that takes anybody, and then says this and nothing more."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.write(b"\x20\x03\x00\x00\x00" + b"".join(packets))
        while await reader.read(1000):
            pass

    return answer


def test_what_is_published_under_the_cork_goes_by_one_segment_when_it_is_taken_off(serving: Serving) -> None:
    segments: list[bytes] = []
    come = asyncio.Event()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.write(b"\x20\x03\x00\x00\x00")
        while data := await reader.read(1000):
            segments.append(data)
            come.set()

    async def scenario() -> None:
        async with serving(answer) as port, connecting(settings_of(port)) as (client, _):
            await client.opened(PATIENCE)
            connection = client.standing
            assert connection is not None
            connection.cork(on=True)
            for number in range(3):
                connection.publish("t", b"%d" % number, qos=0)
                await asyncio.sleep(0.01)
            assert segments == []
            connection.cork(on=False)
            await asyncio.wait_for(come.wait(), PATIENCE)
            assert segments == [b"".join(b"\x30\x05\x00\x01t\x00%d" % number for number in range(3))]
            connection.abandon()
            connection.cork(on=True)  # of a socket that is closed: nothing to be said

    asyncio.run(scenario())


def test_a_topic_that_is_no_utf_8_is_passed_over(serving: Serving, caplog: pytest.LogCaptureFixture) -> None:
    """A broker should not forward one, but this one does."""
    broker = answering(b"\x30\x05\x00\x02\xc3\x28\x00", b"\x30\x04\x00\x01t\x00")

    async def scenario() -> None:
        async with serving(broker) as port, connecting(settings_of(port)) as (_, witness):
            await witness.until(lambda: bool(witness.messages))
            assert [each.topic for each in witness.messages] == ["t"]

    asyncio.run(scenario())
    assert "Traceback" not in caplog.text


@pytest.mark.parametrize("garbage", [b"\x00\x00", b"\x30\xff\xff\xff\xff\xff", b"\x40\x00"])
def test_garbage_from_a_broker_ends_the_connection_and_no_more(
    serving: Serving, garbage: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        async with serving(answering(garbage)) as port, connecting(settings_of(port)) as (_, witness):
            await witness.until(lambda: "ended" in witness.told)

    asyncio.run(scenario())
    assert "Traceback" not in caplog.text


def test_a_reason_code_that_nobody_knows_is_an_answer_like_any_other(serving: Serving) -> None:
    broker = answering(b"\x40\x03\x00\x01\x95", b"\x40\x03\x00\x02\xf7", b"\xe0\x01\xd3")

    async def scenario() -> None:
        async with serving(broker) as port, connecting(settings_of(port)) as (_, witness):
            await witness.until(lambda: bool(witness.endings))
            [ended] = witness.endings[:1]
            assert (ended.ending, ended.reason, ended.by_message) == (DisconnectReason.LOST, 0xD3, True)

    asyncio.run(scenario())


@pytest.mark.parametrize("said", [b"\x20\x03\x00\x00\x00", b"\x20\x06\x00\x00\x03\x13\x00\x01"])
def test_a_broker_that_answers_no_ping_is_given_up(serving: Serving, said: bytes) -> None:
    """Where it names a keepalive, that one counts."""
    heard = bytearray()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        for byte in said:
            writer.write(bytes((byte,)))
            await writer.drain()
        while data := await reader.read(1000):
            heard.extend(data)

    async def scenario() -> None:
        keepalive = 1 if len(said) == 5 else 60
        async with serving(answer) as port, connecting(settings_of(port, keepalive=keepalive)) as (_, witness):
            await witness.until(lambda: "ended" in witness.told)

    asyncio.run(scenario())
    assert heard == b"\xc0\x00"


def test_a_quiet_connection_is_kept_by_pings(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port, keepalive=1)) as (client, witness):
            await client.opened(PATIENCE)
            await asyncio.sleep(3.5)  # three times as long as a broker may wait
            assert witness.told == ["accepted"]

    asyncio.run(scenario())


def test_a_lost_connection_comes_back(mosquitto: Mosquitto, caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port)) as (client, witness):
            await client.opened(PATIENCE)
            mosquitto.kill()
            await witness.until(lambda: "ended" in witness.told)
            assert client.standing is None
            assert client.version is None
            mosquitto.start()
            await witness.until(lambda: witness.told == ["accepted", "ended", "accepted"])

    caplog.set_level(logging.INFO, "lfs10d.mqtt.broker_client")
    asyncio.run(scenario())
    told = [record.getMessage() for record in caplog.records if record.name == "lfs10d.mqtt.broker_client"]
    place = f"broker 127.0.0.1:{mosquitto.port}"
    assert told[0] == f"{place}: connected by MQTT 5"
    assert any(each.startswith(f"{place}: the connection is lost: ") for each in told)
    assert len(told) == len(set(told)) + 1, "each change of state is told once, connecting twice"


def test_a_dropped_connection_is_made_anew(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port)) as (client, witness):
            await client.opened(PATIENCE)
            client.drop("of no use")
            assert [ended.message for ended in witness.endings] == [f"broker 127.0.0.1:{mosquitto.port}: of no use"]
            await witness.until(lambda: len(witness.acceptances) == 2)

    asyncio.run(scenario())


BACK_WITHIN = 3.0
"""Seconds from a broker's return to our connection."""


def test_a_broker_that_was_away_for_long_has_us_back_within_3_s(
    mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many attempts as fit into 10 min fail, in a second: only the return is in real time."""

    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port)) as (client, witness):
            await client.opened(PATIENCE)
            monkeypatch.setattr("lfs10d.mqtt.reconnect.AWAY_EVERY", 0.01)
            mosquitto.kill()
            await witness.until(lambda: "ended" in witness.told)
            await asyncio.sleep(1.0)
            monkeypatch.setattr("lfs10d.mqtt.reconnect.AWAY_EVERY", 1.0)
            mosquitto.start()
            returned = time.monotonic()
            await witness.until(lambda: witness.told == ["accepted", "ended", "accepted"])
            assert time.monotonic() - returned < BACK_WITHIN

    asyncio.run(scenario())


def test_of_several_nodes_the_one_that_accepts_us_is_kept_until_it_is_gone(
    mosquitto: Mosquitto, second_mosquitto: Mosquitto, unused_port: int, caplog: pytest.LogCaptureFixture
) -> None:
    first, second = ("127.0.0.1", mosquitto.port), ("127.0.0.1", second_mosquitto.port)

    async def scenario() -> None:
        async with connecting(settings_of(unused_port, others=(first, second))) as (client, witness):
            await client.opened(PATIENCE)
            assert client.settings.port == mosquitto.port
            mosquitto.kill()
            await witness.until(lambda: len(witness.acceptances) == 2)
            assert client.settings.port == second_mosquitto.port
            mosquitto.start()
            await asyncio.sleep(1.5)
            assert client.settings.port == second_mosquitto.port
            second_mosquitto.kill()
            await witness.until(lambda: len(witness.acceptances) == 3)
            assert client.settings.port == mosquitto.port

    caplog.set_level(logging.INFO, "lfs10d.mqtt.broker_client")
    asyncio.run(scenario())
    told = [record.getMessage() for record in caplog.records if record.name == "lfs10d.mqtt.broker_client"]
    places = {port: f"broker 127.0.0.1:{port}" for port in (unused_port, mosquitto.port, second_mosquitto.port)}
    refused = f"{places[unused_port]}: connection refused: is the broker running, and mqtt.port right?"
    assert told[:2] == [
        f"{refused}; {places[mosquitto.port]} is next",
        f"{places[mosquitto.port]}: connected by MQTT 5",
    ]


def test_a_verb_gives_up_when_no_node_accepts_it(unused_port: int) -> None:
    async def scenario() -> None:
        settings = settings_of(unused_port, others=(("localhost", unused_port),))
        async with connecting(settings) as (client, _):
            with pytest.raises(BrokerError, match=f"broker localhost:{unused_port}: connection refused"):
                await client.opened(PATIENCE)

    asyncio.run(scenario())


# 3.1.1


@pytest.mark.parametrize("refused_by", [b"\x20\x02\x00\x01", b"\x20\x03\x00\x84\x00", b"", None])
def test_a_broker_that_refuses_5_is_spoken_to_in_3_1_1_with_one_warning(
    old_broker: OldBroker, refused_by: bytes | None, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        old_broker.refusal = refused_by
        async with old_broker.running() as port, connecting(settings_of(port)) as (client, witness):
            assert (await client.opened(PATIENCE)).version is Version.V311
            connection = client.standing
            assert connection is not None
            mid = connection.publish("t", b"x", correlation=b"ignored")
            subscription = connection.subscribe([Filter("in")])
            await witness.until(lambda: mid in witness.acknowledgements and subscription in witness.subscriptions)
            assert old_broker.published == [("t", b"x")]
            client.drop("for the test")
            await witness.until(lambda: len(witness.acceptances) == 2)
        assert old_broker.levels == [5, 4, 5, 4]

    asyncio.run(scenario())
    assert sum("refuses MQTT 5" in record.getMessage() for record in caplog.records) == 1


def test_3_1_1_is_spoken_at_once_where_configured(old_broker: OldBroker, caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        settings = {"version": Version.V311}
        async with old_broker.running() as port, connecting(settings_of(port, **settings)) as (client, _):
            await client.opened(PATIENCE)
        assert old_broker.levels == [4]

    asyncio.run(scenario())
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


def test_a_broker_that_tells_of_the_takeover_is_believed_at_once(
    serving: Serving, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        broker = answering(b"\xe0\x02\x8e\x00")
        async with serving(broker) as port, connecting(settings_of(port)) as (client, witness):
            await witness.until(lambda: "ended" in witness.told)
            assert client.duplicate

    asyncio.run(scenario())
    assert "another client has connected with our client id" in caplog.text
    assert "trying again in 60 s" in caplog.text


# Names and passwords


def with_password(broker: Mosquitto, program: Callable[[str], str], folder: Path) -> None:
    """Let only `gate` with password `correct-horse` in."""
    subprocess.run(
        [program("mosquitto_passwd"), "-b", "-c", str(folder / "passwords"), "gate", "correct-horse"], check=True
    )
    broker.stop()
    broker.configuration = ["allow_anonymous false", f"password_file {folder / 'passwords'}"]
    broker.start()


@pytest.mark.parametrize("said", [b"\xe0\x02\x8e\x00", b""])
def test_a_broker_that_ends_the_first_connection_for_our_second_has_shown_no_other_client(
    serving: Serving, said: bytes
) -> None:
    """As mosquitto does with `use_username_as_clientid`."""
    writers: list[asyncio.StreamWriter] = []

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        for before in writers:
            before.write(said)
            before.close()
        writers[:] = [writer]
        writer.write(b"\x20\x03\x00\x00\x00")
        await reader.read(1000)

    async def scenario() -> None:
        async with serving(answer) as port:
            witness, beside = Witness(), Witness()
            client = BrokerClient(settings_of(port), witness, chance=lambda: 1.0, has_second=lambda: True)
            client.start()
            await client.opened(PATIENCE)
            second = client.beside(beside, "-retained")
            await witness.until(lambda: "ended" in witness.told)
            second.abandon()
            assert not client.duplicate
            await client.opened(3.0)
            await client.leave(1.0)

    asyncio.run(scenario())


def test_the_password_is_read_at_each_connect(
    mosquitto: Mosquitto, program: Callable[[str], str], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    with_password(mosquitto, program, tmp_path)
    passwords = iter(["hunter2", "correct-horse"])

    async def scenario() -> None:
        settings = settings_of(mosquitto.port, username="gate", password=lambda: Secret(next(passwords)))
        async with connecting(settings) as (client, witness):
            with pytest.raises(BrokerError, match="not authorized: check"):
                await client.opened(PATIENCE)
            await witness.until(lambda: bool(witness.acceptances))

    asyncio.run(scenario())
    assert "hunter2" not in caplog.text
    assert "correct-horse" not in caplog.text


def test_a_password_that_cannot_be_read_is_said(mosquitto: Mosquitto, tmp_path: Path) -> None:
    def password() -> Secret:
        return Secret((tmp_path / "gone").read_text())

    told = asyncio.run(refusal(settings_of(mosquitto.port, username="gate", password=password)))
    assert told == f"broker 127.0.0.1:{mosquitto.port}: {tmp_path / 'gone'}: no such file or directory"


# TLS


def with_tls(broker: Mosquitto, authority: Authority, *names: str, more: tuple[str, ...] = ()) -> None:
    """Let the broker speak TLS with a certificate for these names."""
    certificate, key = authority.issue("broker", *names)
    broker.stop()
    broker.listener = [f"cafile {authority.ca}", f"certfile {certificate}", f"keyfile {key}", *more]
    broker.start()


def test_tls_with_the_right_authority_connects(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:localhost")

    async def scenario() -> None:
        settings = settings_of(mosquitto.port, host="localhost", tls=Tls(ca=authority.ca))
        async with connecting(settings) as (client, witness):
            await client.opened(PATIENCE)
            connection = client.standing
            assert connection is not None
            mid = connection.publish("t", b"x" * 100_000)
            await witness.until(lambda: mid in witness.acknowledgements)

    asyncio.run(scenario())


def test_tls_with_a_certificate_of_our_own_connects(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:localhost", more=("require_certificate true",))
    certificate, key = authority.issue("gate")

    async def scenario() -> None:
        tls = Tls(authority.ca, certificate, key)
        async with connecting(settings_of(mosquitto.port, host="localhost", tls=tls)) as (client, _):
            await client.opened(PATIENCE)

    asyncio.run(scenario())


def test_an_unknown_authority_is_not_accepted(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:localhost")
    told = asyncio.run(refusal(settings_of(mosquitto.port, host="localhost", tls=Tls())))
    assert "the certificate is not accepted: " in told
    assert "check mqtt.host, mqtt.tls.ca and the clock" in told


def test_another_host_name_is_not_accepted(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:elsewhere.example")
    told = asyncio.run(refusal(settings_of(mosquitto.port, host="localhost", tls=Tls(ca=authority.ca))))
    assert "Hostname mismatch" in told


def test_tls_1_1_is_not_spoken(unused_port: int, authority: Authority, program: Callable[[str], str]) -> None:
    """OpenSSL's own server offers what mosquitto no longer can."""
    certificate, key = authority.issue("broker", "DNS:localhost")
    with subprocess.Popen(
        [program("openssl"), "s_server", "-accept", f"127.0.0.1:{unused_port}", "-cert", certificate,
         "-key", key, "-tls1_1", "-cipher", "ALL:@SECLEVEL=0", "-quiet"],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as server:  # fmt: skip
        try:
            told = "connection refused"
            deadline = time.monotonic() + PATIENCE
            while "connection refused" in told and time.monotonic() < deadline:
                told = asyncio.run(refusal(settings_of(unused_port, host="localhost", tls=Tls(ca=authority.ca))))
        finally:
            server.kill()
    assert "no TLS: " in told


def test_a_plain_port_spoken_to_by_tls_is_said(mosquitto: Mosquitto) -> None:
    told = asyncio.run(refusal(settings_of(mosquitto.port, tls=Tls())))
    assert "check mqtt.port" in told
    assert "TLS" in told


def test_a_tls_port_spoken_to_in_plain_is_said(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:localhost")
    told = asyncio.run(refusal(settings_of(mosquitto.port)))
    assert told.endswith("closed the connection without an answer: check mqtt.port and mqtt.tls")


# Brokers that are not there


def test_a_refused_connection_is_said_and_tried_again(unused_port: int) -> None:
    told = asyncio.run(refusal(settings_of(unused_port)))
    assert told == f"broker 127.0.0.1:{unused_port}: connection refused: is the broker running, and mqtt.port right?"


def test_a_name_that_does_not_exist_is_said() -> None:
    told = asyncio.run(refusal(settings_of(1883, host="broker.invalid")))
    assert told.startswith("broker broker.invalid:1883: the name broker.invalid cannot be resolved")


def test_a_name_that_is_none_is_said() -> None:
    told = asyncio.run(refusal(settings_of(1883, host="a" * 70 + ".example")))
    assert told.startswith(f"broker {'a' * 70}.example:1883: ")


@contextlib.contextmanager
def black_hole() -> Iterator[int]:
    """Give a port where no connection is ever made: the kernel drops what its full queue cannot take."""
    with contextlib.ExitStack() as open_sockets:
        server = open_sockets.enter_context(socket.socket())
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        for _ in range(4):
            filler = open_sockets.enter_context(socket.socket())
            filler.settimeout(0)
            filler.connect_ex(server.getsockname())
        yield server.getsockname()[1]


def test_a_host_that_swallows_everything_holds_up_neither_the_loop_nor_the_end() -> None:
    async def scenario(port: int) -> float:
        witness = Witness()
        client = BrokerClient(settings_of(port), witness)
        client.start()
        began = time.monotonic()
        with pytest.raises(BrokerError, match=r"no answer within 0\.2 s"):
            await client.opened(0.2)
        await client.leave(1.0)
        return time.monotonic() - began

    with black_hole() as port:
        assert asyncio.run(scenario(port)) < 1.5


def test_two_nodes_that_swallow_everything_do_not_keep_us_from_the_third(
    mosquitto: Mosquitto,
) -> None:
    async def scenario(holes: list[tuple[str, int]]) -> None:
        (host, port), *others = *holes, ("127.0.0.1", mosquitto.port)
        async with connecting(settings_of(port, host=host, others=tuple(others))) as (client, witness):
            await client.opened(PATIENCE)
            assert client.settings.port == mosquitto.port
            mosquitto.kill()
            await witness.until(lambda: len(witness.endings) == 1)
            mosquitto.start()
            returned = time.monotonic()
            await witness.until(lambda: len(witness.acceptances) == 2)
            assert time.monotonic() - returned < BACK_WITHIN

    with black_hole() as first, black_hole() as second:
        began = time.monotonic()
        asyncio.run(scenario([("127.0.0.1", first), ("127.0.0.1", second)]))
    assert mosquitto.log.count("as tester") == 2, "one session at a time"
    assert time.monotonic() - began < 2 * 5.0, "nobody waited for both"


def test_what_is_given_up_before_it_was_open_never_speaks_to_the_broker(mosquitto: Mosquitto) -> None:
    given_up = threading.Event()

    def password() -> Secret:
        given_up.wait(PATIENCE)
        return Secret("x")

    async def scenario() -> None:
        client = BrokerClient(settings_of(mosquitto.port, username="gate", password=password), Witness())
        client.start()
        await client.leave(1.0)
        given_up.set()
        for each in threading.enumerate():
            if each.name.startswith(("connect", "paho")):
                await asyncio.to_thread(each.join, PATIENCE)

    asyncio.run(scenario())
    assert "New client connected" not in mosquitto.log


def test_waiters_are_all_told_and_a_late_one_is_told_no_more(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        client = BrokerClient(settings_of(mosquitto.port), Witness())
        with pytest.raises(BrokerError):
            await client.opened(0.0)
        early = asyncio.create_task(client.opened(PATIENCE))
        await asyncio.sleep(0)
        client.start()
        assert await early is await client.opened(PATIENCE)
        await client.leave(1.0)

    asyncio.run(scenario())


def test_a_server_that_says_nothing_holds_up_nothing_either(serving: Serving) -> None:
    async def scenario() -> None:
        heard, gone = asyncio.Event(), asyncio.Event()

        async def silent(reader: asyncio.StreamReader, _writer: asyncio.StreamWriter) -> None:
            await reader.read(1)
            heard.set()
            await reader.read()
            gone.set()

        async with serving(silent) as port:
            client = BrokerClient(settings_of(port), Witness())
            client.start()
            await asyncio.wait_for(heard.wait(), PATIENCE)
            await client.leave(1.0)
            await asyncio.wait_for(gone.wait(), PATIENCE)

    asyncio.run(scenario())
