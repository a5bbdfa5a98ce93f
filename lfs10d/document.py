"""YAML text to data with the line and column of every key and value.

Plain words mean what YAML 1.2 (core schema, section 10.3.2) says: `on`, `no`, `1:30` and `2026-11-21` are text,
`010` is ten, `0o17` is octal, `0x1F` hexadecimal. One document, keys of text or whole numbers, no key twice, no
tags but the core schema's. Aliases are allowed within the limits below.

What cannot be read at all raises ConfigError from `parse`; what can be reported beside other problems (a key
given twice, a key that is a list) is kept in `Document.problems`, so that a person sees everything at once.
"""

from __future__ import annotations

import copy
import difflib
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias, get_args

import yaml
from pydantic import BaseModel
from yaml.composer import Composer
from yaml.emitter import Emitter
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.representer import SafeRepresenter
from yaml.resolver import BaseResolver
from yaml.scanner import Scanner
from yaml.serializer import Serializer

from lfs10d.errors import ConfigError, Problem
from lfs10d.kinds import PLAIN_ERROR, quoted, shown

if TYPE_CHECKING:
    import io
    from collections.abc import Mapping

    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

LARGEST_FILE = 256 * 1024
"""Bytes: three times a file with every key of 255 slaves written out."""

DEEPEST_NESTING = 20
"""Levels of lists and mappings; the configuration needs four."""

MOST_VALUES = 50_000
"""Keys and values after aliases are followed: what a file of aliases to aliases runs into."""

Path: TypeAlias = tuple[str | int, ...]

_TAG = "tag:yaml.org,2002:"
_NULL = re.compile(r"~|null|Null|NULL|")
_BOOL = re.compile(r"true|True|TRUE|false|False|FALSE")
_INT = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(
    r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)
_FORMS = {"null": _NULL, "bool": _BOOL, "int": _INT, "float": _FLOAT}

# U+0085, U+2028 and U+2029 break lines in YAML 1.1 and not in 1.2: refused, or our line numbers would not be an
# editor's. The rest is what YAML calls not printable.
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class _CoreSchema(BaseResolver):
    """Plain words as in YAML 1.2."""


for _word, _form in _FORMS.items():
    # The whole word must fit; the resolver itself would be content with its beginning.
    _CoreSchema.add_implicit_resolver(_TAG + _word, re.compile(f"(?:{_form.pattern})\\Z"), None)


class _Loader(Reader, Scanner, Parser, Composer, _CoreSchema):
    """PyYAML's composer, with the core schema, a greatest depth, and aliases that know where they stand."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)
        Composer.__init__(self)
        _CoreSchema.__init__(self)
        self.depth = 0

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:  # noqa: ANN401  # as PyYAML calls it
        """Compose one node; an alias becomes a node of its own with the place where it stands."""
        event = self.peek_event()  # type: ignore[no-untyped-call]  # types-PyYAML has no signature
        if isinstance(event, yaml.AliasEvent):
            node = copy.copy(super().compose_node(parent, index))
            if node is not None:
                node.start_mark = event.start_mark
            return node
        self.depth += 1
        if self.depth > DEEPEST_NESTING:
            raise yaml.MarkedYAMLError(
                problem=f"nested more than {DEEPEST_NESTING} levels deep", problem_mark=event.start_mark
            )
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


class _Dumper(Emitter, Serializer, SafeRepresenter, _CoreSchema):
    """PyYAML's writer with the core schema, so that text that would read as a number is quoted."""

    def __init__(self, stream: io.StringIO) -> None:
        Emitter.__init__(self, stream, allow_unicode=True, width=100)
        Serializer.__init__(self)
        SafeRepresenter.__init__(self, sort_keys=False)
        _CoreSchema.__init__(self)

    def ignore_aliases(self, data: object) -> bool:
        """Write everything out."""
        del data
        return True


def render(data: object) -> str:
    """Return data as YAML that `parse` reads back as the same data."""
    return str(yaml.dump_all([data], Dumper=lambda stream, **_: _Dumper(stream)))


def decode(raw: bytes, file: str) -> str:
    """Return the text of a file; raises ConfigError if it is too large or no UTF-8."""
    if len(raw) > LARGEST_FILE:
        limit = LARGEST_FILE // 1024
        raise ConfigError((Problem(file, 1, 1, "", f"the file is too large; at most {limit} KiB are read"),))
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = raw[: error.start].decode("utf-8-sig")
        line, column = _end_of(before)
        message = f"byte 0x{raw[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise ConfigError((Problem(file, line, column, "", message),)) from None


def _end_of(text: str) -> tuple[int, int]:
    lines = re.split(r"\r\n|\r|\n", text)
    return len(lines), len(lines[-1]) + 1


@dataclass(frozen=True, slots=True)
class Place:
    """Where a value stands and, in a mapping, its key: lines and columns from 1."""

    value: tuple[int, int]
    key: tuple[int, int] | None = None


@dataclass(frozen=True)
class Document:
    """Data of dict, list, str, int, float, bool and None; `places` by path; `problems` found while reading."""

    file: str
    data: object
    places: Mapping[Path, Place]
    problems: tuple[Problem, ...] = field(default=())

    def problem(self, path: Path, message: str, *, key: bool = False, shown_path: Path | None = None) -> Problem:
        """Return a problem at the value of `path` (at its key if `key`), or of what surrounds it if absent."""
        known = path
        while known not in self.places:
            known = known[:-1]
        place = self.places[known]
        line, column = place.key if key and place.key and known == path else place.value
        return Problem(self.file, line, column, self._path_text(path if shown_path is None else shown_path), message)

    def _path_text(self, path: Path) -> str:
        """Return the path in words; a whole number is the key of a mapping or the index of a list."""
        named = tuple(
            str(step) if (place := self.places.get(path[: depth + 1])) and place.key else step
            for depth, step in enumerate(path)
        )
        return path_text(named)

    def holds(self, path: Path) -> bool:
        """Tell whether the file itself has a value at this path."""
        return path in self.places

    def line_of(self, path: Path) -> int:
        """Return the line of the value, or of what surrounds it."""
        return self.problem(path, "").line

    def problems_of(self, error: ValidationError, model: type[BaseModel] | None = None) -> tuple[Problem, ...]:
        """Return what pydantic found as problems with places, in order of place.

        With the `model` that was validated, an unknown key is answered with the nearest known one.
        """
        return tuple(sorted(self._problem_of(detail, model) for detail in error.errors(include_url=False)))

    def _problem_of(self, detail: ErrorDetails, model: type[BaseModel] | None) -> Problem:
        path = self._walked(detail["loc"])
        match detail["type"]:
            case "missing":
                return self.problem(path[:-1], _missing(model, path), shown_path=path)
            case "extra_forbidden":
                known = _keys_at(model, path[:-1]) if model else ()
                return self.problem(path, _unknown_key(str(path[-1]), known), key=True)
            case "invalid_key":
                return self.problem(path, "is not a known key; keys are text here", key=True)
            case _ if detail["loc"][-1:] == ("[key]",):
                return self.problem(path[:-1], f"the key {_in_words(detail)}", key=True)
            case _:
                known = _keys_at(model, path[:-1]) if model and path else ()
                # Steps of pydantic's own (a member of a union) lead to nothing a person wrote.
                there = path in self.places or not path or path[-1] in known
                return self.problem(path if there else path[:-1], _in_words(detail))

    def _walked(self, location: tuple[int | str, ...]) -> Path:
        """Drop the steps that pydantic adds for its unions and validators: they lead nowhere in the file."""
        path: Path = ()
        for index, step in enumerate(location):
            if (*path, step) in self.places or index == len(location) - 1:
                path = (*path, step)
        return path


def path_text(path: Path) -> str:
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
    """Read one YAML document; raises ConfigError where it cannot be read at all."""
    odd = _UNPRINTABLE.search(text)
    if odd is not None:
        line, column = _end_of(text[: odd.start()])
        message = f"the character U+{ord(odd[0]):04X} may not stand in the file; write it as an escape in quotes"
        raise ConfigError((Problem(file, line, column, "", message),))
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark or loader.get_mark()
        raise ConfigError((Problem(file, mark.line + 1, mark.column + 1, "", _syntax(error)),)) from None
    except (yaml.YAMLError, ValueError, OverflowError):
        # Numbers that PyYAML converts without looking: "\UFFFFFFFF", %YAML 1.999...
        mark = loader.get_mark()
        raise ConfigError(
            (Problem(file, mark.line + 1, mark.column + 1, "", "is not valid YAML: a number is out of range"),)
        ) from None
    if node is None:
        raise ConfigError((Problem(file, 1, 1, "", "the file is empty"),))
    reader = _NodeReader(file)
    data = reader.read(node, (), None)
    return Document(file, data, reader.places, tuple(sorted(reader.problems)))


def _syntax(error: yaml.MarkedYAMLError) -> str:
    problem = str(error.problem)
    if "'\\t'" in problem:
        return "a tab may not indent or separate here; use spaces"
    if "but found another document" in problem:
        return "a second document begins here; the file may hold only one"
    context = f" ({error.context})" if error.context else ""
    return f"is not valid YAML: {problem}{context}".replace("\n", " ")


class _NodeReader:
    """Turns nodes to data, notes every place, collects what is wrong."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.places: dict[Path, Place] = {}
        self.problems: list[Problem] = []
        self.open: list[int] = []
        self.values = 0

    def read(self, node: Node, path: Path, key: tuple[int, int] | None) -> object:
        self.values += 1
        place = _place(node)
        if self.values > MOST_VALUES or len(path) > DEEPEST_NESTING:
            raise ConfigError((Problem(self.file, *place, path_text(path), "aliases make this too large to read"),))
        self.places[path] = Place(place, key)
        match node:
            case ScalarNode():
                return self.scalar(node, path)
            case SequenceNode():
                return self.within(node, "seq", path, self.sequence)
            case MappingNode():
                return self.within(node, "map", path, self.mapping)
        raise TypeError(type(node))  # pragma: no cover  # PyYAML has no fourth kind of node

    def within(self, node: Any, word: str, path: Path, reader: Any) -> object:  # noqa: ANN401
        if id(node.value) in self.open:
            raise ConfigError(
                (Problem(self.file, *_place(node), path_text(path), "an alias may not stand for what surrounds it"),)
            )
        if node.tag != _TAG + word:
            self.report(node, path, f"the tag {quoted(node.tag)} is not known; leave it out")
        self.open.append(id(node.value))
        data = reader(node, path)
        self.open.pop()
        return data

    def sequence(self, node: SequenceNode, path: Path) -> list[object]:
        return [self.read(item, (*path, index), None) for index, item in enumerate(node.value)]

    def mapping(self, node: MappingNode, path: Path) -> dict[str | int, object]:
        data: dict[str | int, object] = {}
        lines: dict[str | int, int] = {}
        for key_node, value_node in node.value:
            key = self.scalar(key_node, path) if isinstance(key_node, ScalarNode) else []
            if isinstance(key, bool) or not isinstance(key, str | int):
                self.report(key_node, path, f"a key must be text or a whole number, not {shown(key)}")
            elif key in lines:
                self.report(key_node, (*path, str(key)), f"is given twice, first in line {lines[key]}; keep one")
            else:
                lines[key] = _place(key_node)[0]
                data[key] = self.read(value_node, (*path, key), _place(key_node))
        return data

    def scalar(self, node: ScalarNode, path: Path) -> object:
        word = str(node.tag).removeprefix(_TAG)
        text = str(node.value)
        if word == "str":
            if any("\ud800" <= character <= "\udfff" for character in text):
                self.report(node, path, "holds half a character (a surrogate); write it whole")
                return None
            return text
        if word not in _FORMS:
            self.report(node, path, f"the tag {quoted(node.tag)} is not known; leave it out")
            return None
        if _FORMS[word].fullmatch(text) is None:
            self.report(node, path, f"{quoted(text)} is not what its tag says; leave the tag out")
            return None
        return self.plain(node, word, text, path)

    def plain(self, node: ScalarNode, word: str, text: str, path: Path) -> object:
        match word:
            case "null":
                return None
            case "bool":
                return text.lower() == "true"
            case "float":
                # Python's words for these have no dot; no other number holds a letter but e.
                return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
        try:
            return int(text[2:], {"0o": 8, "0x": 16}[text[:2]]) if text[:2] in {"0o", "0x"} else int(text)
        except ValueError:  # more digits than Python converts
            self.report(node, path, "has too many digits")
            return None

    def report(self, node: Node, path: Path, message: str) -> None:
        self.problems.append(Problem(self.file, *_place(node), path_text(path), message))


def _place(node: Node) -> tuple[int, int]:
    return node.start_mark.line + 1, node.start_mark.column + 1


def _unknown_key(key: str, known: tuple[str, ...]) -> str:
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
    if near:
        return f"is not a known key; did you mean {near[0]}?"
    return f"is not a known key; known here: {', '.join(known)}" if known else "is not a known key"


def _missing(model: type[BaseModel] | None, path: Path) -> str:
    for found in _models_at(model, path[:-1]) if model else ():
        known = found.model_fields.get(str(path[-1]))
        if known is not None and (description := known.description):
            return f"is missing; write here {description[0].lower()}{description[1:]}"
    return "is missing"


def _keys_at(model: type[BaseModel], path: Path) -> tuple[str, ...]:
    return tuple(field.alias or name for found in _models_at(model, path) for name, field in found.model_fields.items())


def _models_at(model: type[BaseModel], path: Path) -> list[type[BaseModel]]:
    """Return the models whose keys may stand in the mapping at this path."""
    models = [model]
    for step in path:
        if isinstance(step, str):
            models = [
                inner
                for outer in models
                if step in outer.model_fields
                for inner in _models_in(outer.model_fields[step].annotation)
            ]
    return models


def _models_in(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in get_args(annotation) for model in _models_in(argument)]


_WORDS = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "string_type": "text",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
    "none_required": "null",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "literal_error": "one of {expected}",
    "enum": "one of {expected}",
    "string_pattern_mismatch": "text that fits {pattern}",
    "string_too_short": "text of at least {min_length} characters",
    "string_too_long": "text of at most {max_length} characters",
    "too_short": "at least {min_length} items long",
    "too_long": "at most {max_length} items long",
}


def _in_words(detail: ErrorDetails) -> str:
    context = detail.get("ctx", {})
    if detail["type"] in _WORDS:
        wanted = _WORDS[detail["type"]].format_map(context)
        return f"must be {wanted}, not {shown(detail['input'])}"
    if detail["type"] == PLAIN_ERROR:
        return detail["msg"]
    # A validator's own ValueError carries the message; anything else pydantic words well enough.
    text = str(context.get("error", detail["msg"]))
    return " ".join(text.split())
