"""Short forms in the file: a bare slave id in place of a mapping; lists become tuples."""

from __future__ import annotations

from typing import Any

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

from lfs10d.schema.fields import Whole, plain_error, shown

SLAVE_ID = Whole(1, 255)


def items(value: object) -> object:
    """Turn a YAML list into a tuple; anything else is an error."""
    if not isinstance(value, list | tuple):
        raise plain_error(f"must be a list, [] for none, not {shown(value)}")
    return tuple(value)


def slave_mapping(value: object) -> object:
    """Turn a bare id into a mapping with that id."""
    if isinstance(value, int) and not isinstance(value, bool):
        return {"id": value}
    if not isinstance(value, dict):
        raise plain_error(
            f"must be a slave id, a whole number from 1 to 255, or a mapping with an id, not {shown(value)}"
        )
    return value


class OrBareId:
    """Adds the bare id that `slave_mapping` permits to the JSON Schema."""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [SLAVE_ID.json_schema(), handler(schema)]}
