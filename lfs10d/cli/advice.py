"""Warnings of `lfs10d check`: valid settings that are probably a mistake, each at its place in the file."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator

from lfs10d.config.credentials import missing_in_authorities
from lfs10d.config.loader import LoadedConfig
from lfs10d.config.models import default_line_name
from lfs10d.errors import ConfigError, Problem
from lfs10d.line.budget import ASSUMED_TURNAROUND, Budget
from lfs10d.profiles.decimals import spell
from lfs10d.schema.fields import quoted
from lfs10d.schema.messages import KeyPath
from lfs10d.schema.quantities import duration_text

COMMON_HOST_NAMES = frozenset({"localhost", "raspberrypi", "debian", "raspbian", "ubuntu", "linux", "openwrt"})
"""Default host names of systems: two gateways may share one."""


def advice(loaded: LoadedConfig, budget: Budget, host: str) -> tuple[Problem, ...]:
    """Return the warnings for a valid configuration on the host of this name, in order of place."""
    warnings = (
        *_load(loaded, budget),
        *_login(loaded),
        *_files(loaded),
        *_names(loaded, host),
        *_calibration(loaded),
        *_addresses(loaded),
    )
    return tuple(sorted(loaded.document.problem(path, f"warning: {message}") for path, message in warnings))


def _load(loaded: LoadedConfig, budget: Budget) -> Iterator[tuple[KeyPath, str]]:
    path: KeyPath = ("poll", "interval") if loaded.document.holds(("poll", "interval")) else ("slaves",)
    for share in budget.shares:
        if share.rest and share.load_with_turnaround is not None and share.load_with_turnaround > 1:
            index = [slave.name for slave in loaded.config.slaves].index(share.device)
            needed = duration_text(round(share.load_with_turnaround * share.interval, 3))
            message = (
                f"one poll takes {needed} with the rest before each request (request_gap): it will be polled less "
                f"often than every {duration_text(share.interval)}"
            )
            yield ("slaves", index), message
    if budget.wire_load > 1:
        message = (
            f"the intervals ask for {budget.wire_load:.1%} of what the line carries: every device will be polled "
            "less often; use longer intervals, a higher baud rate or a second line"
        )
        yield path, message
    elif budget.wire_load_with_turnaround > 1:
        message = (
            f"the intervals ask for {budget.wire_load_with_turnaround:.1%} of what the line carries if the devices "
            f"take {duration_text(ASSUMED_TURNAROUND)} to answer (and {budget.wire_load:.1%} if they took none)"
        )
        yield path, message
    if not loaded.config.slaves:
        yield ("slaves",), "there are no slaves: nothing will be polled until one is added"
    elif not budget.shares:
        yield ("slaves",), "no slave is enabled: nothing will be polled"


def loopback(host: str) -> bool:
    """Return whether a broker's host is this machine, judged by its name alone."""
    if host.lower().rstrip(".") == "localhost" or host.lower().endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _login(loaded: LoadedConfig) -> Iterator[tuple[KeyPath, str]]:
    mqtt = loaded.config.mqtt
    if all(loopback(host) for host, _ in mqtt.nodes):
        return
    certificate = mqtt.tls is not None and mqtt.tls.cert is not None
    if mqtt.username is None and not certificate:
        message = (
            "the broker is remote and needs no login: anyone who reaches it can publish readings and requests; "
            "set mqtt.username and mqtt.password_file, or mqtt.tls.cert"
        )
        yield ("mqtt", "host"), message
    if mqtt.username is not None and mqtt.tls is None:
        yield ("mqtt", "username"), "the password crosses the network unencrypted; set mqtt.tls"


def _files(loaded: LoadedConfig) -> Iterator[tuple[KeyPath, str]]:
    """Look into the files of the login, as far as they can be read."""
    mqtt = loaded.config.mqtt
    try:
        password = loaded.password()
    except ConfigError:
        password = None
    if password is not None and password.reveal().rstrip(" \t") != password.reveal():
        path: KeyPath = ("mqtt", "password_file") if mqtt.password_file is not None else ("mqtt",)
        yield path, "the password ends with a space, which is part of it: remove it unless it is meant"
    if mqtt.tls is not None and mqtt.tls.ca is not None and (missing := missing_in_authorities(mqtt.tls.ca)):
        message = (
            f"an authority without {' and '.join(missing)} (RFC 5280, section 4.2.1), which strict clients refuse, "
            "any Python from 3.13 on among them; lfs10d takes it: make the next one with "
            "-addext keyUsage=critical,keyCertSign,cRLSign"
        )
        yield ("mqtt", "tls", "ca"), message


def _names(loaded: LoadedConfig, host: str) -> Iterator[tuple[KeyPath, str]]:
    """Two gateways at one broker must not publish under one name; a broker on this host has one gateway."""
    document, config = loaded.document, loaded.config
    if not document.holds(("line", "name")):
        stem = loaded.path.stem
        if default_line_name(stem) not in {stem, "line0"}:
            yield (
                ("line",),
                f"the file's name {quoted(stem)} is no name for a line, so line.name is {config.line.name}; set it",
            )
    if all(loopback(host) for host, _ in config.mqtt.nodes):
        return
    if not any(document.holds(path) for path in (("line", "name"), ("mqtt", "base_topic"))):
        message = (
            "line.name and mqtt.base_topic are both defaults: a second gateway at this broker would publish under "
            f"{config.mqtt.base_topic}/{config.line.name} too; set one of them"
        )
        yield ("mqtt",), message
    if config.mqtt.client_id is not None and host.lower() in COMMON_HOST_NAMES:
        given = loaded.document.data
        written = given["mqtt"].get("client_id") if isinstance(given, dict) and "mqtt" in given else None
        if written is None or "%H" in written:
            message = (
                f"the client id {config.mqtt.client_id} comes from the host name {host}, which many hosts have; "
                "two clients with one id disconnect each other: set mqtt.client_id or change the host name"
            )
            yield ("mqtt", "client_id"), message


def _calibration(loaded: LoadedConfig) -> Iterator[tuple[KeyPath, str]]:
    """Small values with a negative offset fall below a range that begins at 0."""
    for index, slave in enumerate(loaded.config.slaves):
        values = {value.name: value for value in loaded.profiles[slave.profile].values}
        for name, entry in slave.calibration.items():
            value = values[name]
            if entry.offset < 0 and value.range is not None and value.range[0] == 0:
                least = f"{-entry.offset / entry.scale:.3g}"
                message = (
                    f"{name} below {spell(float(least), value.unit)} becomes negative by it, which is out_of_range "
                    f"for profile {slave.profile}"
                )
                yield ("slaves", index, "calibration", name, "offset"), message


def _addresses(loaded: LoadedConfig) -> Iterator[tuple[KeyPath, str]]:
    told: set[str] = set()
    for index, slave in enumerate(loaded.config.slaves):
        if slave.profile not in told:
            told.add(slave.profile)
            for doubt in loaded.profiles[slave.profile].doubts():
                yield ("slaves", index), f"profile {quoted(slave.profile)}: {doubt}"
