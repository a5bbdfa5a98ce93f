"""The configuration as frozen, strict models: every key with its default, its range and its meaning.

The names are the keys of the file. Durations are float seconds, sizes bytes. `Config` as read from a file still has
gaps (a slave without a name, a broker without a client id); `lfs10d.config.defaults` fills them. Nothing here reads a
file.
`docs/configuration.md` is generated from these models.
"""

from __future__ import annotations

import re
from typing import Annotated, Literal, TypeAlias

from pydantic import BeforeValidator, Field

from lfs10d.config.sections import DAY, HOUR, HomeassistantConfig, LogConfig, Section, StoreConfig, WindConfig
from lfs10d.config.short_forms import SLAVE_ID, OrBareId, items, slave_mapping
from lfs10d.schema.addresses import BaseTopic, Hosts, node_text, split_node
from lfs10d.schema.fields import (
    Choice,
    Duration,
    FilePath,
    Flag,
    Name,
    Text,
    Whole,
)
from lfs10d.schema.quantities import BAUDRATES

PLAIN_PORT, TLS_PORT = 1883, 8883
"""Registered with IANA for MQTT and for MQTT over TLS."""

LONGEST_CLIENT_ID = 200
"""Characters; a broker need not take more than 23 (MQTT 5.0, section 3.1.3.1), all known ones do."""

DEFAULT_STEM = "lfs10d"
"""The file name without suffix whose line is `line0` by default."""

DEFAULT_LINE = "line0"

SlaveId: TypeAlias = Annotated[int, SLAVE_ID]
Label: TypeAlias = Annotated[str | None, Text(200, null=True)]
Interval: TypeAlias = Annotated[float, Duration(0.02, DAY, zero="as fast as the line allows")]
ResponseTimeout: TypeAlias = Annotated[float | None, Duration(0.01, 10, auto="learned")]

CommandClass: TypeAlias = Literal["polling", "sensors", "registers"]


class Rs485Config(Section):
    """How the driver switches the transceiver (kernel document serial-rs485)."""

    rts_on_send: Annotated[bool, Flag()] = Field(default=True, description="Level of RTS while sending.")
    rts_after_send: Annotated[bool, Flag()] = Field(default=False, description="Level of RTS after sending.")
    delay_before_send: Annotated[float, Duration(0, 1)] = Field(0.0, description="Time between RTS and the first bit.")
    delay_after_send: Annotated[float, Duration(0, 1)] = Field(0.0, description="Time between the last bit and RTS.")


class LineConfig(Section):
    """The RS485 line and its port."""

    name: Annotated[str, Name()] = Field(
        "",
        description="Second part of every topic, stable for life. "
        "Default: line0 for lfs10d.yaml, else the file's name without .yaml.",
    )
    port: Annotated[str, FilePath()] = Field(
        description="Path of the serial port, best below /dev/serial/by-id: it stays the same after replugging."
    )
    baudrate: Annotated[int, Choice(BAUDRATES)] = Field(
        9600, description="Bits per second. An LFS10 can do 9600 and 19200."
    )
    parity: Annotated[Literal["none", "even", "odd"], Choice(("none", "even", "odd"))] = Field(
        "none", description="Parity bit of each character."
    )
    databits: Annotated[int, Choice((8, 7))] = Field(8, description="Data bits of each character; 7 with ascii only.")
    stopbits: Annotated[int, Choice((1, 2))] = Field(1, description="Stop bits of each character.")
    framing: Annotated[Literal["rtu", "ascii"], Choice(("rtu", "ascii"))] = Field(
        "rtu", description="Modbus framing, one for the whole line. LFS10 and EH600 support rtu only."
    )
    extra_gap: Annotated[float, Duration(0, 1)] = Field(
        0.0, description="Added to the 3.5 characters of silence before each request."
    )
    turnaround_delay: Annotated[float, Duration(0, 10)] = Field(
        0.1,
        description="Silence after a broadcast, which no slave answers: the turnaround delay of Modbus over Serial "
        "Line. No request of lfs10d sends a broadcast.",
    )
    echo: Annotated[Literal["auto", "on", "off"], Choice(("auto", "on", "off"))] = Field(
        "auto", description="Whether the adapter returns the bytes it sends; auto: detected."
    )
    low_latency: Annotated[bool, Flag()] = Field(
        default=True, description="Use the low-latency mode of the driver, if it has one."
    )
    realtime: Annotated[bool, Flag()] = Field(
        default=False, description="SCHED_FIFO for the line thread, if the system permits it."
    )
    rs485: Rs485Config | None = Field(
        None, description="Let the driver switch the transceiver by RTS; null leaves the driver as it is."
    )


class PollConfig(Section):
    """How slaves are polled, unless a slave says otherwise."""

    interval: Interval = Field(
        1.0,
        description="Time between two polls of one slave; 0 is as fast as the line allows, "
        "in the time that slaves with an interval leave.",
    )
    response_timeout: Annotated[float | None, Duration(0.01, 10, auto="learned per slave")] = Field(
        None,
        description="From the last bit of the request to the first byte of the answer; "
        "auto is learned per slave within 50ms..1s.",
    )
    retries: Annotated[int, Whole(0, 10)] = Field(
        1,
        description="Retries within one failed poll; none for writes, for offline slaves and for slaves "
        "that never answered.",
    )
    offline_after: Annotated[int, Whole(1, 1000)] = Field(
        3, description="Consecutive failed polls after which a device is offline."
    )
    probe_interval_max: Annotated[float, Duration(1, DAY)] = Field(
        15.0,
        description="An offline slave is probed after 1s, 2s, 4s ... up to this; all probes together take at most "
        "5 % of the line while others answer.",
    )


class CalibrationConfig(Section):
    """The calibration certificate of one value: `value * scale + offset`."""

    scale: Annotated[float, Field(ge=0.001, le=1000)] = Field(1.0, description="What the value is multiplied by.")
    offset: Annotated[float, Field(ge=-1e6, le=1e6)] = Field(
        0.0, description="What is then added, in the unit of the value."
    )


class SlaveConfig(Section):
    """One device on the line."""

    id: SlaveId = Field(description="Slave id, 1 to 255; a profile may allow fewer.")
    name: Annotated[str, Name()] = Field(
        "", description="Part of its topics, stable for life. Default: slave-<id as in the file>."
    )
    label: Label = Field(None, description="Free text for people, never in a topic.")
    profile: Annotated[str, FilePath()] = Field(
        "lfs10",
        description="Name of an included profile, or the path of a profile YAML, relative to this file.",
    )
    interval: Interval = Field(1.0, description="Time between two polls. Default: poll.interval.")
    enabled: Annotated[bool, Flag()] = Field(default=True, description="Whether it is polled.")
    response_timeout: ResponseTimeout = Field(
        None,
        description="From the last bit of the request to the first byte of the answer. Default: poll.response_timeout.",
    )
    checksum: Annotated[Literal["crc", "sum"] | None, Choice(("crc", "sum"), null=True)] = Field(
        None, description="Check of its rtu frames; null: the first that the profile lists."
    )
    request_gap: Annotated[float, Duration(0, 60)] = Field(
        0.0,
        description="Rest before each request to it, counted from the end of the exchange with it before; "
        "the longer of this and the profile's.",
    )
    calibration: dict[str, CalibrationConfig] = Field(
        {},
        description="Scale and offset of its calibration certificate, by value name: {wind_speed: {scale: 1.013, "
        "offset: 0.06}}. value * scale + offset is then judged by the profile's range. A wind_speed of 0 stays 0.",
    )

    @property
    def certificates(self) -> dict[str, tuple[float, float]]:
        """Scale and offset by value name, as `Profile.calibrated` takes them."""
        return {name: (entry.scale, entry.offset) for name, entry in self.calibration.items()}


class TlsConfig(Section):
    """TLS to the broker; paths are relative to the file."""

    ca: Annotated[str | None, FilePath(null=True)] = Field(
        None, description="File of the trusted authorities; null: those of the system."
    )
    cert: Annotated[str | None, FilePath(null=True)] = Field(None, description="File of the client certificate.")
    key: Annotated[str | None, FilePath(null=True)] = Field(
        None, description="File of the client key, unless it is in cert."
    )


class MqttConfig(Section):
    """The broker and our login there."""

    host: Annotated[str | tuple[str, ...], Hosts()] = Field(
        "localhost",
        description="Host name or address of the broker; or a list of its nodes, tried in turn until one accepts, "
        "then kept while it is there.",
    )
    port: Annotated[int, Whole(1, 65535)] = Field(
        PLAIN_PORT,
        description="Port of the broker, and of each node without its own. "
        f"Default: {PLAIN_PORT}, {TLS_PORT} with tls.",
    )
    version: Annotated[Literal["5", "3.1.1"], Choice((5, "3.1.1"), meaning={5: "5", "5": "5"})] = Field(
        "5",
        description="MQTT version. If the broker refuses 5, 3.1.1 is used, with one warning.",
    )
    base_topic: Annotated[str, BaseTopic()] = Field(
        "lfs10d", description="First part of every topic; may have several levels; %H is the host name."
    )
    client_id: Annotated[str | None, Text(LONGEST_CLIENT_ID, null=True)] = Field(
        None, description="Must differ between clients; %H is the host name. Default: lfs10d-<host name>-<line name>."
    )
    telemetry: Annotated[bool, Flag()] = Field(
        default=True,
        description="false: no `telemetry` and no `history`, only states, errors, statistics, events and responses; "
        "for a slow or expensive connection.",
    )
    state_every: Annotated[float, Duration(1, HOUR)] = Field(
        1.0,
        description="Shortest time between two `state` of a device; a change of quality or error is published at once.",
    )
    username: Annotated[str | None, Text(200, null=True)] = Field(None, description="Login name; null for none.")
    password_file: Annotated[str | None, FilePath(null=True)] = Field(
        None,
        description="File with the password in its first line, relative to this file; "
        "null is the systemd credential mqtt-password, if there is one.",
    )
    tls: TlsConfig | None = Field(None, description="null for none; {} trusts the authorities of the system.")
    keepalive: Annotated[float, Duration(1, 65535)] = Field(
        20.0, description="Time without traffic after which the connection is tested; whole seconds, rounded up."
    )
    hold: Annotated[float, Duration(0, 1)] = Field(
        0.02,
        description="How long a good sample may wait to be sent together with others, which saves processor time; "
        "never where no other can come in that time.",
    )

    @property
    def nodes(self) -> tuple[tuple[str, int], ...]:
        """The broker's nodes in order, host and port; one if `host` is not a list."""
        if isinstance(self.host, str):
            return ((self.host, self.port),)
        return tuple((host, self.port if port is None else port) for host, port in map(split_node, self.host))

    @property
    def broker(self) -> str:
        """The broker in words: `localhost:1883`, its nodes joined by commas."""
        return ", ".join(node_text(host, port) for host, port in self.nodes)


CommandChoice: TypeAlias = Annotated[CommandClass, Choice(("polling", "sensors", "registers"))]


class Config(Section):
    """The whole file."""

    line: LineConfig = Field(description="The RS485 line; at least `port`.")
    poll: PollConfig = Field(PollConfig(), description="How slaves are polled.")
    slaves: Annotated[
        tuple[Annotated[SlaveConfig, BeforeValidator(slave_mapping), OrBareId()], ...], BeforeValidator(items)
    ] = Field((), description="A list of slave ids, of mappings, or both; may be empty.")
    mqtt: MqttConfig = Field(MqttConfig(), description="The broker.")
    commands: Annotated[tuple[CommandChoice, ...], BeforeValidator(items)] = Field(
        ("polling", "sensors"),
        description="Classes of requests that are accepted: polling (what is polled and how), sensors (changes and "
        "scans of the line), registers (raw access); [] for none.",
    )
    homeassistant: HomeassistantConfig = Field(HomeassistantConfig(), description="Home Assistant.")
    wind: WindConfig = Field(WindConfig(), description="Wind statistics.")
    store: StoreConfig = Field(StoreConfig(), description="The backlog on disk while the broker is unreachable.")
    log: LogConfig = Field(LogConfig(), description="What is logged.")


def default_line_name(stem: str) -> str:
    """Return the line's name for a file of this name without suffix: always a name.

    What cannot be in a name becomes `-`.
    """
    if stem == DEFAULT_STEM:
        return DEFAULT_LINE
    return re.sub(r"[^a-z0-9_-]+", "-", stem.lower()).strip("-")[:32] or DEFAULT_LINE


def default_device_name(slave: int) -> str:
    """Return the default name of a device."""
    return f"slave-{slave}"


def device_name(slave: SlaveConfig) -> str:
    """Return the name as given, or the default."""
    return slave.name or default_device_name(slave.id)
