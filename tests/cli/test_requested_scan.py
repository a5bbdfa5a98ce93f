"""What a scan by the daemon found, as a person sees it; it came over the network."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.cli.request import show
from lfs10d.cli.requested_scan import SCAN, row

FOUND = {
    "id": 3,
    "baudrate": 9600,
    "known": True,
    "suspect": False,
    "duplicate": False,
    "device": "mast-top",
    "profile": "lfs10",
    "alternatives": [],
    "rtt_ms": 18.2,
}
ANY = st.recursive(st.none() | st.booleans() | st.integers() | st.text(), st.lists, max_leaves=4)


@pytest.mark.parametrize(
    ("entry", "cells"),
    [
        (FOUND, ("3", "9600", "18 ms", "LFS10 wind speed sensor", "polled as mast-top")),
        (
            {**FOUND, "id": 1, "device": None, "rtt_ms": None, "duplicate": True},
            (
                "1",
                "9600",
                "-",
                "LFS10 wind speed sensor",
                "DUPLICATE? garbled answers: two sensors with this id?; the factory id",
            ),
        ),
        (
            {**FOUND, "id": 1, "device": None, "profile": None, "suspect": True},
            ("1", "9600", "18 ms", "unknown device", "SUSPECT: others answer too, so it may be no sensor of its own"),
        ),
        ({**FOUND, "profile": "wind-vane", "device": None}, ("3", "9600", "18 ms", "wind-vane", "")),
        (
            {**FOUND, "id": 144, "device": None, "profile": "ecowitt-wn90lp", "alternatives": ["own", "renke-rs-fxjt"]},
            (
                "144",
                "9600",
                "18 ms",
                "ecowitt WN90LP compact weather station",
                "the factory id; or own or Renke RS-FXJT-N01 wind vane: its answers do not tell which",
            ),
        ),
        ({}, ("None", "None", "-", "unknown device", "")),
    ],
)
def test_each_that_was_found_is_a_row(entry: dict[str, Any], cells: tuple[str, ...]) -> None:
    assert row(entry) == cells


@given(st.dictionaries(st.sampled_from(sorted(FOUND)), ANY))
def test_whatever_the_broker_brings_is_a_row_that_prints(entry: dict[str, Any]) -> None:
    assert all(cell.isprintable() for cell in row(entry))


def test_an_ended_scan_shows_what_it_found_and_why_it_ended(capsys: pytest.CaptureFixture[str]) -> None:
    error = {"code": "cancelled", "message": "the scan was ended after 5 of 9 ids"}
    response = {"request": "line/scan", "status": "failed", "error": error, "data": {"found": [FOUND, "noise"]}}
    assert show(SCAN, response, as_json=False) == 1
    told = capsys.readouterr()
    assert told.err == "line/scan: failed: cancelled: the scan was ended after 5 of 9 ids\n"
    assert [line.split()[0] for line in told.out.splitlines()] == ["id", "3"]
    assert show(SCAN, response, as_json=True) == 1
    assert json.loads(capsys.readouterr().out) == response


def test_who_was_added_is_told_below_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    data = {"found": [], "added": [{"device": "slave-7"}], "not_added": []}
    assert show(SCAN, {"request": "line/scan", "status": "ok", "error": None, "data": data}, as_json=False) == 0
    assert capsys.readouterr().out.splitlines() == [
        "line/scan: ok",
        "No device was found.",
        "added:",
        "  -",
        "    device: slave-7",
        "not_added: []",
    ]
    assert show(SCAN, {"request": "line/scan", "status": "rejected", "error": {}, "data": None}, as_json=False) == 1
