"""What comes in: the envelope of a request, its parameters, and the answer to it. Plain values, no I/O.

A request is a JSON object of at most 4 KiB with an optional `id` (or `transaction`, which is the same); the rest of
its keys are parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import from_json

from lfs10d.kinds import PLAIN_ERROR
from lfs10d.telemetry import VERSION

if TYPE_CHECKING:
    from collections.abc import Mapping

LARGEST = 4096
"""Bytes of a request's payload."""
LONGEST_ID = 64
"""Characters of a request's `id`."""

Identifier: TypeAlias = str | int
RequestClass: TypeAlias = Literal["always", "polling", "sensors", "registers"]
Status: TypeAlias = Literal["ok", "rejected", "failed"]
ErrorCode: TypeAlias = Literal[
    "invalid_json",
    "invalid_param",
    "unknown_request",
    "unknown_device",
    "not_allowed",
    "retained",
    "duplicate_conflict",
    "busy",
    "address_in_use",
    "duplicate_id",
    "dip_switch",
    "power_cycle_needed",
    "refused",
    "not_verified",
    "rolled_back",
    "line_error",
    "storage_full",
    "timeout",
    "too_large",
    "rate_limited",
    "cancelled",
    "internal",
]


class Parameters(BaseModel):
    """The parameters of one request; strict, for guessing turns `{"to": true}` into slave 1."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class NoParameters(Parameters):
    """A request that takes none."""


@dataclass(frozen=True, slots=True)
class Answer:
    """How a request ended. `rejected`: no write was sent and nothing changed; `failed`: a write may have been sent."""

    status: Status
    data: object = None
    code: ErrorCode | None = None
    message: str = ""
    facts: Mapping[str, object] = field(default_factory=dict)
    """Further keys of the error object, such as `param` and `exception_code`."""

    OK: ClassVar[Status] = "ok"

    def error(self) -> dict[str, object] | None:
        """Return the error object; None where there is none."""
        if self.code is None:
            return None
        return {"code": self.code, "message": self.message, "param": None, **self.facts}


def rejected(code: ErrorCode, message: str, *, param: str | None = None, **facts: object) -> Answer:
    """Return the answer to a request that changed nothing."""
    return Answer("rejected", code=code, message=message, facts={"param": param, **facts})


def failed(code: ErrorCode, message: str, *, data: object = None, **facts: object) -> Answer:
    """Return the answer to a request that may have sent a write, or asked for a reading that failed."""
    return Answer("failed", data, code, message, facts)


@dataclass(frozen=True, slots=True)
class Call:
    """A request that could be read: `content` is the whole object, `parameters` the same without its ids."""

    id: Identifier | None = None
    transaction: Identifier | None = None
    content: Mapping[str, Any] = field(default_factory=dict)

    @property
    def parameters(self) -> dict[str, Any]:
        """What is asked, in the request's own words."""
        return {key: value for key, value in self.content.items() if key not in {"id", "transaction"}}

    @property
    def key(self) -> Identifier | None:
        """What tells a repeat; None: it cannot be told."""
        return self.transaction if self.id is None else self.id

    def response(self, name: str, answer: Answer, took_ms: float) -> dict[str, object]:
        """Return the response to it under the request's `name`."""
        response: dict[str, object] = {"v": VERSION, "id": self.id}
        if self.transaction is not None:
            response["transaction"] = self.transaction
        return {
            **response,
            "request": name,
            "status": answer.status,
            "data": answer.data,
            "error": answer.error(),
            "took_ms": round(took_ms, 1),
        }


def read(payload: bytes) -> tuple[Call, Answer | None]:
    """Read a payload of at most `LARGEST` bytes; the answer is the rejection of one that cannot be read."""
    try:
        content = from_json(payload, allow_inf_nan=False)
    except ValueError:
        return Call(), rejected("invalid_json", "the payload is no JSON")
    if not isinstance(content, dict):
        return Call(), rejected("invalid_json", 'the payload must be a JSON object, {"id": "a1"} for example')
    ids: dict[str, Identifier | None] = {}
    problem: Answer | None = None
    for key in ("id", "transaction"):
        value = content.get(key)
        ids[key] = _identifier(value)
        if value is not None and ids[key] is None and problem is None:
            message = f"must be text of at most {LONGEST_ID} characters or a whole number"
            problem = rejected("invalid_param", f"{key}: {message}", param=key)
    return Call(ids["id"], ids["transaction"], content), problem


def _identifier(value: object) -> Identifier | None:
    if isinstance(value, bool):
        return None
    if isinstance(value, int):
        return value
    return value if isinstance(value, str) and len(value) <= LONGEST_ID else None


def parameters_of(form: type[Parameters], call: Call) -> Parameters | Answer:
    """Return the parameters in their form, or the rejection that names the first wrong one."""
    try:
        return form.model_validate(call.parameters)
    except ValidationError as error:
        detail = error.errors(include_url=False, include_input=False)[0]
        param = str(detail["loc"][0]) if detail["loc"] else None
        return rejected("invalid_param", f"{_shortened(param)}: {_in_words(form, detail)}", param=_shortened(param))


def _shortened(param: str | None) -> str | None:
    return param if param is None or len(param) <= LONGEST_ID else f"{param[: LONGEST_ID - 3]}..."


def _in_words(form: type[Parameters], detail: Mapping[str, Any]) -> str:
    match detail["type"]:
        case "extra_forbidden":
            known = ", ".join(form.model_fields) or "none"
            return f"no such parameter; known are: {known}"
        case "missing":
            return "is missing"
        case kind if kind == PLAIN_ERROR:
            return str(detail["ctx"]["message"])
        case _:
            return str(detail["msg"])
