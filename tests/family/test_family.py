"""20 000 exchanges of the family of bad lines through the daemon, in virtual time, held to the simulated line's log."""

from __future__ import annotations

import pytest

from soak.family import LIVES_DIFFER, Account, run_family
from soak.troubles import FAMILY

pytestmark = pytest.mark.long(20)

EXCHANGES = 20_000
SEED = 11


@pytest.fixture(scope="module")
def account() -> Account:
    return run_family(EXCHANGES, SEED, lives=LIVES_DIFFER)


def test_no_wrong_number_no_gap_in_seq_no_request_too_early_and_everybody_recovers(account: Account) -> None:
    assert account.findings == 0, str(account)
    assert account.exchanges >= EXCHANGES
    assert account.good > 0.7 * account.samples


def test_most_numbers_are_attested_and_hardly_any_right_by_construction(account: Account) -> None:
    assert account.by_construction < 0.001 * account.good


def test_every_adapter_had_its_life(account: Account) -> None:
    assert account.lives >= LIVES_DIFFER


@pytest.mark.parametrize("name", FAMILY)
def test_a_fault_alone_has_its_code(account: Account, name: str) -> None:
    fault, seen = FAMILY[name], account.alone[name]
    assert seen.keys() <= fault.first | fault.also | fault.in_pieces | {"good"}
    assert fault.must <= seen.keys()


def test_samples_are_repeated_after_the_broker_was_away(account: Account) -> None:
    assert account.repeated > 0


@pytest.mark.parametrize(("name", "code"), [("late, in the same shape", "late"), ("another count", "malformed")])
def test_what_depends_on_time_outs_and_retries_has_its_code_in_some_life(
    account: Account, name: str, code: str
) -> None:
    assert account.alone[name][code] > 0
