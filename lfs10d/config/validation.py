"""Contradictions between valid keys: pure rules over the configuration and its profiles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lfs10d.config.models import Config, SlaveConfig, device_name
from lfs10d.profiles.profile import Profile
from lfs10d.schema.messages import KeyPath, nearest
from lfs10d.schema.quantities import duration_text
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Contradiction:
    """A problem at `path` that follows from the keys `on`; it is left out if one of them is wrong itself.

    `key`: it is the key that is wrong, not its value.
    """

    path: KeyPath
    message: str
    on: tuple[KeyPath, ...]
    key: bool = False


def contradictions(config: Config, profiles: Mapping[str, Profile]) -> Iterator[Contradiction]:
    """Yield all contradictions. `config` may be incomplete; profiles that could not be loaded are passed over."""
    yield from _line(config)
    yield from _broker(config)
    yield from _taken(config)
    for index, slave in enumerate(config.slaves):
        profile = profiles.get(slave.profile)
        if profile is not None:
            yield from _against_profile(config, index, slave, profile)


def _line(config: Config) -> Iterator[Contradiction]:
    paths: tuple[KeyPath, ...] = (("line", "databits"), ("line", "framing"))
    if config.line.databits != 8 and config.line.framing == "rtu":  # noqa: PLR2004  # RTU sends whole bytes
        yield Contradiction(paths[0], "must be 8 with framing rtu; 7 goes with ascii only", paths)
    for index, slave in enumerate(config.slaves):
        if config.line.framing == "ascii" and slave.checksum is not None:
            path: KeyPath = ("slaves", index, "checksum")
            message = "must be left out on an ascii line: its frames always carry an LRC"
            yield Contradiction(path, message, (path, paths[1]))


def _broker(config: Config) -> Iterator[Contradiction]:
    mqtt = config.mqtt
    if mqtt.password_file is not None and mqtt.username is None:
        path: KeyPath = ("mqtt", "password_file")
        message = "needs mqtt.username: a password without a user name is never sent"
        yield Contradiction(path, message, (path, ("mqtt", "username")))
    if mqtt.tls is not None and mqtt.tls.key is not None and mqtt.tls.cert is None:
        path = ("mqtt", "tls", "key")
        yield Contradiction(path, "needs mqtt.tls.cert, the certificate it belongs to", (path, ("mqtt", "tls", "cert")))


def _taken(config: Config) -> Iterator[Contradiction]:
    ids: dict[int, int] = {}
    names: dict[str, int] = {}
    for index, slave in enumerate(config.slaves):
        place: KeyPath = ("slaves", index)
        first = ids.setdefault(slave.id, index)
        if first != index:
            on: tuple[KeyPath, ...] = ((*place, "id"), ("slaves", first, "id"))
            yield Contradiction(on[0], f"id {slave.id} is taken by slaves[{first}]; every slave needs its own", on)
        other = names.setdefault(device_name(slave), index)
        if other == index or (first != index and not slave.name and not config.slaves[other].name):
            continue
        on = tuple(("slaves", number, key) for number in (index, other) for key in ("name", "id"))
        if slave.name:
            message = f"the name {slave.name} is taken by slaves[{other}]; every slave needs its own"
            yield Contradiction((*place, "name"), message, on)
        else:
            message = f"its default name {device_name(slave)} is taken by slaves[{other}]; give it a name"
            yield Contradiction(place, message, on)


def _against_profile(config: Config, index: int, slave: SlaveConfig, profile: Profile) -> Iterator[Contradiction]:
    of: KeyPath = ("slaves", index, "profile")
    path: KeyPath = ("slaves", index, "id")
    first, last = profile.ids
    if not first <= slave.id <= last:
        yield Contradiction(path, f"must be from {first} to {last} for profile {profile.name}", (path, of))
    path = ("slaves", index, "checksum")
    if slave.checksum is not None and slave.checksum not in profile.checksums:
        allowed = " or ".join(profile.checksums)
        yield Contradiction(path, f"must be {allowed} for profile {profile.name}", (path, of))
    framing: KeyPath = ("line", "framing")
    if config.line.framing not in profile.framings:
        allowed = " or ".join(profile.framings)
        message = f"profile {profile.name} speaks {allowed} only, and line.framing is {config.line.framing}"
        yield Contradiction(of, message, (framing, of))
    path = ("slaves", index, "interval")
    given = slave.interval if "interval" in slave.model_fields_set else config.poll.interval
    if 0 < given < profile.min_interval:
        message = f"must be at least {duration_text(profile.min_interval)} for profile {profile.name}, or 0"
        yield Contradiction(path, message, (path, of, ("poll", "interval")))
    known = {value.name: value for value in profile.values}
    for name in slave.calibration:
        path = ("slaves", index, "calibration", name)
        if name not in known:
            yield Contradiction(path, unknown_value(name, profile), (path, of), key=True)
        elif known[name].is_text:
            yield Contradiction(
                path, "is published as text or true and false; only a number can be calibrated", (path, of)
            )


def unknown_value(name: str, profile: Profile) -> str:
    """Return the message for a name that no value of the profile has."""
    near = nearest(name, profile.value_names)
    what = f"is no value of profile {profile.name}; "
    return what + (f"did you mean {near}?" if near else f"its values: {', '.join(profile.value_names)}")
