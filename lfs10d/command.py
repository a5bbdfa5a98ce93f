"""The way down: a command, its result, and its error codes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any, Literal, TypeAlias

from lfs10d.system.dataclass import dataclass

Identifier: TypeAlias = str | int
RequestClass: TypeAlias = Literal["always", "polling", "sensors", "registers"]
Status: TypeAlias = Literal["ok", "rejected", "failed"]
ErrorCode: TypeAlias = Literal[
    "not_recognised",
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


@dataclass(frozen=True, slots=True)
class Result:
    """How a request ended.

    `rejected`: no write was sent and nothing changed. `failed`: a write may have been sent, or the reading asked
    for failed.
    """

    status: Status
    data: object = None
    code: ErrorCode | None = None
    message: str = ""
    facts: Mapping[str, object] = field(default_factory=dict)
    """Further keys of the error object, such as `param` and `exception_code`."""

    def error(self) -> dict[str, object] | None:
        """Return the error object; None where there is none."""
        if self.code is None:
            return None
        return {"code": self.code, "message": self.message, **self.facts}


def ok(data: object = None) -> Result:
    """Return the result of a request that was carried out."""
    return Result("ok", data)


def rejected(code: ErrorCode, message: str, *, param: str | None = None, **facts: object) -> Result:
    """Return the result of a request that changed nothing."""
    return Result("rejected", code=code, message=message, facts={"param": param, **facts})


def failed(code: ErrorCode, message: str, *, data: object = None, **facts: object) -> Result:
    """Return the result of a request that may have sent a write, or whose reading failed."""
    return Result("failed", data, code, message, {"param": None, **facts})


@dataclass(frozen=True, slots=True)
class Command:
    """A request as far as it could be read: its ids, its parameters, and these as one text.

    `topic` (under B) and `correlation` are where its answer goes, once it is being performed.

    Equal fingerprints are equal parameters as JSON sees them: in any order, but 1 is neither true nor 1.0.
    """

    id: Identifier | None = None
    transaction: Identifier | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    fingerprint: str = ""
    topic: str | None = None
    correlation: bytes | None = None

    @property
    def key(self) -> Identifier | None:
        """What identifies a repeat: the id; None: it cannot be identified."""
        return self.transaction if self.id is None else self.id


class RefusedError(Exception):
    """A request is refused while it is carried out; `result` is the rejection."""

    def __init__(self, result: Result) -> None:
        super().__init__(result.message)
        self.result = result
