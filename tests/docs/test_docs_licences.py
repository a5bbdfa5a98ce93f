"""What the Debian package carries: its versions are written down, and each package's licence is in its copyright."""

from __future__ import annotations

import re
import tomllib
import zipfile
from pathlib import Path

import pytest

from docs.generate.licences import UnknownLicenceError, carried, paragraph

ROOT = Path(__file__).parents[2]
MIT = "MIT License\n\nCopyright (c) 2020 Ada\n\nPermission is hereby granted.\n"


def wheel(folder: Path, metadata: str, files: dict[str, str]) -> Path:
    """Write a wheel of a package with one module."""
    path = folder / "cups-1.2-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("cups/__init__.py", "")
        archive.writestr("cups_types.py", "")
        archive.writestr("cups-1.2.dist-info/METADATA", f"Name: cups\nVersion: 1.2\nAuthor: Bob\n{metadata}\n")
        for name, text in files.items():
            archive.writestr(f"cups-1.2.dist-info/{name}", text)
    return path


def test_a_carried_package_has_its_files_its_holders_and_the_text_of_its_licence(tmp_path: Path) -> None:
    made = wheel(tmp_path, "License-Expression: MIT", {"licenses/LICENSE": MIT})
    assert paragraph(carried(made)) == (
        "Files: usr/lib/lfs10d/cups-1.2.dist-info/*\n usr/lib/lfs10d/cups/*\n usr/lib/lfs10d/cups_types.py\n"
        "Copyright: 2020 Ada\n"
        "Comment: cups 1.2, carried unchanged.\n"
        "License: Expat\n"
        " MIT License\n .\n Copyright (c) 2020 Ada\n .\n Permission is hereby granted.\n"
    )


@pytest.mark.parametrize("said", ["License: BSD-3-Clause", "Classifier: License :: OSI Approved :: MIT License"])
def test_a_licence_is_found_wherever_metadata_names_it(said: str, tmp_path: Path) -> None:
    found = carried(wheel(tmp_path, said, {"LICENCE.txt": "Do as you like."}))
    assert found.licence in {"BSD-3-clause", "Expat"}
    assert found.holders == ("Bob",), "the text names nobody"


@pytest.mark.parametrize(
    ("said", "texts", "why"),
    [
        ("License: Beerware", {"LICENSE": "x"}, "cups: Beerware"),
        ("", {"LICENSE": "x"}, "cups: no licence"),
        ("License: MIT", {}, "brings no text of its licence"),
    ],
)
def test_what_nobody_has_looked_at_is_not_carried(said: str, texts: dict[str, str], why: str, tmp_path: Path) -> None:
    with pytest.raises(UnknownLicenceError, match=why):
        carried(wheel(tmp_path, said, texts))


def test_what_is_carried_is_written_down_and_within_the_ranges_of_the_project() -> None:
    written = dict(re.findall(r"^([\w.-]+)==([\d.]+)$", (ROOT / "packaging/carried.txt").read_text(), re.MULTILINE))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    for need in (*project["project"]["dependencies"], *project["build-system"]["requires"]):
        name, lowest, below = re.fullmatch(r"([\w-]+)>=([\d.]+)(?:,<([\d.]+))?", need).groups()  # type: ignore[union-attr]  # each has this form
        version = numbers(written[name.lower()])
        assert numbers(lowest) <= version
        assert below is None or version < numbers(below)


def numbers(version: str) -> list[int]:
    """Return a version as numbers that can be compared."""
    return [int(each) for each in version.split(".")]
