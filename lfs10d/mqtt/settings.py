"""The settings of the connection to the broker, from section `mqtt`: plain values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field, replace
from enum import StrEnum

from lfs10d.config.models import MqttConfig, TlsConfig
from lfs10d.schema.addresses import node_text
from lfs10d.system.dataclass import dataclass
from lfs10d.system.secret import Secret


class Version(StrEnum):
    """The version of the protocol."""

    V5 = "5"
    V311 = "3.1.1"


def no_password() -> Secret | None:
    """Return None: there is no password."""
    return None


@dataclass(frozen=True, slots=True)
class BrokerSettings:
    """`password` is asked at each connect, in a thread that may block; its errors are the connect's.

    Where `others` are given, hosts and ports, they are tried in turn after `host` and `port`, each after the seconds in
    `waits` at the earliest.

    `keepalive` is in whole seconds (MQTT 5.0, section 3.1.2.10).
    """

    host: str
    port: int
    client_id: str
    version: Version = Version.V5
    username: str | None = None
    password: Callable[[], Secret | None] = field(default=no_password, repr=False)
    tls: TlsConfig | None = None
    keepalive: int = 20
    others: tuple[tuple[str, int], ...] = ()
    waits: tuple[float, ...] = ()

    @classmethod
    def of(cls, config: MqttConfig, *, client_id: str, password: Callable[[], Secret | None]) -> BrokerSettings:
        """Return the settings of section `mqtt`; a verb that is no daemon gives a client id of its own."""
        (host, port), *others = config.nodes
        return cls(
            host=host,
            port=port,
            others=tuple(others),
            client_id=client_id,
            version=Version(config.version),
            username=config.username,
            password=password,
            tls=config.tls,
            keepalive=math.ceil(config.keepalive),
        )

    @property
    def place(self) -> str:
        """The broker as messages name it: `broker localhost:1883`."""
        return f"broker {node_text(self.host, self.port)}"

    @property
    def nodes(self) -> tuple[BrokerSettings, ...]:
        """The settings of each node, in turn."""
        hosts = ((self.host, self.port), *self.others)
        return tuple(replace(self, host=host, port=port, others=(), waits=()) for host, port in hosts)
