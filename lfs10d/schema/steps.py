"""A kind of value that is one of a few durations."""

from __future__ import annotations

from typing import Any

from lfs10d.schema.fields import Duration
from lfs10d.schema.quantities import DURATION_PATTERN, duration_text
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True)
class Steps(Duration):
    """One of the durations `steps`, which lie from `first` to `last`; `zero` adds 0."""

    steps: tuple[float, ...] = ()

    @property
    def words(self) -> str:
        """All of them."""
        *others, last = [duration_text(step) for step in self.steps]
        return f"{', '.join(others)} or {last}, or 0 ({self.zero})"

    def accept(self, value: object) -> float:
        """Take a number of seconds or text such as 10m that is one of them."""
        duration = super().accept(value)
        if not duration:
            return 0.0
        if duration not in self.steps:
            raise self.refusal(value)
        return duration

    def json_schema(self) -> dict[str, Any]:
        """Return the numbers, or text of the form."""
        numbers = [0, *(int(step) for step in self.steps)]
        return {"anyOf": [{"enum": numbers}, {"type": "string", "pattern": DURATION_PATTERN}]}
