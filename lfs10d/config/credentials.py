"""Finds and reads the files of the login: the password and the certificates."""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping
from pathlib import Path

from lfs10d.config.models import MqttConfig, TlsConfig
from lfs10d.schema.fields import quoted
from lfs10d.schema.messages import KeyPath
from lfs10d.system.regular_file import read_regular
from lfs10d.system.secret import Secret

CREDENTIAL = "mqtt-password"
"""Name of the systemd credential (LoadCredential=) that holds the broker's password."""

RUN = Path("/run/credentials")
"""Where systemd puts the credentials of each unit while it runs, readable by root and the service alone."""
KEPT = Path("/etc/lfs10d")

LARGEST_PASSWORD = 65_535
"""Bytes: binary data of MQTT 5.0, section 1.5.6."""

LONGEST_PATH = 4096
"""Longest path that is shown, in characters (PATH_MAX of Linux)."""


DENIED = "permission denied"
"""The system's reason for what we may not read, as `reason` says it."""


class UnreadableError(Exception):
    """A file beside the configuration cannot be used; the message says why."""


def reason(error: OSError | ValueError) -> str:
    """Return why a file cannot be read, as the system says it."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def readable(path: Path) -> None:
    """Raise UnreadableError if a file cannot be read."""
    try:
        read_regular(path, 1)
    except (OSError, ValueError) as error:
        raise UnreadableError(f"{_named(path)} cannot be read: {reason(error)}") from None


def password_in(path: Path) -> Secret:
    """Return the first line of a file, without a byte order mark; raises UnreadableError if it is empty."""
    try:
        content = read_regular(path, len(BOM_UTF8) + LARGEST_PASSWORD + 2)
        first = content.decode("utf-8-sig").partition("\n")[0].removesuffix("\r")
    except UnicodeDecodeError:
        raise UnreadableError(f"{_named(path)} is no UTF-8 text") from None
    except (OSError, ValueError) as error:
        raise UnreadableError(f"{_named(path)} cannot be read: {reason(error)}") from None
    if not first or len(first.encode()) > LARGEST_PASSWORD:
        raise UnreadableError(f"{_named(path)} must hold the password in its first line")
    return Secret(first)


def credential_file(environment: Mapping[str, str]) -> Path | None:
    """Return the file of the systemd credential, if this service has one."""
    folder = environment.get("CREDENTIALS_DIRECTORY")
    path = Path(folder, CREDENTIAL) if folder else None
    return path if path is not None and path.exists() else None


def service_password(unit: str, run: Path = RUN, kept: Path = KEPT) -> tuple[Secret | None, str]:
    """Return the password that systemd passes to a service, for a verb called by its administrator.

    It lies in `run` while the service runs, and in `kept`, where docs/installation.md puts it, always. Without one the
    text says where it was looked for and why it was not read; empty where there is none.
    """
    why: list[str] = []
    for path in (run / unit / CREDENTIAL, kept / CREDENTIAL):
        try:
            return password_in(path), ""
        except UnreadableError as error:
            if _is_there(path):
                why.append(str(error))
    return None, "; ".join(why)


def _is_there(path: Path) -> bool:
    """Whether the file exists, or may exist in a folder that we may not read."""
    try:
        path.stat()
    except PermissionError:
        return True
    except OSError:
        return False
    return True


def unreadable(mqtt: MqttConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the problems of the files named in section `mqtt` (absolute paths), with their keys."""
    if mqtt.password_file is not None:
        try:
            password_in(Path(mqtt.password_file))
        except UnreadableError as error:
            yield ("mqtt", "password_file"), str(error)
    if mqtt.tls is None:
        return
    missing = False
    for key, file in (("ca", mqtt.tls.ca), ("cert", mqtt.tls.cert), ("key", mqtt.tls.key)):
        try:
            if file is not None:
                readable(Path(file))
        except UnreadableError as error:
            missing = True
            yield ("mqtt", "tls", key), str(error)
    if not missing:
        yield from _unusable(mqtt.tls)


def _unusable(tls: TlsConfig) -> Iterator[tuple[KeyPath, str]]:
    import ssl  # noqa: PLC0415  # a megabyte, and only TLS needs it

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    if tls.ca is not None:
        try:
            context.load_verify_locations(tls.ca)
        except (OSError, ValueError):
            yield ("mqtt", "tls", "ca"), f"{_named(tls.ca)} holds no certificate in PEM form"
    if tls.cert is not None:
        try:
            # A key under a passphrase would ask on the terminal; an empty answer makes it an error.
            context.load_cert_chain(tls.cert, tls.key, password=lambda: "")
        except (OSError, ValueError):
            message = f"{_named(tls.cert)} and its key cannot be used: both in PEM form, matching, no passphrase?"
            yield ("mqtt", "tls", "cert"), message


_STRICTLY_NEEDED = (
    (b"\x06\x03\x55\x1d\x0f", "key usage"),
    (b"\x06\x03\x55\x1d\x0e", "a subject key identifier"),
    (b"\x06\x03\x55\x1d\x13\x01\x01\xff", "critical basic constraints"),
)
"""What OpenSSL's X509_V_FLAG_X509_STRICT wants of an authority (RFC 5280, section 4.2.1).

Extensions as they stand in a certificate: DER of the object identifier, and `critical` where asked.
"""


def missing_in_authorities(file: str) -> tuple[str, ...]:
    """Return the extensions that strict clients miss in a file of authorities; () for none, or if it cannot be read."""
    import ssl  # noqa: PLC0415  # a megabyte, and only TLS needs it

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.load_verify_locations(file)
    except (OSError, ValueError):
        return ()
    authorities = context.get_ca_certs(binary_form=True)
    return tuple(name for code, name in _STRICTLY_NEEDED if any(code not in each for each in authorities))


def _named(path: Path | str) -> str:
    return quoted(str(path), LONGEST_PATH)
