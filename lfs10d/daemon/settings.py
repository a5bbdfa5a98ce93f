"""From the configuration to what each part is built from: the one place where their words meet."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping

from lfs10d.config.models import Config, LineConfig, StoreConfig
from lfs10d.line.budget import request_gap, timing_of
from lfs10d.line.device import FIRST_TIMEOUTS
from lfs10d.outbox.store.database import Limits
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode, Reading
from lfs10d.telemetry.info import DeviceInfo, LineInfo


def line_facts(line: LineConfig) -> LineInfo:
    """Return what the broker is told about the line."""
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


def device_facts(config: Config, profiles: Mapping[str, Profile]) -> tuple[DeviceInfo, ...]:
    """Return what the broker is told about each device."""
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
            state_every=config.mqtt.state_every,
        )
        for slave in config.slaves
    )


def conflict_readings(conflicts: Mapping[str, str], at: float) -> list[Reading]:
    """Return what there is to say of devices that must not be polled: that they are offline, and why."""
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
    """Return how much of the backlog is kept on disk, and for how long."""
    return Limits(size=store.max_size, age=round(store.max_age * 1000))


def config_hash(config: Config) -> str:
    """Return 12 hex digits that differ where the effective configuration differs."""
    text = json.dumps(config.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]
