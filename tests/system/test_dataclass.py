"""The decorator `dataclass` does what Python's does."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable
from dataclasses import field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from lfs10d.system import dataclass as ours

if TYPE_CHECKING:
    from lfs10d.reading import Fault


def classes(decorate: Callable[..., Any]) -> SimpleNamespace:
    """Return some classes made by `decorate`."""

    @decorate(frozen=True, slots=True)
    class Frame:
        slave: int
        data: bytes = b""
        when: float = field(default=0.0, compare=False)
        parts: tuple[int, ...] = field(default=(), hash=False)
        secret: str = field(default="x", repr=False)

    @decorate(slots=True)
    class Open:
        count: int = 0
        inner: object = None

    @decorate(frozen=True, slots=True)
    class Nothing:
        pass

    @decorate(slots=True, eq=False)
    class Same:
        count: int = 0

    @decorate(frozen=True)
    class Own:
        name: str

        def __eq__(self, other: object) -> bool:
            return isinstance(other, type(self)) and self.name.lower() == other.name.lower()

        def __hash__(self) -> int:
            return hash(self.name.lower())

        def __repr__(self) -> str:
            return "own"

    @decorate(frozen=True, slots=True, order=True)
    class Place:
        line: int
        column: int

    return SimpleNamespace(Frame=Frame, Open=Open, Nothing=Nothing, Same=Same, Own=Own, Place=Place)


OURS, PYTHONS = classes(ours.dataclass), classes(dataclasses.dataclass)

PAIRS: dict[str, Callable[[SimpleNamespace], tuple[object, object]]] = {
    "same": lambda of: (of.Frame(2, b"a"), of.Frame(2, b"a")),
    "another value": lambda of: (of.Frame(2, b"a"), of.Frame(3, b"a")),
    "another in what does not compare": lambda of: (of.Frame(2, when=1.0), of.Frame(2, when=2.0)),
    "another in what is not hashed": lambda of: (of.Frame(2, parts=(1,)), of.Frame(2, parts=(2,))),
    "another class": lambda of: (of.Frame(2), of.Open(2)),
    "no dataclass": lambda of: (of.Frame(2), (2, b"", (), "x")),
    "can be changed": lambda of: (of.Open(2, [1]), of.Open(2, [1])),
    "no fields": lambda of: (of.Nothing(), of.Nothing()),
    "the object alone": lambda of: (of.Same(1), of.Same(1)),
    "its own": lambda of: (of.Own("A"), of.Own("a")),
    "order": lambda of: (of.Place(1, 2), of.Place(1, 2)),
}


def judged(left: object, right: object) -> tuple[object, ...]:
    """Return how two objects compare and hash, and what their text is."""

    def hashes(one: object) -> bool | str:
        try:
            return isinstance(hash(one), int)
        except TypeError:
            return "unhashable"

    alike = hashes(left) is True and hashes(right) is True and hash(left) == hash(right)
    return left == right, left != right, hashes(left), alike, repr(left).rpartition("<locals>.")[2]


@pytest.mark.parametrize("pair", PAIRS)
def test_objects_compare_hash_and_show_as_pythons_do(pair: str) -> None:
    assert judged(*PAIRS[pair](OURS)) == judged(*PAIRS[pair](PYTHONS))


def test_replace_fields_order_and_copies_are_pythons() -> None:
    frame = OURS.Frame(2, b"a", parts=(1,))
    assert dataclasses.replace(frame, slave=3) == OURS.Frame(3, b"a", parts=(1,))
    assert dataclasses.asdict(frame) == dataclasses.asdict(PYTHONS.Frame(2, b"a", parts=(1,)))
    assert copy.deepcopy(frame) == frame
    assert OURS.Place(1, 2) < OURS.Place(1, 3)
    assert not hasattr(frame, "__dict__")


if TYPE_CHECKING:

    def change(fault: Fault) -> None:
        """Be refused by the type checker: were `frozen` unknown to it, it would call the comment below needless."""
        fault.message = "fine"  # type: ignore[misc]  # what is tried here


@ours.dataclass(slots=True)
class Kept:
    """Can be found by pickle."""

    count: int = 0


def test_objects_can_be_pickled() -> None:
    assert pickle.loads(pickle.dumps(Kept(3))) == Kept(3)  # noqa: S301  # our own bytes


def test_an_object_that_holds_itself_has_a_text() -> None:
    ring = OURS.Open()
    ring.inner = ring
    assert repr(ring).endswith("Open(count=0, inner=...)")
