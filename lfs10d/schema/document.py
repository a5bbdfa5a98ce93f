"""YAML text to data with the line and column of every key and value.

Plain words mean what YAML 1.2 says (`lfs10d.schema.yaml12`). One document, keys of text or whole numbers, no key twice,
no tags but the core schema's. Aliases are allowed within the limits below.

What cannot be read at all raises ConfigError from `parse`; what can be reported beside other problems (a key
given twice, a key that is a list) is kept in `Document.problems`, so that a person sees everything at once.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Mapping
from dataclasses import field
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from lfs10d.errors import ConfigError, Problem
from lfs10d.schema.fields import Hexadecimal, quoted, shown
from lfs10d.schema.messages import KeyPath, in_words, keys_at, missing, unknown_key
from lfs10d.schema.yaml12 import DEEPEST_NESTING, FORMS, TAG, Loader
from lfs10d.system.dataclass import dataclass

LARGEST_FILE = 256 * 1024
"""Bytes: three times a file with every key of 255 slaves written out."""

MOST_VALUES = 50_000
"""Most keys and values after aliases are followed; stops a file of aliases to aliases."""

# U+0085, U+2028 and U+2029 break lines in YAML 1.1 and not in 1.2: refused, or our line numbers would not be an
# editor's. The rest is what YAML calls not printable.
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def decode(raw: bytes, file: str) -> str:
    """Return the text of a file; raises ConfigError if it is too large or no UTF-8."""
    if len(raw) > LARGEST_FILE:
        message = f"the file is too large; at most {LARGEST_FILE // 1024} KiB are read"
        raise ConfigError((Problem(file, 1, 1, "", message),))
    return text_of(raw, file)


def text_of(raw: bytes, file: str) -> str:
    """Return the text of a file without its byte order mark; raises ConfigError if it is no UTF-8."""
    raw = raw.removeprefix(BOM_UTF8)
    try:
        return raw.decode()
    except UnicodeDecodeError as error:
        message = f"byte 0x{raw[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise ConfigError((Problem(file, *_end_of(raw[: error.start].decode()), "", message),)) from None


def _end_of(text: str) -> tuple[int, int]:
    lines = re.split(r"\r\n|\r|\n", text)
    return len(lines), len(lines[-1]) + 1


@dataclass(frozen=True, slots=True)
class DocumentPlace:
    """The place of a value and, in a mapping, of its key: lines and columns from 1."""

    value: tuple[int, int]
    key: tuple[int, int] | None = None


@dataclass(frozen=True)
class Document:
    """Data of dict, list, str, int, float, bool and None; `places` by path; `problems` found while reading.

    `unread` are the paths of values that are among the problems already: there None stands in the data.
    """

    file: str
    data: object
    places: Mapping[KeyPath, DocumentPlace]
    problems: tuple[Problem, ...] = field(default=())
    unread: frozenset[KeyPath] = frozenset()

    def problem(self, path: KeyPath, message: str, *, key: bool = False, shown_path: KeyPath | None = None) -> Problem:
        """Return a problem at the value of `path` (at its key if `key`), or of what surrounds it if absent."""
        known = path
        while known not in self.places:
            known = known[:-1]
        place = self.places[known]
        line, column = place.key if key and place.key and known == path else place.value
        return Problem(self.file, line, column, self._path_text(path if shown_path is None else shown_path), message)

    def _path_text(self, path: KeyPath) -> str:
        """Return the path in words; a whole number is the key of a mapping or the index of a list."""
        named = tuple(
            str(step) if (place := self.places.get(path[: depth + 1])) and place.key else step
            for depth, step in enumerate(path)
        )
        return path_text(named)

    def holds(self, path: KeyPath) -> bool:
        """Return whether the file itself has a value at this path."""
        return path in self.places

    def line_of(self, path: KeyPath) -> int:
        """Return the line of the value, or of the mapping or list around it."""
        return self.problem(path, "").line

    def problems_of(self, error: ValidationError, model: type[BaseModel] | None = None) -> tuple[Problem, ...]:
        """Return pydantic's errors as problems with places, in order of place; values in `unread` are reported already.

        With the `model` that was validated, an unknown key is answered with the nearest known one.
        """
        details = (detail for detail in error.errors(include_url=False) if not self._is_unread(detail))
        return tuple(sorted(self._problem_of(detail, model) for detail in details))

    def _is_unread(self, detail: ErrorDetails) -> bool:
        # An unknown key is a mistake of its own, whatever its value is.
        return detail["type"] != "extra_forbidden" and self._walked(detail["loc"]) in self.unread

    def _problem_of(self, detail: ErrorDetails, model: type[BaseModel] | None) -> Problem:
        path = self._walked(detail["loc"])
        match detail["type"]:
            case "missing":
                return self.problem(path[:-1], missing(model, path), shown_path=path)
            case "extra_forbidden":
                known = keys_at(model, path[:-1]) if model else ()
                return self.problem(path, unknown_key(str(path[-1]), known), key=True)
            case "invalid_key":
                return self.problem(path, "is not a known key; keys are text here", key=True)
            case _ if detail["loc"][-1:] == ("[key]",):
                return self.problem(path[:-1], f"the key {in_words(detail)}", key=True)
            case _:
                known = keys_at(model, path[:-1]) if model and path else ()
                # Steps of pydantic's own (a member of a union) lead to nothing a person wrote.
                there = path in self.places or not path or path[-1] in known
                return self.problem(path if there else path[:-1], in_words(detail))

    def _walked(self, location: tuple[int | str, ...]) -> KeyPath:
        """Drop the steps that pydantic adds for its unions and validators: they are not in the file."""
        path: KeyPath = ()
        for index, step in enumerate(location):
            if (*path, step) in self.places or index == len(location) - 1:
                path = (*path, step)
        return path


def path_text(path: KeyPath) -> str:
    """Return `slaves[0].id`; steps that are no plain word in quotes."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            word = step if re.fullmatch(r"[A-Za-z0-9_-]{1,64}", step) else quoted(step)
            text += f".{word}" if text else word
    return text


def parse(text: str, file: str) -> Document:
    """Read one YAML document; raises ConfigError if it cannot be read at all."""
    odd = _UNPRINTABLE.search(text)
    if odd is not None:
        message = f"the character U+{ord(odd[0]):04X} may not stand in the file; write it as an escape in quotes"
        raise ConfigError((Problem(file, *_end_of(text[: odd.start()]), "", message),))
    loader = Loader(text)
    try:
        node = loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark or loader.get_mark()
        raise ConfigError((Problem(file, mark.line + 1, mark.column + 1, "", _syntax(error)),)) from None
    except (yaml.YAMLError, ValueError, OverflowError):
        # Numbers that PyYAML converts without looking: "\UFFFFFFFF", %YAML 1.999...
        mark, message = loader.get_mark(), "is not valid YAML: a number is out of range"
        raise ConfigError((Problem(file, mark.line + 1, mark.column + 1, "", message),)) from None
    if node is None:
        raise ConfigError((Problem(file, 1, 1, "", "the file is empty"),))
    reader = _NodeReader(file)
    data = reader.read(node, (), None)
    return Document(file, data, reader.places, tuple(sorted(reader.problems)), frozenset(reader.unread))


def _syntax(error: yaml.MarkedYAMLError) -> str:
    problem = str(error.problem)
    if "'\\t'" in problem:
        return "a tab may not indent or separate here; use spaces"
    if "'%'" in problem:
        return 'a percent sign cannot begin a plain word; put it in quotes: "%"'
    if "but found another document" in problem:
        return "a second document begins here; the file may hold only one"
    context = f" ({error.context})" if error.context else ""
    return f"is not valid YAML: {problem}{context}".replace("\n", " ")


_UNREAD = object()
"""In place of a value that is among the problems."""


class _NodeReader:
    """Turns nodes into data, notes every place, collects problems."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.places: dict[KeyPath, DocumentPlace] = {}
        self.problems: list[Problem] = []
        self.unread: list[KeyPath] = []
        self.open: list[int] = []
        self.values = 0

    def read(self, node: Node, path: KeyPath, key: tuple[int, int] | None) -> object:
        self.values += 1
        if self.values > MOST_VALUES or len(path) > DEEPEST_NESTING:
            message = "is too large or too deep to read (an alias counts as its content)"
            raise ConfigError((self.problem(node, path, message),))
        self.places[path] = DocumentPlace(_place(node), key)
        match node:
            case ScalarNode():
                value = self.scalar(node, path)
                if value is _UNREAD:
                    self.unread.append(path)
                    return None
                return value
            case SequenceNode():
                return self.within(node, "seq", path, self.sequence)
            case MappingNode():
                return self.within(node, "map", path, self.mapping)
        raise TypeError(type(node))  # pragma: no cover  # PyYAML has no fourth kind of node

    def within(self, node: Any, word: str, path: KeyPath, reader: Any) -> object:  # noqa: ANN401 - a node of any reader
        if id(node.value) in self.open:
            raise ConfigError((self.problem(node, path, "an alias may not contain itself"),))
        if node.tag != TAG + word:
            self.report(node, path, f"the tag {quoted(node.tag)} is not known; leave it out")
        self.open.append(id(node.value))
        data = reader(node, path)
        self.open.pop()
        return data

    def sequence(self, node: SequenceNode, path: KeyPath) -> list[object]:
        return [self.read(item, (*path, index), None) for index, item in enumerate(node.value)]

    def mapping(self, node: MappingNode, path: KeyPath) -> dict[str | int, object]:
        data: dict[str | int, object] = {}
        lines: dict[str | int, int] = {}
        for key_node, value_node in node.value:
            key = self.scalar(key_node, path) if isinstance(key_node, ScalarNode) else [key_node]
            if key is _UNREAD:
                continue
            if isinstance(key, bool) or not isinstance(key, str | int):
                self.report(key_node, path, f"a key must be text or a whole number, not {shown(key)}")
            elif key in lines:
                self.report(key_node, (*path, str(key)), f"is given twice, first in line {lines[key]}; keep one")
            else:
                lines[key] = _place(key_node)[0]
                data[key] = self.read(value_node, (*path, key), _place(key_node))
        return data

    def scalar(self, node: ScalarNode, path: KeyPath) -> object:
        word = str(node.tag).removeprefix(TAG)
        text = str(node.value)
        if word == "str":
            if any("\ud800" <= character <= "\udfff" for character in text):
                self.report(node, path, "holds half a character (a surrogate); write it whole")
                return _UNREAD
            return text
        if word not in FORMS:
            self.report(node, path, f"the tag {quoted(node.tag)} is not known; leave it out")
            return _UNREAD
        if FORMS[word].fullmatch(text) is None:
            self.report(node, path, f"{quoted(text)} does not match its tag; leave the tag out")
            return _UNREAD
        return self.plain(node, word, text, path)

    def plain(self, node: ScalarNode, word: str, text: str, path: KeyPath) -> object:
        match word:
            case "null":
                return None
            case "bool":
                return text.lower() == "true"
            case "float":
                # Python's words for these have no dot; no other number holds a letter but e.
                return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
        try:
            if text[:2] == "0x":
                return Hexadecimal(text[2:], 16)
            return int(text, 0 if text[:2] == "0o" else 10)
        except ValueError:  # more digits than Python converts
            self.report(node, path, "has too many digits")
            return _UNREAD

    def problem(self, node: Node, path: KeyPath, message: str) -> Problem:
        return Problem(self.file, *_place(node), path_text(path), message)

    def report(self, node: Node, path: KeyPath, message: str) -> None:
        self.problems.append(self.problem(node, path, message))


def _place(node: Node) -> tuple[int, int]:
    return node.start_mark.line + 1, node.start_mark.column + 1
