"""Plain tables."""

from __future__ import annotations

from lfs10d.cli.render.table import columns


def test_columns_are_aligned_and_no_line_ends_in_a_space() -> None:
    assert list(columns(("name", "id", "x"), [("a", "200", ""), ("longer", "3", "y")], right=(1,))) == [
        "name     id  x",
        "a       200",
        "longer    3  y",
    ]


def test_a_table_may_have_no_rows() -> None:
    assert list(columns(("name", "id"), [])) == ["name  id"]
