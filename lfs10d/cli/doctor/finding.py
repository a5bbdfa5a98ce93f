"""A finding of the doctor: the state of one thing, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final, Literal, TypeAlias

import click

from lfs10d.system.dataclass import dataclass
from lfs10d.system.logs import escape

Level: TypeAlias = Literal["ok", "warn", "fail"]

COLOURS: Final[dict[Level, str]] = {"ok": "green", "warn": "yellow", "fail": "red"}
AREA_WIDTH: Final = 13


@dataclass(frozen=True, slots=True)
class Finding:
    """The state of one thing; `advice` says what to do, and is empty where all is well."""

    area: str
    level: Level
    text: str
    advice: str = ""


@dataclass(frozen=True, slots=True)
class Area:
    """One thing that is examined, by its name; makes the findings about it."""

    name: str

    def ok(self, text: str) -> Finding:
        """Return the finding that it is as it should be."""
        return Finding(self.name, "ok", text)

    def warn(self, text: str, advice: str) -> Finding:
        """Return a finding that may become a fault, or does not stop lfs10d."""
        return Finding(self.name, "warn", text, advice)

    def fail(self, text: str, advice: str) -> Finding:
        """Return a fault: no wind speed gets from the sensor to the dashboard, or not all of it."""
        return Finding(self.name, "fail", text, advice)


def lines(findings: Iterable[Finding]) -> Iterator[str]:
    """Yield the findings for a person, each with its advice below it."""
    for each in findings:
        level = click.style(f"{each.level:<4}", fg=COLOURS[each.level])
        yield f"{level}  {each.area:<{AREA_WIDTH}} {escape(each.text)}"
        if each.advice:
            yield f"{'':<{AREA_WIDTH + 7}}-> {escape(each.advice)}"


def summary(findings: Iterable[Finding]) -> str:
    """Return how many of each level there are, in words."""
    levels = [each.level for each in findings]
    return f"{levels.count('fail')} failed, {levels.count('warn')} with a warning, {levels.count('ok')} ok"
