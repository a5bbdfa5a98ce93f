"""Kinds of values about the broker: host, list of nodes, base topic."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import TypeAdapter

from lfs10d.schema.fields import FieldError, FieldKind, one_line
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True)
class Host(FieldKind):
    """A host name or an address. A wrong one is never shown: it may contain a login."""

    pattern = re.compile(r"[\w.-]{1,253}|[0-9A-Fa-f]*:[0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*(%[\w.-]+)?")

    words = "a host name or address, such as localhost or 192.0.2.7 (no mqtt://, no port, no login)"

    def accept(self, value: object) -> str:
        """Take text that fits."""
        if not isinstance(value, str) or self.pattern.fullmatch(value) is None:
            raise FieldError(f"must be {self.words}")
        return value

    def json_schema(self) -> dict[str, Any]:
        """Return text with the pattern."""
        return {"type": "string", "pattern": f"^(?:{self.pattern.pattern})$"}


@dataclass(frozen=True)
class Node(Host):
    """One node of several: a host, with its port if it has its own. A wrong one is never shown."""

    words = 'a host name or address, with a port or without, such as broker-b, "broker-b:8884" or "[2001:db8::7]:1883"'

    def accept(self, value: object) -> str:
        """Take text that fits."""
        if isinstance(value, str):
            host, port = split_node(value)
            if self.pattern.fullmatch(host) and (port is None or 1 <= port <= LAST_PORT):
                return value
        raise FieldError(f"must be {self.words} (no mqtt://, no login)")

    def json_schema(self) -> dict[str, Any]:
        """Return text without white space, slash or login; the rest is checked by `accept`."""
        return {"type": "string", "pattern": r"^[^\s/@]+$"}


LAST_PORT = 65_535

_NODE = re.compile(
    r"\[(?P<six>[^\[\]]*:[^\[\]]*)\](:(?P<port6>[0-9]{1,5}))?|(?P<host>[^:\[\]]*)(:(?P<port>[0-9]{1,5}))?"
)


def split_node(text: str) -> tuple[str, int | None]:
    """Return host and port (None: not given) of a node as written; an invalid host stays as it is."""
    found = _NODE.fullmatch(text)
    if found is None:
        return text, None  # an IPv6 address without brackets, or nonsense
    port = found["port6"] or found["port"]
    return found["six"] or found["host"], None if port is None else int(port)


def node_text(host: str, port: int) -> str:
    """Return a node as text, an IPv6 address in brackets (RFC 3986, section 3.2.2)."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


@dataclass(frozen=True)
class Hosts(FieldKind):
    """One host, or a list of nodes. A wrong one is never shown: it may contain a login."""

    most: int = 16

    @property
    def words(self) -> str:
        """Its form."""
        return f"{Host().words}; or a list of 1 to {self.most}, each with a port of its own where it needs one"

    def accept(self, value: object) -> str | tuple[str, ...]:
        """Take one host or several nodes."""
        if not isinstance(value, list | tuple):
            return Host().accept(value)
        nodes = tuple(Node().accept(each) for each in value)
        if not 1 <= len(nodes) <= self.most or len({split_node(each) for each in nodes}) < len(nodes):
            raise FieldError(f"must be a list of 1 to {self.most} nodes, each once")
        return nodes

    def _validated(self, value: object) -> object:
        if isinstance(value, list | tuple):
            _NODES.validate_python(tuple(value))  # its errors have the places of wrong nodes
        return super()._validated(value)

    def json_schema(self) -> dict[str, Any]:
        """Return one host or a list of nodes."""
        nodes = {"type": "array", "items": Node().json_schema(), "minItems": 1, "maxItems": self.most}
        return {"anyOf": [Host().json_schema(), {**nodes, "uniqueItems": True}]}


_NODES: TypeAdapter[tuple[str, ...]] = TypeAdapter(tuple[Annotated[str, Node()], ...])


@dataclass(frozen=True)
class BaseTopic(FieldKind):
    """The first levels of every topic (MQTT 5.0, section 4.7: no wildcards, and `$` is the broker's)."""

    longest: int = 200

    @property
    def words(self) -> str:
        """Its form."""
        return (
            f"1 to {self.longest} characters as levels joined by /, such as site/%H: "
            "no + or #, no empty level, not beginning with $ (%H is the host name)"
        )

    def accept(self, value: object) -> str:
        """Take text that can begin a topic."""
        if (
            not isinstance(value, str)
            or not 1 <= len(value) <= self.longest
            or not one_line(value)
            or "+" in value
            or "#" in value
            or value.startswith("$")
            or "" in value.split("/")
        ):
            raise self.refusal(value)
        return value

    def json_schema(self) -> dict[str, Any]:
        """Return text of levels joined by slashes."""
        return {"type": "string", "maxLength": self.longest, "pattern": r"^(?!\$)[^+#/]+(/[^+#/]+)*$"}


@dataclass(frozen=True)
class TopicPrefix(BaseTopic):
    """The first levels of topics that others publish on too; `%H` means nothing here."""

    @property
    def words(self) -> str:
        """Its form."""
        return (
            f"1 to {self.longest} characters as levels joined by /, such as homeassistant: "
            "no + or #, no empty level, not beginning with $"
        )
