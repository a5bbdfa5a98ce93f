"""The format of requests and responses: envelope, parameters, response. Plain values, no I/O.

A request is a JSON object of at most 4 KiB with an optional `id` (or `transaction`, which is the same); the rest of
its keys are parameters.
"""

from __future__ import annotations

import json

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails, from_json

from lfs10d.command import Command, Identifier, Result, rejected
from lfs10d.schema.fields import quoted
from lfs10d.schema.messages import in_words
from lfs10d.telemetry.publication import VERSION

LARGEST = 4096
"""Bytes of a request's payload."""
LARGEST_CORRELATION = 1024
"""Bytes of a request's Correlation Data."""
LONGEST_ID = 64
"""Characters of a request's `id`."""


class Parameters(BaseModel):
    """The parameters of one request; strict, since lax validation turns `{"to": true}` into slave 1."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class NoParameters(Parameters):
    """A request that takes none."""


def read(payload: bytes) -> tuple[Command, Result | None]:
    """Read a payload of at most `LARGEST` bytes; returns a rejection if it is wrong as a whole.

    It is `invalid_json`, or `invalid_param` for an id that is none.
    """
    try:
        content = from_json(payload, allow_inf_nan=False)
    except ValueError:
        return Command(), rejected("invalid_json", "the payload is no JSON in UTF-8")
    try:
        # The parser above takes the last of two; this one is asked second, for it minds neither depth nor NaN.
        json.loads(payload, object_pairs_hook=_once)
    except _TwiceError as error:
        return Command(), rejected("invalid_json", f"{quoted(str(error))} is given twice; keep one")
    if not isinstance(content, dict):
        return Command(), rejected("invalid_json", 'the payload must be a JSON object, {"id": "a1"} for example')
    ids: dict[str, Identifier | None] = {}
    problem = None
    for key in ("id", "transaction"):
        value = content.pop(key, None)
        ids[key] = value if _is_identifier(value) else None
        if value is not None and ids[key] is None and problem is None:
            message = f"{key}: must be text of at most {LONGEST_ID} characters or a whole number"
            problem = rejected("invalid_param", message, param=key)
    try:
        fingerprint = json.dumps(content, sort_keys=True, allow_nan=False)
    except ValueError:  # 1e999 is read as infinity
        problem = rejected("invalid_json", "the payload holds a number that is too large")
        return Command(ids["id"], ids["transaction"]), problem
    return Command(ids["id"], ids["transaction"], content, fingerprint), problem


class _TwiceError(Exception):
    """An object has this key twice."""


def _once(pairs: list[tuple[str, object]]) -> None:
    """Raise _TwiceError at the second of two equal keys."""
    seen: set[str] = set()
    for key, _ in pairs:
        if key in seen:
            raise _TwiceError(key)
        seen.add(key)


def _is_identifier(value: object) -> bool:
    if isinstance(value, str):
        return len(value) <= LONGEST_ID
    return isinstance(value, int) and not isinstance(value, bool)


def parameters_of(form: type[Parameters], command: Command) -> Parameters | Result:
    """Return the parameters in their form, or the rejection that names the first wrong one."""
    try:
        return form.model_validate(command.parameters)
    except ValidationError as error:
        details = error.errors(include_url=False)
        unknown = (detail for detail in details if detail["type"] == "extra_forbidden")
        return _refused(form, next(unknown, details[0]))  # the slip of a key explains why another is missing


def _refused(form: type[Parameters], detail: ErrorDetails) -> Result:
    param = str(detail["loc"][0]) if detail["loc"] else None
    if param is not None and len(param) > LONGEST_ID:
        param = f"{param[: LONGEST_ID - 3]}..."
    match detail["type"]:
        case "extra_forbidden":
            known = ", ".join(field.alias or key for key, field in form.model_fields.items())
            words = f"is no parameter of this request; it takes {known or 'none'}"
        case "missing":
            words = "is missing"
        case _:
            words = in_words(detail)
    return rejected("invalid_param", words if param is None else f"{param}: {words}", param=param)


def response(command: Command, name: str, result: Result, took_ms: float) -> dict[str, object]:
    """Return the response to a command under the request's `name`."""
    payload: dict[str, object] = {"v": VERSION, "id": command.id}
    if command.transaction is not None:
        payload["transaction"] = command.transaction
    return {
        **payload,
        "request": name,
        "status": result.status,
        "data": result.data,
        "error": result.error(),
        "took_ms": round(took_ms, 1),
    }
