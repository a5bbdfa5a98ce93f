"""Settings come from section `mqtt` of the configuration and never show a password."""

from __future__ import annotations

from lfs10d.config.models import MqttConfig, TlsConfig
from lfs10d.mqtt.settings import BrokerSettings, Version, no_password
from lfs10d.system.secret import Secret


def test_the_section_is_taken_over_key_by_key() -> None:
    config = MqttConfig.model_validate(
        {
            "host": "gate",
            "port": 8883,
            "version": "3.1.1",
            "username": "u",
            "tls": {"ca": "/ca", "cert": "/c", "key": "/k"},
            "keepalive": "1.5s",
        }
    )
    settings = BrokerSettings.of(config, client_id="me", password=no_password)
    assert settings == BrokerSettings(
        "gate", 8883, "me", Version.V311, "u", no_password, TlsConfig(ca="/ca", cert="/c", key="/k"), 2
    )


def test_without_tls_there_is_none() -> None:
    settings = BrokerSettings.of(MqttConfig(), client_id="me", password=no_password)
    assert settings.tls is None
    assert settings.version is Version.V5
    assert settings.place == "broker localhost:1883"


def test_a_password_is_not_shown() -> None:
    settings = BrokerSettings("gate", 1883, "me", password=lambda: Secret("hunter2"))
    assert "password" not in repr(settings)
    assert no_password() is None


def test_a_list_of_hosts_gives_each_node_its_settings() -> None:
    config = MqttConfig.model_validate({"host": ["a", "b:8884", "[2001:db8::7]"], "port": 8883, "username": "u"})
    settings = BrokerSettings.of(config, client_id="me", password=no_password)
    nodes = settings.nodes
    assert [node.place for node in nodes] == ["broker a:8883", "broker b:8884", "broker [2001:db8::7]:8883"]
    assert {(node.username, node.client_id, node.others) for node in nodes} == {("u", "me", ())}


def test_one_host_is_the_only_node() -> None:
    settings = BrokerSettings("gate", 1883, "me")
    assert settings.nodes == (settings,)
