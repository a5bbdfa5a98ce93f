"""`python -m docs.generate.licences FOLDER`: the paragraphs of debian/copyright for the wheels in a folder.

Each names the package's files below /usr/lib/lfs10d, its holders and its licence, with the text that the wheel brings.
"""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from email.message import Message
from email.parser import HeaderParser
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath
from typing import Final

NAMES: Final = {
    "MIT": "Expat",
    "MIT License": "Expat",
    "BSD-3-Clause": "BSD-3-clause",
    "BSD-2-Clause": "BSD-2-clause",
    "EPL-2.0 OR BSD-3-Clause": "EPL-2.0 or BSD-3-clause",
    "PSF-2.0": "PSF-2.0",
}
"""How Debian names a licence, by how a wheel's metadata does. One that is not here was looked at by nobody."""
CLASSIFIER: Final = "License :: OSI Approved :: "
TEXTS: Final = ("licen[cs]e*", "copying*", "e[dp]l-v*")


class UnknownLicenceError(Exception):
    """A package names no licence, or one that nobody has looked at, or brings no text of it: it must not be carried."""


@dataclass(frozen=True, slots=True)
class Carried:
    """One package; `files` are below /usr/lib/lfs10d."""

    name: str
    version: str
    licence: str
    holders: tuple[str, ...]
    files: tuple[str, ...]
    text: str


def carried(wheel: Path) -> Carried:
    """Return what a wheel says of itself. Raises UnknownLicenceError."""
    with zipfile.ZipFile(wheel) as archive:
        names = [PurePosixPath(name) for name in archive.namelist() if not name.endswith("/")]
        info = next(name.parts[0] for name in names if name.parts[0].endswith(".dist-info"))
        metadata = HeaderParser().parsestr(archive.read(f"{info}/METADATA").decode())
        texts = [archive.read(str(name)).decode().strip() for name in names if _is_text(name, info)]
    if not texts:
        raise UnknownLicenceError(f"{wheel.name} brings no text of its licence")
    return Carried(
        name=metadata["Name"],
        version=metadata["Version"],
        licence=_licence(metadata),
        holders=tuple(dict.fromkeys(_holders(texts))) or (_author(metadata),),
        files=tuple(sorted({f"{name.parts[0]}{'/*' if name.parts[1:] else ''}" for name in names})),
        text="\n\n".join(texts),
    )


def _is_text(name: PurePosixPath, info: str) -> bool:
    return name.parts[0] == info and any(fnmatch(name.name.lower(), pattern) for pattern in TEXTS)


def _licence(metadata: Message) -> str:
    classified = [each.removeprefix(CLASSIFIER) for each in metadata.get_all("Classifier", []) if CLASSIFIER in each]
    said = [metadata["License-Expression"], metadata["License"], *classified]
    for each in said:
        if each in NAMES:
            return NAMES[each]
    raise UnknownLicenceError(f"{metadata['Name']}: {next(filter(None, said), 'no licence')}")


def _holders(texts: Iterable[str]) -> Iterator[str]:
    """Yield whom the texts name behind `Copyright`, with the years."""
    for line in "\n".join(texts).splitlines():
        words = line.strip()
        if words.lower().startswith("copyright ") and any(each.isdigit() for each in words):
            yield words[len("copyright ") :].removeprefix("(c) ").removeprefix("(C) ")


def _author(metadata: Message) -> str:
    return str(metadata["Author"] or metadata["Author-email"] or metadata["Maintainer-email"])


def paragraph(package: Carried) -> str:
    """Return the package's paragraph of debian/copyright, with a licence of its own name: texts differ in names."""
    files = "\n ".join(f"usr/lib/lfs10d/{name}" for name in package.files)
    holders = "\n ".join(package.holders)
    text = "\n".join(f" {line.rstrip()}" if line.strip() else " ." for line in package.text.splitlines())
    comment = f"Comment: {package.name} {package.version}, carried unchanged."
    return f"Files: {files}\nCopyright: {holders}\n{comment}\nLicense: {package.licence}\n{text}\n"


if __name__ == "__main__":
    print("\n".join(paragraph(carried(wheel)) for wheel in sorted(Path(sys.argv[1]).glob("*.whl"))), end="")
