"""What a person reads in the log."""

from __future__ import annotations

import logging
from dataclasses import replace

import pytest

from lfs10d.reading import Exchanged, Fault, FaultCode, PortChanged, Purpose, Reading
from lfs10d.telemetry.event_log import EventLog
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample, device_topic, retained

PORT = "/dev/ttyUSB0"
NONE_NOW = "the device reports no value now"


def a_sample(*, good: bool, device: str = "mast") -> Publication:
    sample = Sample(
        device=device, boot="00000000", seq=1, ts=0, clock="synced", values={"wind_speed": 1.0} if good else None,
        units={"wind_speed": "m/s"}, names=("wind_speed",), quality="good" if good else "bad",
        error=None if good else "timeout", rtt_ms=None,
    )  # fmt: skip
    topic = device_topic(device, "telemetry")
    return Publication(topic, sample.payload("line0"), PublicationKind.SAMPLE, retain=False, qos=1, sample=sample)


def an_error(code: str | None, device: str = "mast") -> Publication:
    payload = {"active": code is not None, "code": code, "message": "no answer in 200 ms"}
    return retained(device_topic(device, "error"), payload)


def test_a_partial_sample_is_a_recovery_too() -> None:
    log = EventLog()
    log.on_publications([an_error("timeout")])
    publication = a_sample(good=True)
    assert publication.sample is not None
    partly = replace(publication, sample=replace(publication.sample, quality="partial"))
    assert log.on_publications([partly, an_error(None)]) == [(logging.INFO, "mast: answers well again after timeout")]


def test_a_failing_device_is_told_once_and_its_recovery_too() -> None:
    log = EventLog()

    assert not log.on_publications([a_sample(good=False)])
    risen = log.on_publications([a_sample(good=False), an_error("timeout")])
    turned = log.on_publications([an_error("crc")])
    well = log.on_publications([a_sample(good=True), an_error(None)])

    assert risen == [(logging.WARNING, "mast: timeout: no answer in 200 ms")]
    assert turned == [(logging.DEBUG, "mast: crc: no answer in 200 ms")]
    assert well == [(logging.INFO, "mast: answers well again after crc")]
    assert not log.on_publications([a_sample(good=True), an_error(None)])


def test_an_error_that_is_masked_is_no_recovery_and_may_rise_anew() -> None:
    log = EventLog()
    log.on_publications([an_error("timeout")])

    assert not log.on_publications([an_error(None)])
    assert not log.on_publications([a_sample(good=True, device="other"), an_error(None)])
    assert log.on_publications([an_error("timeout")])[0].level == logging.WARNING


def test_a_device_that_is_removed_is_forgotten() -> None:
    log = EventLog()
    log.on_publications([an_error("timeout")])

    assert not log.on_publications([retained(device_topic("mast", "error"), None)])
    assert log.on_publications([an_error("timeout")])[0].level == logging.WARNING


def test_other_topics_say_nothing() -> None:
    assert not EventLog().on_publications([retained("line/error", {"active": True}), retained("info", {})])


def test_the_port_is_told_with_what_one_should_know_of_it() -> None:
    log = EventLog()

    lost = PortChanged(0.0, Fault(FaultCode.PORT_LOST, f"{PORT}: hung up"))
    assert log.on_event(lost, port=PORT, notices=()) == [
        (logging.WARNING, f"{PORT}: hung up; tried again until it is back")
    ]
    assert log.on_event(PortChanged(0.0, None), port=PORT, notices=("no RS485 mode",)) == [
        (logging.INFO, f"{PORT}: the port is open"),
        (logging.WARNING, "no RS485 mode"),
    ]


def test_a_port_that_is_freed_on_request_is_no_warning() -> None:
    freed = PortChanged(0.0, Fault(FaultCode.PORT_LOST, "freed"), freed=True)
    told = EventLog().on_event(freed, port=PORT, notices=())
    assert told == [(logging.INFO, f"{PORT}: freed for another program")]


@pytest.mark.parametrize(
    ("heard", "fault", "words"),
    [
        (b"\x01\x03", FaultCode.MALFORMED, "slave 1: sent 01 03 00, received 01 03: malformed"),
        (b"", None, "slave 1: sent 01 03 00, received nothing"),
    ],
)
def test_frames_of_an_exchange_are_told_at_debug(heard: bytes, fault: FaultCode | None, words: str) -> None:
    happened = Exchanged(
        at=1.0, asked=0.0, began=0.1, gap=0.004, slave=1, purpose=Purpose.POLL, fault=fault, sent=b"\x01\x03\x00",
        heard=heard,
    )  # fmt: skip
    assert EventLog().on_exchange(happened) == [(logging.DEBUG, words)]


def test_a_learned_rest_is_told_once_with_what_to_set() -> None:
    log = EventLog()
    plain = Reading("mast", 1.0, {"a": 1.0}, None, 0.02, online=True, response_timeout=0.2, request_gap=0.2)
    rested = replace(plain, request_gap=0.4, gap_learned=True)

    def told(reading: Reading) -> list[tuple[int, str]]:
        return [*log.on_event(reading, port=PORT, notices=())]

    assert not told(plain)
    ((level, text),) = told(rested)
    assert level == logging.WARNING
    assert text == (
        "mast: ignores a request right behind another, and is now given 400ms of rest before each (more if that is too "
        "short, see device/mast/config): set request_gap for it in the configuration"
    )
    assert not told(replace(rested, request_gap=0.8))
    assert told(replace(rested, device="other"))


def test_a_value_that_is_missing_is_told_once_for_each_reason() -> None:
    log = EventLog()
    errors = {"rain": FaultCode.EXCEPTION, "humidity": FaultCode.UNAVAILABLE}
    usual = Reading("mast", 1.0, {"wind": 1.0, "rain": None, "humidity": None}, None, 0.02, True, 0.2)  # noqa: FBT003 - online
    partial = replace(usual, value_errors=errors)

    def told(reading: Reading) -> list[tuple[int, str]]:
        return [*log.on_event(reading, port=PORT, notices=())]

    assert told(partial) == [
        (logging.INFO, "mast: rain has no value, the others go on: exception, the device refuses it (logged once)"),
        (logging.INFO, f"mast: humidity has no value, the others go on: unavailable, {NONE_NOW} (logged once)"),
    ]
    assert not told(partial)
    assert not told(usual)
    again = told(replace(partial, value_errors={"rain": FaultCode.OUT_OF_RANGE}))
    assert [text.partition("go on: ")[2] for _, text in again] == [
        "out_of_range, the number is impossible (logged once)"
    ]
    other = told(replace(partial, device="other", value_errors={"rain": FaultCode.NOT_FINITE}))
    assert [text.partition("go on: ")[2] for _, text in other] == ["not_finite, it is NaN or infinite (logged once)"]
    assert not told(replace(partial, device="third", values=None, fault=Fault(FaultCode.UNAVAILABLE, "none")))
