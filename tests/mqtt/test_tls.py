"""A TLS context is safe by default, and a file that is of no use is named."""

from __future__ import annotations

import ssl
import subprocess
from pathlib import Path

import pytest

from lfs10d.config.models import TlsConfig
from lfs10d.errors import BrokerError
from lfs10d.mqtt.tls import tls_context
from tests.support.brokers import Authority


def test_certificate_and_name_are_checked_from_tls_1_2_on() -> None:
    context = tls_context(TlsConfig())
    assert context.verify_mode is ssl.CERT_REQUIRED
    assert context.check_hostname
    assert context.minimum_version is ssl.TLSVersion.TLSv1_2


def test_what_is_asked_of_an_authority_does_not_grow_with_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python 3.13 sets X509_STRICT: the authority that 3.11 accepted must not lose the broker after an upgrade."""
    make = ssl.create_default_context

    def strict(*, cafile: str | None) -> ssl.SSLContext:
        context = make(cafile=cafile)
        context.verify_flags |= ssl.VERIFY_X509_STRICT
        return context

    monkeypatch.setattr(ssl, "create_default_context", strict)
    assert not tls_context(TlsConfig()).verify_flags & ssl.VERIFY_X509_STRICT


def test_an_authority_and_a_certificate_of_ones_own_are_loaded(authority: Authority) -> None:
    certificate, key = authority.issue("gate")
    context = tls_context(TlsConfig(ca=authority.ca, cert=certificate, key=key))
    assert [each["subject"] for each in context.get_ca_certs()] == [((("commonName", "lfs10d test authority"),),)]


def test_a_key_in_the_file_of_the_certificate_is_enough(authority: Authority) -> None:
    certificate, key = authority.issue("gate")
    both = Path(certificate).with_name("both.pem")
    both.write_text(Path(key).read_text() + Path(certificate).read_text())
    assert tls_context(TlsConfig(ca=authority.ca, cert=str(both))).verify_mode is ssl.CERT_REQUIRED


def test_a_missing_authority_is_named(tmp_path: Path) -> None:
    with pytest.raises(BrokerError) as caught:
        tls_context(TlsConfig(ca=str(tmp_path / "ca.pem")))
    assert str(caught.value) == f"mqtt.tls.ca: {tmp_path / 'ca.pem'}: no such file or directory"


def test_an_authority_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "ca.pem").write_text("hello")
    with pytest.raises(BrokerError) as caught:
        tls_context(TlsConfig(ca=str(tmp_path / "ca.pem")))
    assert str(caught.value).startswith(f"mqtt.tls.ca: {tmp_path / 'ca.pem'}: not a usable PEM file without passphrase")


def test_the_key_of_another_certificate_is_named(authority: Authority) -> None:
    certificate, _ = authority.issue("gate")
    _, key = authority.issue("other")
    with pytest.raises(BrokerError) as caught:
        tls_context(TlsConfig(cert=certificate, key=key))
    assert str(caught.value).startswith(f"mqtt.tls.cert: {certificate}, mqtt.tls.key: {key}: not a usable PEM file")


def test_a_missing_certificate_is_named(tmp_path: Path) -> None:
    with pytest.raises(BrokerError) as caught:
        tls_context(TlsConfig(cert=str(tmp_path / "gate.pem")))
    assert str(caught.value) == f"mqtt.tls.cert: {tmp_path / 'gate.pem'}: no such file or directory"


def test_a_key_under_a_passphrase_asks_nobody(authority: Authority) -> None:
    certificate, key = authority.issue("gate")
    locked = f"{key}.locked"
    subprocess.run(
        [authority.openssl, "pkey", "-in", key, "-aes256", "-passout", "pass:secret", "-out", locked],
        check=True,
        capture_output=True,
    )
    with pytest.raises(BrokerError, match="without passphrase"):
        tls_context(TlsConfig(cert=certificate, key=locked))
