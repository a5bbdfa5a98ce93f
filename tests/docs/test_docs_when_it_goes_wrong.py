"""docs/when-it-goes-wrong.md knows every code, every counter, and the words that lfs10d really says."""

from __future__ import annotations

import dataclasses
import errno
import re
import socket
import ssl
from pathlib import Path

import pytest

from lfs10d.modbus import diagnosis, port_errors
from lfs10d.modbus.port_errors import PortErrorFacts
from lfs10d.modbus.request import ReadRegisters
from lfs10d.mqtt.reasons import REFUSED_FROM, failed, reason_in_words
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.reading import FaultCode, UartCounters
from lfs10d.telemetry.alarms import PRECEDENCE

PAGE = (Path(__file__).parents[2] / "docs" / "when-it-goes-wrong.md").read_text(encoding="utf-8")
BROKER = BrokerSettings("broker.example.org", 1883, "client")


def section(heading: str) -> str:
    """Return what stands under a heading of the third level."""
    found = re.search(rf"^### {re.escape(heading)}$(.*?)(?=^##|\Z)", PAGE, re.MULTILINE | re.DOTALL)
    assert found, f"no section for {heading}"
    return found[1].strip()


@pytest.mark.parametrize("code", FaultCode)
def test_every_code_has_its_section(code: FaultCode) -> None:
    assert section(code.value)


@pytest.mark.parametrize("code", sorted(set(FaultCode) - {FaultCode.DISABLED, FaultCode.PORT_LOST}))
def test_a_section_tells_what_to_do(code: FaultCode) -> None:
    told = section(code.value)
    assert re.search(r"Check:|Cure:|End it|again|replace", told)
    if code not in PRECEDENCE:
        assert re.search(r"^1\. ", told, re.MULTILINE) or code in {FaultCode.NOT_FINITE, FaultCode.CONFIG_CONFLICT}


def test_the_causes_are_numbered_without_gaps() -> None:
    for chapter in re.split(r"^##", PAGE, flags=re.MULTILINE):
        numbers = [int(number) for number in re.findall(r"^(\d+)\. ", chapter, re.MULTILINE)]
        assert numbers == list(range(1, len(numbers) + 1)), chapter[:40]


@pytest.mark.parametrize(
    "counter",
    ["break" if field.name == "breaks" else field.name for field in dataclasses.fields(UartCounters)],
)
def test_every_counter_of_the_adapter_has_its_section(counter: str) -> None:
    assert section(counter)


@pytest.mark.parametrize(
    "said",
    [
        diagnosis.silent(0.2),
        diagnosis.broken(bytes(9), 9, begun=True),
        diagnosis.broken(bytes(5), 9, begun=True),
        diagnosis.broken(bytes(1), 9, begun=False),
        diagnosis.late(0.6123),
        diagnosis.babble(0.2),
        diagnosis.changed_echo(),
        diagnosis.refusal(2, ReadRegisters(2, 1, 2)),
    ],
    ids=lambda said: said.message[:30],
)
def test_a_failure_is_quoted_in_its_section_as_it_is_logged(said: diagnosis.Diagnosis) -> None:
    assert f"{said.code}: {said.message}\n" in section(said.code.value)


def test_an_echo_that_nobody_expected_is_quoted() -> None:
    assert diagnosis.silent(0.2, own=True).message.partition("200 ms ")[2] in section("timeout")


@pytest.mark.parametrize(
    ("heading", "said"),
    [
        ("port_busy", port_errors.refusal("/dev/ttyUSB0", errno.EBUSY, PortErrorFacts(holder="mbpoll (process 4711)"))),
        ("Not there", port_errors.refusal("/dev/serial/by-id/usb-...", errno.ENOENT, PortErrorFacts())),
        ("Hung up", port_errors.hung_up("/dev/ttyUSB0", 0)),
        (
            "Permission denied",
            port_errors.refusal("/dev/ttyUSB0", errno.EACCES, PortErrorFacts(group="dialout", user="lfs10d")),
        ),
    ],
)
def test_a_port_s_trouble_is_quoted_as_it_is_logged(heading: str, said: Exception) -> None:
    whole, _, _ = re.sub(r"\(sudo .*", "(...)", str(said)).partition(" `ls")
    assert whole in section(heading)


@pytest.mark.parametrize(
    "error",
    [
        ConnectionRefusedError(),
        TimeoutError(),
        socket.gaierror(),
        ssl.SSLCertVerificationError(1, "certificate verify failed"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_a_broker_out_of_reach_is_quoted_as_it_is_logged(error: OSError) -> None:
    if isinstance(error, ssl.SSLCertVerificationError):
        error.verify_message = "self-signed certificate"
    said = failed(error, BROKER).message.partition(": ")[2]
    words = said.removeprefix("the name broker.example.org ").partition(": self-signed")[0]
    assert f"| `{words}`" in section("Not connected")


@pytest.mark.parametrize("reason", [0x86, 0x87])
def test_a_refused_login_is_quoted_as_it_is_logged(reason: int) -> None:
    assert reason >= REFUSED_FROM
    assert f"| `{reason_in_words(reason)}`" in section("Not connected")


def test_a_taken_client_id_is_quoted_as_it_is_logged() -> None:
    assert reason_in_words(0x8E) in section("duplicate_client")
