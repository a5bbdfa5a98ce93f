"""Finds answers to earlier requests in what belongs to no other frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from lfs10d.modbus.frame_search import ExpectedFrame, FrameSearch
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import Pending


def find_late_answers(search: FrameSearch, pending: Mapping[int, Sequence[Pending]]) -> Iterator[LateAnswer]:
    """Yield the answers to these requests, by slave id, each slave's oldest first; they are claimed in `search`."""
    rest = search.unclaimed(0)
    for requests in pending.values():
        start = 0
        for each in requests:
            shapes = [shape for shape in each.codec.shapes(each.request) if shape.head in rest]
            candidates = [search.seek(ExpectedFrame(each.codec, shape, start)) for shape in shapes]
            found = min((found for found in candidates if found), key=lambda found: found.begin, default=None)
            if found is not None and not search.claimed(found):
                search.claim(found)
                yield LateAnswer(each.request, max(0.0, found.first_at - each.sent_end), each.ours)
                start = found.end
