"""Every error code has its few words in the live table."""

from __future__ import annotations

from lfs10d.cli.render.error_words import BESIDE_GOOD, MEANINGS, OF_THE_LINE, in_words
from lfs10d.reading import FaultCode


def test_every_code_has_words_and_no_other_has() -> None:
    assert set(MEANINGS) == {code.value for code in FaultCode}
    assert set(MEANINGS) >= OF_THE_LINE | BESIDE_GOOD


def test_the_words_stand_behind_the_code_and_fit_the_column() -> None:
    assert in_words("wrong_rate") == "wrong_rate, sensors use another rate"
    longest = max((in_words(code) for code in FaultCode if code not in OF_THE_LINE), key=len)
    assert len(f"offline: {longest}; since 20:53") <= 60


def test_an_unknown_code_stands_alone_and_is_safe_to_print() -> None:
    assert in_words("new\x1b[2J") == "new\\x1b[2J"
