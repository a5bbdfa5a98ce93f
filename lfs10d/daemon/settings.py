"""Turns the configuration into the settings of telemetry, outbox and mqtt."""

from __future__ import annotations

import hashlib
import json
import socket
from collections.abc import Mapping

from lfs10d import __version__
from lfs10d.config.effective import Effective
from lfs10d.config.live_config import LiveConfig
from lfs10d.config.models import Config, LineConfig
from lfs10d.config.sections import StoreConfig
from lfs10d.daemon.boot import Boot
from lfs10d.line.budget import request_gap, timing_of
from lfs10d.line.device import FIRST_TIMEOUTS
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.outbox.store.database import Limits
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode, Reading
from lfs10d.system.secret import Secret
from lfs10d.telemetry.info import DaemonInfo, DeviceInfo, LineInfo, WindInfo, WindValues
from lfs10d.telemetry.wind.figures import METRES_PER_SECOND


def daemon_info(now: Effective, boot: Boot) -> DaemonInfo:
    """Return the info of the daemon itself."""
    config = now.config
    return DaemonInfo(
        version=__version__,
        host=socket.gethostname(),
        boot=boot.id,
        previous_boot=boot.previous,
        config_hash=config_hash(config),
        changes=now.changes.count,
        mqtt={"version": config.mqtt.version},
        features=features(config),
    )


def features(config: Config) -> tuple[str, ...]:
    """Return the features that a consumer can rely on."""
    return ("history",) if config.mqtt.telemetry else ()


def broker_settings(config: LiveConfig) -> BrokerSettings:
    """Return the connection to the broker; its password is read at each connect."""
    mqtt = config.now.config.mqtt

    def password() -> Secret | None:
        return config.loaded.password()

    return BrokerSettings.of(mqtt, client_id=mqtt.client_id or "", password=password)


def line_info(line: LineConfig) -> LineInfo:
    """Return the info of the line."""
    return LineInfo(
        name=line.name,
        port=line.port,
        baudrate=line.baudrate,
        parity=line.parity,
        databits=line.databits,
        stopbits=line.stopbits,
        framing=line.framing,
        gap_required=timing_of(line).gap,
    )


def device_infos(config: Config, profiles: Mapping[str, Profile]) -> tuple[DeviceInfo, ...]:
    """Return the info of each device."""
    return tuple(
        DeviceInfo(
            name=slave.name,
            slave=slave.id,
            label=slave.label,
            profile=profiles[slave.profile].name,
            interval=slave.interval,
            enabled=slave.enabled,
            response_timeout=slave.response_timeout,
            request_gap=request_gap(slave, profiles[slave.profile]),
            value_names=profiles[slave.profile].value_names,
            units=profiles[slave.profile].units,
            offline_after=config.poll.offline_after,
            calibration={name: entry.model_dump() for name, entry in slave.calibration.items()},
            state_every=config.mqtt.state_every,
            wind=wind_info(config, profiles[slave.profile]),
        )
        for slave in config.slaves
    )


def wind_info(config: Config, profile: Profile) -> WindInfo | None:
    """Return the wind statistics of a device of this profile; None where it measures no wind, or in an unknown unit."""
    speed = profile.first_of("wind_speed")
    if speed is not None and speed.unit not in METRES_PER_SECOND:
        speed = None
    direction = profile.first_of("wind_direction")
    if speed is None and direction is None:
        return None
    values = WindValues(
        speed=None if speed is None else speed.name,
        direction=None if direction is None else direction.name,
        unit=None if speed is None else speed.unit,
    )
    return WindInfo(values, config.wind.every, config.wind.records, config.mqtt.hold)


def conflict_readings(conflicts: Mapping[str, str], at: float) -> list[Reading]:
    """Return a failed reading of each device that must not be polled: it is offline, and why."""
    return [
        Reading(
            device=name,
            at=at,
            values=None,
            fault=Fault(FaultCode.CONFIG_CONFLICT, why),
            rtt=None,
            online=False,
            response_timeout=FIRST_TIMEOUTS[0],
        )
        for name, why in conflicts.items()
    ]


def store_limits(store: StoreConfig) -> Limits:
    """Return the limits of the backlog on disk: bytes, and age in ms."""
    return Limits(size=store.max_size, age=round(store.max_age * 1000))


def config_hash(config: Config) -> str:
    """Return 12 hex digits that differ where the effective configuration differs."""
    text = json.dumps(config.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]
