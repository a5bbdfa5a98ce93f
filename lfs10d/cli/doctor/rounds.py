"""The examination in order: program and machine, then port, broker and sensors."""

from __future__ import annotations

import asyncio
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import click

import lfs10d
from lfs10d.cli import SERVICE_FILE
from lfs10d.cli.doctor import broker, host, port, program, sensors
from lfs10d.cli.doctor.finding import Area, Finding
from lfs10d.cli.login import Login, log_in
from lfs10d.cli.port_holder import config_of
from lfs10d.cli.watch import Watch
from lfs10d.config.loader import LoadedConfig, load
from lfs10d.config.models import Config
from lfs10d.daemon.state_directory import service_unit, state_directory, status_places
from lfs10d.errors import BrokerError, ConfigError, FailedError
from lfs10d.system import clock

DAEMON, SENSORS = Area("daemon"), Area("sensors")

PROC: Final = Path("/proc")


async def examine(
    file: Path, state_dir: Path | None, username: str | None, password_file: Path | None
) -> list[Finding]:
    """Return all findings for the line of a configuration file; `state_dir` as given on the command line."""
    findings = [*program.versions()]
    try:
        loaded = load(file, files=False)
    except ConfigError as error:
        findings += [*program.broken(error), *_host(file, None, state_dir)]
        return findings
    findings += program.configuration(loaded, socket.gethostname())
    seen = await asyncio.to_thread(port.look, loaded.config.line.port)
    findings += port.judge(seen, service=service_unit(file) is not None)
    findings += await asyncio.to_thread(list, _host(file, loaded, state_dir))
    try:
        login = log_in(file, "doctor", username=username, password_file=password_file, needed=False)
    except ConfigError as error:
        return [*findings, *program.broken(error)]
    findings += await broker.look(login, needed(loaded.config))
    findings += await _sensors(file, loaded, login, seen)
    return findings


async def port_and_broker(file: Path, loaded: LoadedConfig) -> list[Finding]:
    """Return the findings about the port and the broker of a configuration."""
    seen = await asyncio.to_thread(port.look, loaded.config.line.port)
    login = log_in(file, "check", username=None, password_file=None, needed=False)
    findings = [*port.judge(seen, service=service_unit(file) is not None)]
    return findings + await broker.look(login, needed(loaded.config))


def needed(config: Config) -> float:
    """Return the messages per second that the polls of a configuration make, states included."""
    intervals = [slave.interval or 0.05 for slave in config.slaves if slave.enabled]
    samples = sum(1 / interval for interval in intervals) if config.mqtt.telemetry else 0.0
    return samples + sum(1 / max(interval, config.mqtt.state_every) for interval in intervals)


def _host(file: Path, loaded: LoadedConfig | None, state_dir: Path | None) -> Iterator[Finding]:
    installed = Path(lfs10d.__file__).stat().st_mtime
    yield from host.clock(clock.look(), time.time(), installed)
    if loaded is not None:
        directory = state_directory(file, loaded.config.line.name, chosen=state_dir, environment=os.environ)
        yield from host.disk(host.look_at_disk(directory, int(loaded.config.store.max_size)))
    unit = service_unit(file)
    if unit is not None:
        yield from host.service(unit, host.unit_state(unit))
    yield from host.daemons(tuple(running(file)))


def running(file: Path, proc: Path = PROC) -> Iterator[int]:
    """Yield the processes that run the daemon of a configuration file."""
    wanted = "" if file == SERVICE_FILE else str(file.absolute())
    for process in sorted(proc.glob("[0-9]*")):
        try:
            words = (process / "cmdline").read_text("utf-8", "replace").split("\0")
            folder = (process / "cwd").readlink() if wanted else Path("/")
            inside = _in_a_container((process / "status").read_text("utf-8", "replace"))
        except OSError:
            continue
        if inside:
            continue
        if _is_python(words[0]) and any(word.endswith("lfs10d") for word in words[:4]) and "run" in words:
            config = config_of(words)
            if (str((folder / config).absolute()) if config else "") == wanted:
                yield int(process.name)


def _in_a_container(status: str) -> bool:
    """Return whether a process runs in a container on this machine, by its status: its paths are not ours.

    It has a number in each namespace from this one down to its own (proc(5), NSpid).
    """
    return any(len(line.split()) > 2 for line in status.splitlines() if line.startswith("NSpid:"))  # noqa: PLR2004  # the key and one number


def _is_python(program: str) -> bool:
    """Return whether a process is a daemon, not `sudo lfs10d run` or another that waits for one."""
    return Path(program).name.startswith("python")


async def _sensors(file: Path, loaded: LoadedConfig, login: Login, seen: port.PortState) -> list[Finding]:
    watch = Watch(login, status_places(file, loaded.config.line.name, os.environ))
    try:
        await watch.find()
        live, source = watch.best()
    except (BrokerError, FailedError) as error:
        return await _asked(loaded, seen, str(error))
    finally:
        await watch.disconnect()
    if source.alive:
        return [DAEMON.ok(source.words), *sensors.by_daemon(live, time.time())]
    asked = await _asked(loaded, seen, source.words)
    unit = service_unit(file)
    start = f"lfs10d run -c {file}" if unit is None else f"sudo systemctl start {unit}"
    return asked if seen.held_by_daemon else [DAEMON.fail(source.words, f"start it: {start}"), *asked]


async def _asked(loaded: LoadedConfig, seen: port.PortState, silence: str) -> list[Finding]:
    """Return the findings about the sensors where no daemon answers; `silence` is the reason."""
    if seen.held_by_daemon:
        return [SENSORS.warn(f"a daemon holds the port and does not reply: {silence}", "see broker, above")]
    if not seen.is_device or seen.holder:
        return [SENSORS.fail("cannot be read", "see port, above")]
    asked = sum(slave.enabled for slave in loaded.config.slaves)
    click.echo(f"asking {asked} sensors on {loaded.config.line.port}; a silent one takes seconds", err=True)
    return await asyncio.to_thread(sensors.by_asking, loaded)
