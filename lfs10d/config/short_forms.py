"""Short forms of the file: a bare slave id for a mapping with nothing else, a list for a tuple."""

from __future__ import annotations

from typing import Any

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

from lfs10d.schema.fields import Whole, plain_error, shown

SLAVE_ID = Whole(1, 255)


def items(value: object) -> object:
    """Turn a YAML list into a tuple; refuse anything else."""
    if not isinstance(value, list | tuple):
        raise plain_error(f"must be a list, [] for none, not {shown(value)}")
    return tuple(value)


def slave_mapping(value: object) -> object:
    """Let a bare id stand for a mapping with nothing else."""
    if isinstance(value, int) and not isinstance(value, bool):
        return {"id": value}
    if not isinstance(value, dict):
        raise plain_error(
            f"must be a slave id, a whole number from 1 to 255, or a mapping with an id, not {shown(value)}"
        )
    return value


class OrBareId:
    """Says in the JSON Schema what `slave_mapping` permits."""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [SLAVE_ID.json_schema(), handler(schema)]}
