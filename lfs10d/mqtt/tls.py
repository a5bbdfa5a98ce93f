"""The TLS context of a connection to the broker."""

from __future__ import annotations

import ssl
from functools import cache

from lfs10d.config.models import TlsConfig
from lfs10d.errors import BrokerError


@cache
def _closing_socket() -> type[ssl.SSLSocket]:
    """Return the class of sockets that are closed when the handshake fails; paho leaves that to chance."""

    class ClosingSocket(ssl.SSLSocket):
        def do_handshake(self, block: bool = False) -> None:  # noqa: FBT001, FBT002 - the signature of the library
            try:
                super().do_handshake(block)
            except BaseException:
                self.close()
                raise

    return ClosingSocket


def tls_context(tls: TlsConfig) -> ssl.SSLContext:
    """Return a context for TLS 1.2 or newer that checks certificate and name; raise BrokerError. Reads files."""
    try:
        context = ssl.create_default_context(cafile=tls.ca)
    except OSError as error:
        raise BrokerError(f"mqtt.tls.ca: {tls.ca}: {_words(error)}") from error
    # From Python 3.13 on the default is RFC 5280 to the letter, which refuses authorities that 3.11 accepted, the one
    # made by the command in mosquitto-tls(7) among them: an upgrade of the system must not lose the broker. Chain,
    # name and dates are checked as ever; `lfs10d check` warns of such an authority.
    context.verify_flags &= ~ssl.VERIFY_X509_STRICT
    context.sslsocket_class = _closing_socket()
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if tls.cert is not None:
        try:
            # A key under a passphrase would be asked for on the terminal, where nobody sits.
            context.load_cert_chain(tls.cert, tls.key, password=lambda: "")
        except OSError as error:
            files = tls.cert if tls.key is None else f"{tls.cert}, mqtt.tls.key: {tls.key}"
            raise BrokerError(f"mqtt.tls.cert: {files}: {_words(error)}") from error
    return context


def _words(error: OSError) -> str:
    if isinstance(error, ssl.SSLError):
        reason = (error.reason or "not understood").replace("_", " ").lower()
        return f"not a usable PEM file without passphrase ({reason})"
    return (error.strerror or str(error)).lower()
