"""What refuses to be read after the write: a gateway that speaks for the sensor, or the sensor itself."""

from __future__ import annotations

import pytest

from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import SILENCE, IdentityReply
from lfs10d.reconfiguration.procedures.readdress import (
    ReaddressEnding,
    ReaddressFinding,
    ReaddressReport,
    absent,
    free,
    judge,
    read_both,
)
from tests.support.sensors import Pretence

OLD, NEW = Endpoint(slave=3, baudrate=9600), Endpoint(slave=9, baudrate=9600)
MOVED = IdentityReply(answers=True, register=9)
REFUSES = IdentityReply(answers=True, exception=4)
GATEWAY = IdentityReply(exception=11)


@pytest.mark.parametrize(
    ("found", "exception", "ending"),
    [
        (ReaddressFinding(SILENCE, GATEWAY), None, ReaddressEnding.NOWHERE),
        (ReaddressFinding(SILENCE, GATEWAY), 11, ReaddressEnding.NOWHERE),
        (ReaddressFinding(GATEWAY, SILENCE), None, ReaddressEnding.NOWHERE),
        (ReaddressFinding(SILENCE, REFUSES), None, ReaddressEnding.NOWHERE),
        (ReaddressFinding(SILENCE, REFUSES), 4, ReaddressEnding.REFUSED),
        (ReaddressFinding(MOVED, REFUSES), None, ReaddressEnding.BOTH),
    ],
)
def test_what_may_have_stored_the_new_id_stays_open(
    found: ReaddressFinding, exception: int | None, ending: ReaddressEnding
) -> None:
    report = judge(found, 3, exception, 9)
    assert (report.ending, report.stays_open) == (ending, True)


def test_a_gateway_at_the_old_id_hides_no_sensor_at_the_new_one() -> None:
    assert judge(ReaddressFinding(MOVED, GATEWAY), 3, None, 9).ending is ReaddressEnding.MOVED


def test_the_register_is_read_again_where_a_gateway_refused_it(pretence: Pretence) -> None:
    sensor = pretence.sensor(3, stored={5: 9}, exception=11)
    assert pretence.carry_out(read_both(OLD, NEW, pretence.query())).old == GATEWAY
    pretence.later.append((pretence.clock.now + 0.61, lambda: setattr(sensor, "exception", None)))
    assert pretence.carry_out(read_both(OLD, NEW, pretence.query())).old == IdentityReply(answers=True, register=9)


def test_a_gateway_is_no_sensor_that_is_there_and_no_free_place_either(pretence: Pretence) -> None:
    pretence.sensor(3, exception=5)
    reply = pretence.carry_out(pretence.query().read_patiently(OLD))
    assert reply == IdentityReply(exception=5)
    assert absent(reply) == ReaddressReport(ReaddressEnding.ABSENT, exception=5)
    assert not pretence.carry_out(free(OLD, pretence.query()))
