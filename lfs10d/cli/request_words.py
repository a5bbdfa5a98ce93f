"""Requests and their parameters in words: list, help, completion by the Tab key. Pure."""

from __future__ import annotations

import inspect
import json
import textwrap
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Annotated, Any, Final, get_args, get_origin

from pydantic.fields import FieldInfo

from lfs10d.cli.render.foreign import named
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.schema.fields import Choice, Duration, FieldKind, Flag
from lfs10d.schema.quantities import duration_text
from lfs10d.system.dataclass import dataclass

WIDTH: Final = 79
"""Longest line in columns, for a terminal of 80."""
CLASSES: Final = ("always", "polling", "sensors", "registers")
"""Classes of requests, as they are listed."""
_SLAVE_IDS: Final = frozenset(map(str, range(1, 256)))
KEEPING: Final = frozenset({"device/options"})
"""Requests that leave unchanged what is not given."""
PRESENT: Final = "the present value"
"""The default of their parameters, in words."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter: its possible values, and its default in words (None: it must be given)."""

    key: str
    words: str
    usual: str | None
    meaning: str
    values: tuple[str, ...]
    """Its possible values, if they are a few words."""


def parameters(name: str) -> tuple[Parameter, ...]:
    """Return the parameters of a request in order; none for one that is not known."""
    known = HANDLERS.get(name)
    if known is None:
        return ()
    fields = known.spec.parameters.model_fields.items()
    return tuple(_parameter(field.alias or key, field, keeping=name in KEEPING) for key, field in fields)


def _parameter(key: str, field: FieldInfo, *, keeping: bool) -> Parameter:
    kinds = [each for each in field.metadata if isinstance(each, FieldKind)] or list(_kinds_within(field.annotation))
    words = kinds[0].words if kinds else "text"
    if not any(isinstance(each, FieldKind) for each in field.metadata):
        words += ", or null"
    values: tuple[str, ...] = ()
    match kinds:
        case [Choice() as choice, *_]:
            values = tuple(map(str, choice.values))
        case [Flag(), *_]:
            values = ("true", "false")
    usual = None if field.is_required() else PRESENT if keeping else _usual(field.default, kinds)
    return Parameter(key, words, usual, field.description or "", values)


def _kinds_within(annotation: Any) -> Iterator[FieldKind]:  # noqa: ANN401  # any annotation
    """Yield the kinds of values within an annotation such as `Annotated[int, Whole(1, 255)] | None`."""
    if get_origin(annotation) is Annotated:
        yield from (each for each in get_args(annotation)[1:] if isinstance(each, FieldKind))
    for inner in get_args(annotation):
        yield from _kinds_within(inner)


def _usual(value: object, kinds: Sequence[FieldKind]) -> str:
    if isinstance(value, float) and any(isinstance(kind, Duration) for kind in kinds):
        return duration_text(value)
    return value if isinstance(value, str) else json.dumps(value)


def does(name: str) -> str:
    """Return a sentence that says what a request does."""
    return " ".join((inspect.getdoc(HANDLERS[name].work) or "").partition("\n\n")[0].split()).replace("`", "")


def listing() -> Iterator[str]:
    """Yield every request with its parameters, those in brackets that may be left out."""
    for name in sorted(HANDLERS, key=lambda name: (CLASSES.index(HANDLERS[name].spec.klass), name)):
        keys = [each.key if each.usual is None else f"[{each.key}]" for each in parameters(name)]
        yield f"{name}  ({HANDLERS[name].spec.klass})"
        yield from _block(does(name))
        if keys:
            yield from _block(f"parameters: {', '.join(keys)}")
    yield ""
    yield "Classes: `commands` in the configuration allows classes of requests; `always` needs no permission."
    yield "The values of each parameter: lfs10d request NAME --help"


def help_of(name: str) -> Iterator[str]:
    """Yield what a request does and what each of its parameters may be."""
    yield f"Usage: lfs10d request {name} [KEY=VALUE]..."
    yield ""
    yield from _block(f"{does(name)} Class {HANDLERS[name].spec.klass}.", "  ")
    yield ""
    known = parameters(name)
    yield "Parameters:" if known else "It takes no parameters."
    for each in known:
        usual = "required" if each.usual is None else f"default {each.usual or 'none'}"
        yield f"  {each.key}"
        yield from _block(f"{each.words.replace('`', '')}; {usual}")
        yield from _block(each.meaning.replace("`", ""))


def _block(text: str, indent: str = "      ") -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)


# What is typed


def named_device(text: str, devices: object) -> str:
    """Return the name of a device that is given by its name or by its slave id.

    `devices` is the payload of topic `devices`. A name comes before an id; what no device has is returned as it is,
    and the daemon rejects it.
    """
    entries = dict(named(devices))
    if text in entries or not is_slave_id(text):
        return text
    return next((name for name, each in entries.items() if each.get("id") == int(text)), text)


def is_slave_id(text: object) -> bool:
    """Whether text given for a device may be its slave id."""
    return isinstance(text, str) and text in _SLAVE_IDS


def completions(name: str, given: Sequence[str], begun: str, known: Mapping[str, Collection[str]]) -> list[str]:
    """Return the completions of `begun`, the word that is being typed after the words `given`.

    `known` are the values of some keys, of `device` for example. Shells give `device=mast` as one word, or (bash) as
    the words `device`, `=` and `mast`.
    """
    keys = {each.key: each for each in parameters(name)}
    key, equals, value = begun.partition("=")
    if equals:
        return [f"{key}={each}" for each in _values(keys.get(key), known) if each.startswith(value)]
    *_, before, last = ("", "", *given)
    key = before if last == "=" else last
    if key in keys and (last == "=" or not begun):
        return [each for each in _values(keys[key], known) if each.startswith(begun)]
    used = {word.partition("=")[0] for word in given}
    return [f"{each}=" for each in keys if each.startswith(begun) and each not in used]


def _values(parameter: Parameter | None, known: Mapping[str, Collection[str]]) -> Collection[str]:
    if parameter is None:
        return ()
    return parameter.values or known.get(parameter.key, ())
