"""The decorator `dataclass` as in Python, without the code that it generates for each class.

Python's writes `__eq__`, `__hash__`, `__repr__` and, where frozen, `__setattr__`, `__delattr__` and a slower `__init__`
for every class, and compiles each. For our 250 classes that is a fifth of what an import of the daemon computes, and
1.9 MB (docs/decisions/0006-at-the-wires-limit.md). Here they share one of each, and that a frozen object is not changed
is watched over by the type checker alone. `replace`, `fields` and the like are Python's.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # noqa: PLC0414  # to a type checker it is Python's own
else:

    def dataclass(
        *, frozen: bool = False, slots: bool = False, eq: bool = True, order: bool = False
    ) -> Callable[[type], type]:
        """Return a decorator that makes a class a dataclass; with `order` it is Python's own."""
        if order:
            return dataclasses.dataclass(frozen=frozen, slots=slots, order=True)
        return lambda plain: _completed(
            plain, dataclasses.dataclass(plain, slots=slots, eq=False, repr=False), frozen, eq
        )


def _completed(plain: type, made: Any, frozen: bool, eq: bool) -> type:  # noqa: ANN401, FBT001  # a class with new attributes; flags as Python's
    """Give the class the shared methods that it does not define itself."""
    fields = dataclasses.fields(made)
    methods: dict[str, object] = {"__repr__": _repr}
    if eq:
        made.__compared__ = _values(each.name for each in fields if each.compare)
        methods |= {"__eq__": _equal, "__hash__": None}
    if eq and frozen:
        made.__hashed__ = _values(each.name for each in fields if (each.compare if each.hash is None else each.hash))
        methods["__hash__"] = _hash
    for name, method in methods.items():
        if plain.__dict__.get(name) is None:
            setattr(made, name, method)
    return made  # type: ignore[no-any-return]  # a class


def _values(names: Iterable[str]) -> Callable[[Any], object]:
    """Return a function that returns the values of these attributes of an object."""
    wanted = tuple(names)
    return attrgetter(*wanted) if wanted else staticmethod(lambda _: ())


def _equal(self: Any, other: Any) -> object:  # noqa: ANN401  # of any dataclass
    if other.__class__ is not self.__class__:
        return NotImplemented
    return self.__compared__(self) == self.__compared__(other)


def _hash(self: Any) -> int:  # noqa: ANN401  # of any dataclass
    return hash(self.__hashed__(self))


@recursive_repr()
def _repr(self: Any) -> str:  # noqa: ANN401  # of any dataclass
    shown = ", ".join(f"{each.name}={getattr(self, each.name)!r}" for each in dataclasses.fields(self) if each.repr)
    return f"{type(self).__qualname__}({shown})"
