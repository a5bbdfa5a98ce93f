"""Cases of test_laws.py that once failed, each as short as it could be made."""

from __future__ import annotations

from typing import Any, TypeAlias

import pytest

from tests.support.lives import Bench
from tests.support.story import Story

Ails: TypeAlias = tuple[str, dict[str, Any]]

DONE = ("finish", 0)
WELL: Ails = ("none", {})
READS_NEW: Ails = ("dip_locked", {"answer": "echo", "reads": "new"})
STORES: Ails = ("stores_but_ignores", {})
LOSES_ECHOES: Ails = ("echo_losing", {})
POWER_CYCLE: Ails = ("power_cycle", {})
SILENT: Ails = ("silent", {})


def late(delay: float) -> Ails:
    return ("late", {"delay": delay})


def slow(delay: float) -> Ails:
    return ("slow_flash", {"delay": delay})


def gateway(rate: float, delay: float) -> Ails:
    return ("gateway", {"rate": rate, "code": 5, "delay": delay})


ALONE: dict[str, tuple[list[Ails], list[Any]]] = {
    "what a life noted whose power was cut does not reach the disk of the next": (
        [WELL, WELL, WELL],
        [("adopt", 0, 0, ("crash", 0)), ("readdress", "s3", 9, ("leave", 179))],
    ),
    "of two changes that a crash left unanswered the overtaken one is answered too": (
        [STORES, WELL, WELL],
        [("readdress", "s3", 9, ("leave", 247)), ("readdress", "s3", 200, ("leave", 247))],
    ),
    "two changes to one id that a crash left unanswered are answered once each": (
        [READS_NEW, WELL, WELL],
        [("readdress", "s3", 10, ("leave", 166)), ("readdress", "s3", 10, ("leave", 166))],
    ),
    "a change of the rate that is taken back takes back what earlier ones have stored": (
        [STORES] * 3,
        [("baudrate", True, 0, DONE), ("baudrate", False, 0, DONE)],
    ),
    "an adoption goes on while an earlier change is found and answered": (
        [late(0.75), STORES, late(0.35)],
        [
            ("readdress", "s3", 9, ("crash", 6)),
            ("heal", 0, 0, DONE),
            ("plug", 9600, ("at_once", {}), DONE),
            ("adopt", 0, 0, DONE),
        ],
    ),
    "a newcomer that moves at its power cycle is found beside the next one at the factory's id": (
        [WELL] * 3,
        [("plug", 9600, READS_NEW, DONE), ("adopt", 0, 0, DONE), ("plug", 9600, READS_NEW, DONE)],
    ),
    "a newcomer that has the line's rate already is not taken for the next one at the other rate": (
        [WELL] * 3,
        [("plug", 19200, READS_NEW, DONE), ("adopt", 0, 0, DONE), ("plug", 19200, WELL, DONE)],
    ),
    "a change of the rate waits for no proof of an answer at the rate before": (
        [late(0.35), ("silent", {"first": 4.0, "last": 9.0}), WELL],
        [("baudrate", False, 0, DONE)],
    ),
}
TWINNED: dict[str, tuple[list[Ails], tuple[Ails, Ails | None], float, list[Any]]] = {
    "a slow one of two that part is heard at the new id": (
        [late(0.75), late(0.35), late(0.35)],
        (READS_NEW, READS_NEW),
        0.04,
        [("readdress", "s3", 10, DONE)],
    ),
    "one that stores a rate while its twin obeys is not left behind": (
        [POWER_CYCLE, WELL, WELL],
        (WELL, WELL),
        0.005,
        [("baudrate", True, 0, DONE)],
    ),
    "one that is deaf while its twin is brought back is looked for once more": (
        [slow(5.0), POWER_CYCLE, slow(5.0)],
        (WELL, WELL),
        0.04,
        [("baudrate", True, 0, DONE)],
    ),
    "the second answer of a late twin does not hide that the first one has stored a rate": (
        [STORES, WELL, WELL],
        (WELL, None),
        0.035,
        [("baudrate", False, 0, DONE)],
    ),
    "one that waits for its power cycle is not taken for its slow twin at the new rate": (
        [POWER_CYCLE, WELL, WELL],
        (late(0.35), None),
        0.009,
        [("baudrate", True, 0, DONE), ("baudrate", True, 0, ("sigterm", 71)), ("wait", 20.0, 0, DONE)],
    ),
    "one of two that the daemon finds parted after a crash forgets the id of the other": (
        [late(0.35), WELL, WELL],
        (POWER_CYCLE, None),
        0.0055,
        [("readdress", "s3", 10, ("leave", 184)), ("wait", 20.0, 0, DONE)],
    ),
    "two that meet again before the daemon could part them had one id before": (
        [late(0.35), READS_NEW, READS_NEW],
        (STORES, None),
        0.04,
        [("readdress", "s3", 10, ("leave", 380))],
    ),
    "one that is silent has its twin taken for it at a change of the rate": (
        [SILENT, READS_NEW, LOSES_ECHOES],
        (LOSES_ECHOES, slow(1.0)),
        0.009,
        [("baudrate", False, 0, DONE)],
    ),
    "one that is deaf since the change before has its twin taken for it": (
        [slow(5.0), WELL, WELL],
        (WELL, None),
        0.005,
        [("baudrate", False, 0, DONE), ("baudrate", False, 0, DONE)],
    ),
    "one whose twin is deaf since the change before moves without it": (
        [WELL, WELL, WELL],
        (slow(5.0), None),
        0.005,
        [("baudrate", False, 0, DONE), ("baudrate", False, 0, DONE)],
    ),
    "one that is silent has its twin taken for it at a change of the id": (
        [("silent", {"first": 8.0}), WELL, WELL],
        (WELL, WELL),
        0.005,
        [("wait", 6.0, 0, DONE), ("readdress", "s3", 10, ("sigterm", 228))],
    ),
    "to one that is silent its twin, taken for it and moved away, is brought back": (
        [SILENT, WELL, WELL],
        (WELL, None),
        0.005,
        [("readdress", "s3", 9, DONE), ("readdress", "s3", 3, DONE)],
    ),
}


BESIDES: dict[str, tuple[list[Ails], list[Ails], list[Any]]] = {
    "one that stored an id while a gateway refuses its register stays open": (
        [("silent", {"first": 4.0, "last": 9.0}), READS_NEW, WELL],
        [gateway(0.1, 0.3), gateway(0.3, 0.3), gateway(0.3, 0.05)],
        [("adopt", 0, 0, DONE), ("readdress", "s4", 10, DONE)],
    ),
    "an id that one behind a gateway may have stored is not given to another": (
        [("silent", {"first": 4.0, "last": 9.0}), READS_NEW, WELL],
        [gateway(0.1, 0.3), gateway(0.3, 0.3), gateway(0.3, 0.3)],
        [("adopt", 0, 0, DONE), ("readdress", "s4", 10, DONE), ("readdress", "s3", 10, DONE)],
    ),
    "a slave that another master asks in a rhythm is not waited for without an end": (
        [late(0.35), WELL, WELL],
        [WELL] * 3,
        [
            ("master", (3, 3, 0, 1, 0, 1), 1.0, DONE),
            ("baudrate", False, 0, ("crash", 0)),
            ("readdress", "s3", 10, DONE),
        ],
    ),
}


def test_a_late_twin_beside_a_repeater_is_not_left_with_another_rate_stored(bench: Bench) -> None:
    besides: list[Ails] = [("repeated", {"rate": 0.3, "delay": 0.037}), ("twin", {"delay": 0.02}), WELL]
    story = Story(bench, [WELL] * 3, besides=besides, twin=STORES, turnaround=0.052)
    story.tell([("baudrate", False, 0, DONE), ("readdress", "s3", 10, DONE)])


@pytest.mark.parametrize("tale", BESIDES)
def test_a_line_with_gateways_or_another_master(bench: Bench, tale: str) -> None:
    ails, besides, steps = BESIDES[tale]
    story = Story(bench, ails, besides=besides)
    story.tell(steps)
    story.newcomers_known()


@pytest.mark.parametrize("tale", ALONE)
def test_a_line_of_different_ids(bench: Bench, tale: str) -> None:
    ails, steps = ALONE[tale]
    story = Story(bench, ails)
    story.tell(steps)
    story.newcomers_known()


@pytest.mark.parametrize("tale", TWINNED)
def test_a_line_on_which_two_share_an_id(bench: Bench, tale: str) -> None:
    ails, (twin, stranger), turnaround, steps = TWINNED[tale]
    Story(bench, ails, twin=twin, stranger=stranger, turnaround=turnaround).tell(steps)
