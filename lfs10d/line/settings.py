"""Turns the configuration into the settings of port, bus, scheduler and jobs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from lfs10d.config.loader import LoadedConfig
from lfs10d.config.models import Config, LineConfig, PollConfig, SlaveConfig
from lfs10d.line.budget import request_gap, timing_of
from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.identification import by_evidence
from lfs10d.line.jobs.register_access import Target
from lfs10d.line.jobs.scan_plan import ScanPlan
from lfs10d.modbus.bus import LineRules
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.modbus.port_settings import PortSettings, Rs485
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile

GREATEST_SHARE = 0.95
"""Greatest share of the line for a scan, so that polling goes on."""
DEFAULT_PROFILE = builtin_names()[0]


def port_settings(line: LineConfig) -> PortSettings:
    """Return the settings of the port."""
    return PortSettings(
        path=line.port,
        baudrate=line.baudrate,
        parity=line.parity,
        databits=line.databits,
        stopbits=line.stopbits,
        low_latency=line.low_latency,
        rs485=None if line.rs485 is None else Rs485(**line.rs485.model_dump()),
    )


def line_rules(line: LineConfig) -> LineRules:
    """Return the settings of the bus."""
    return LineRules(extra_gap=line.extra_gap, broadcast_delay=line.turnaround_delay, echo=line.echo)


def poll_rules(poll: PollConfig) -> PollRules:
    """Return the rules for the polls of every device."""
    return PollRules(retries=poll.retries, offline_after=poll.offline_after, probe_interval_max=poll.probe_interval_max)


def usual_codec(line: LineConfig) -> Codec:
    """Return the codec for slaves that are not configured."""
    return Codec(Framing(line.framing))


def profile_codec(line: LineConfig, profile: Profile) -> Codec:
    """Return the codec for a device of this profile that is not configured yet."""
    return Codec(Framing(line.framing), Checksum(profile.checksum))


def device_specs(config: Config, profiles: Mapping[str, Profile]) -> tuple[DeviceSpec, ...]:
    """Return the devices for the scheduler; `profiles` by the configuration's word for each."""
    return tuple(_device_spec(slave, config.line, profiles[slave.profile]) for slave in config.slaves)


def _device_spec(slave: SlaveConfig, line: LineConfig, profile: Profile) -> DeviceSpec:
    return DeviceSpec(
        name=slave.name,
        slave=slave.id,
        profile=profile.calibrated(slave.certificates),
        codec=Codec(Framing(line.framing), Checksum(slave.checksum or profile.checksum)),
        interval=max(slave.interval, profile.min_interval),  # 0 is as fast as the line allows, and the device
        enabled=slave.enabled,
        response_timeout=slave.response_timeout,
        request_gap=request_gap(slave, profile),
    )


def scan_plan(loaded: LoadedConfig, ids: tuple[int, ...], rates: tuple[int, ...], *, share: float) -> ScanPlan:
    """Return the plan of a scan; without `rates` its own, those of an LFS10, and the factory's of configured profiles.

    Every id is asked with the check that all configured devices share, or CRC. May read the built-in profiles.
    """
    line, builtin = loaded.config.line, builtin_names()
    checksums = {spec.codec.checksum for spec in device_specs(loaded.config, loaded.profiles)}
    codec = Codec(Framing(line.framing), checksums.pop() if len(checksums) == 1 else Checksum.CRC)
    own = tuple(profile for word, profile in loaded.profiles.items() if word not in builtin)
    known = (*own, *by_evidence(load_profile(name, relative_to=Path()) for name in builtin))
    ascii_line = line.framing == Framing.ASCII.value
    profiles = tuple(
        each for each in known
        if line.framing in each.framings and (ascii_line or codec.checksum.value in each.checksums)
    )  # fmt: skip
    usual = [rate for each in profiles if each.name == DEFAULT_PROFILE for rate in each.rates]
    usual += [each.factory.baudrate for each in loaded.profiles.values() if each in profiles and each.factory]
    return ScanPlan(
        ids,
        tuple(
            timing_of(line.model_copy(update={"baudrate": rate}))
            for rate in rates or dict.fromkeys((line.baudrate, *usual))
        ),
        codec,
        profiles,
        line_rate=line.baudrate,
        share=min(share, GREATEST_SHARE),
    )


def access_target(loaded: LoadedConfig, slave: int, device: SlaveConfig | None) -> Target:
    """Return the target for access to the registers of a device, or of a slave id without a device."""
    config = loaded.config
    if device is None:
        return Target(slave, usual_codec(config.line), None, config.poll.response_timeout)
    spec = _device_spec(device, config.line, loaded.profiles[device.profile])
    return Target(slave, spec.codec, spec.profile, spec.response_timeout)
