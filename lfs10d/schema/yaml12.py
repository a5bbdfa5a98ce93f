"""YAML as version 1.2 reads it (core schema, section 10.3.2), on PyYAML's composer, which reads 1.1.

`on`, `no`, `1:30` and `2026-11-21` are text, `010` is ten, `0o17` is octal, `0x1F` hexadecimal.
"""

from __future__ import annotations

import copy
import io
import re
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.emitter import Emitter
from yaml.nodes import Node
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.representer import SafeRepresenter
from yaml.resolver import BaseResolver
from yaml.scanner import Scanner
from yaml.serializer import Serializer

DEEPEST_NESTING = 20
"""Levels of lists and mappings; the configuration needs four."""

TAG = "tag:yaml.org,2002:"
"""What the tags of the core schema begin with."""

_NULL = re.compile(r"~|null|Null|NULL|")
_BOOL = re.compile(r"true|True|TRUE|false|False|FALSE")
_INT = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(
    r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)
FORMS = {"null": _NULL, "bool": _BOOL, "int": _INT, "float": _FLOAT}
"""The form of plain words of each type; every other word is text."""


class CoreSchema(BaseResolver):
    """Plain words as in YAML 1.2."""


for _word, _form in FORMS.items():
    # The whole word must fit; the resolver itself would be content with its beginning.
    CoreSchema.add_implicit_resolver(TAG + _word, re.compile(f"(?:{_form.pattern})\\Z"), None)


class Loader(Reader, Scanner, Parser, Composer, CoreSchema):
    """PyYAML's composer, with the core schema, a greatest depth, and places of aliases."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)
        Composer.__init__(self)
        CoreSchema.__init__(self)
        self.depth = 0

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:  # noqa: ANN401  # as PyYAML calls it
        """Compose one node; an alias becomes a node of its own with the place where it stands."""
        event = self.peek_event()  # type: ignore[no-untyped-call]  # types-PyYAML has no signature
        if isinstance(event, yaml.AliasEvent):
            alias: Any = copy.copy(super().compose_node(parent, index))
            alias.start_mark = event.start_mark
            return alias  # type: ignore[no-any-return]  # the anchor's node, never None
        self.depth += 1
        if self.depth > DEEPEST_NESTING:
            raise yaml.MarkedYAMLError(
                problem=f"nested more than {DEEPEST_NESTING} levels deep", problem_mark=event.start_mark
            )
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


class Dumper(Emitter, Serializer, SafeRepresenter, CoreSchema):
    """PyYAML's writer with the core schema, so that text that would read as a number is quoted."""

    def __init__(self, stream: io.StringIO) -> None:
        Emitter.__init__(self, stream, allow_unicode=True, width=100)
        Serializer.__init__(self)
        SafeRepresenter.__init__(self, sort_keys=False)
        CoreSchema.__init__(self)

    def ignore_aliases(self, data: object) -> bool:
        """Write everything out."""
        del data
        return True


def _text(dumper: Dumper, text: str) -> Node:
    # PyYAML leaves what YAML 1.1 calls line breaks as they are, but for double quotes; `parse` refuses them bare. What
    # else does not print is escaped by `render`, which only double quotes allow.
    style = None if text.isprintable() else '"'
    return dumper.represent_scalar(f"{TAG}str", text, style=style)


Dumper.add_representer(str, _text)


def render(data: object) -> str:
    """Return data as YAML that `parse` reads back as the same data (`document.parse`).

    Nothing in it turns the direction of text or moves a cursor: what does not print is escaped.
    """
    text = str(yaml.dump_all([data], Dumper=lambda stream, **_: Dumper(stream)))
    return "".join(sign if sign.isprintable() or sign == "\n" else f"\\U{ord(sign):08X}" for sign in text)
