"""A bare id and a list as the file may have them."""

from __future__ import annotations

from typing import Annotated

import pytest
from pydantic import BaseModel
from pydantic_core import PydanticCustomError

from lfs10d.config.short_forms import OrBareId, items, slave_mapping


def test_a_list_becomes_a_tuple_and_anything_else_is_refused() -> None:
    assert items([1, 2]) == (1, 2)
    with pytest.raises(PydanticCustomError, match="must be a list"):
        items(3)


def test_a_bare_id_is_a_mapping_with_nothing_else() -> None:
    assert slave_mapping(3) == {"id": 3}
    assert slave_mapping({"id": 3, "name": "mast"}) == {"id": 3, "name": "mast"}
    for wrong in (True, "3", None):
        with pytest.raises(PydanticCustomError, match="must be a slave id"):
            slave_mapping(wrong)


def test_the_json_schema_permits_both_forms() -> None:
    class Model(BaseModel):
        slave: Annotated[dict[str, int], OrBareId()]

    bare, mapping = Model.model_json_schema()["properties"]["slave"]["anyOf"]
    assert (bare["type"], mapping["type"]) == ("integer", "object")
