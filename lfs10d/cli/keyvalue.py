"""`KEY=VALUE` of a command line as the parameters of a request: each value as the request's form wants it. Pure."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from typing import Any

from pydantic import ValidationError

from lfs10d.commands import Parameters

IDS = ("id", "transaction")

_HEXADECIMAL = re.compile(r"0x[0-9A-Fa-f]{1,8}")


class KeyValueError(ValueError):
    """An argument is no `KEY=VALUE`, or its key came before; the message is for the person who typed it."""


def content_of(arguments: Iterable[str], form: type[Parameters] | None) -> dict[str, Any]:
    """Return the parameters that the arguments mean; `form` is None for a request that is not known.

    What no reading of a value makes right is passed on as it is: the daemon says what is wrong with it.
    """
    content: dict[str, Any] = {}
    for argument in arguments:
        key, equals, text = argument.partition("=")
        if not key or not equals:
            raise KeyValueError(f"{argument!r} is no KEY=VALUE; write device=mast-top for example")
        if key in content:
            raise KeyValueError(f"{key} is given twice")
        content[key] = text if key in IDS else _value(key, text, form)
    return content


def _value(key: str, text: str, form: type[Parameters] | None) -> Any:  # noqa: ANN401  # any JSON
    readings = list(_readings(text))
    if form is not None:
        return next((value for value in readings if _fits(key, value, form)), readings[-1])
    return readings[-1]


def _readings(text: str) -> Iterator[Any]:
    """Yield what the text may mean: null, the text itself, a hexadecimal number, JSON; where nothing fits, the last."""
    if text == "null":
        yield None
    yield text
    if _HEXADECIMAL.fullmatch(text):  # as registers are written in manuals and profiles
        yield int(text, 16)
    try:
        yield json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        return


def _refuse(constant: str) -> None:
    raise ValueError(constant)  # NaN and Infinity are no JSON


def _fits(key: str, value: object, form: type[Parameters]) -> bool:
    try:
        form.model_validate({key: value})
    except ValidationError as error:
        return all(detail["loc"][:1] != (key,) for detail in error.errors(include_url=False))
    return True
