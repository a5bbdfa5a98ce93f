"""Hostile JSON."""

from __future__ import annotations

import json
import math
from typing import Any

from lfs10d.web.pruned import LONGEST_TEXT, MOST_ITEMS, pruned


def test_what_anybody_may_publish_is_pruned_to_what_a_browser_can_read() -> None:
    deep: Any = 1
    for _ in range(900):
        deep = [deep]
    hostile = {
        "nan": math.nan, "inf": -math.inf, "huge": 10**400, "true": True, "none": None, "half": 0.5, "whole": 7,
        "text": "x" * 10_000, "many": list(range(10_000)), "deep": deep, 5: object(), "keys": {"k" * 1000: 1},
    }  # fmt: skip
    shown = pruned(hostile)
    json.dumps(shown, allow_nan=False)
    assert (shown["nan"], shown["inf"], shown["huge"], shown["true"], shown["none"]) == (None, None, None, True, None)
    assert (shown["half"], shown["whole"], len(shown["text"]), len(shown["many"])) == (0.5, 7, LONGEST_TEXT, MOST_ITEMS)
    assert (shown["deep"], shown["5"]) == ([[[[[None]]]]], None)
