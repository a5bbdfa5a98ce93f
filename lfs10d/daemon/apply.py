"""Applies another configuration: each part gets the settings that concern it, in order."""

from __future__ import annotations

import logging

from lfs10d.config.effective import Effective
from lfs10d.config.live_config import News
from lfs10d.config.reload import ReloadPlan
from lfs10d.daemon.discovery import discovery_payloads
from lfs10d.daemon.parts import Parts
from lfs10d.daemon.settings import (
    broker_settings,
    config_hash,
    conflict_readings,
    device_infos,
    features,
    line_info,
    store_limits,
)
from lfs10d.system import logs

log = logging.getLogger(__name__)


class ConfigChanges:
    """The events of `LiveConfig`. Used in the thread of the asyncio loop."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    async def apply(self, plan: ReloadPlan, before: Effective) -> None:
        """Apply the new `LiveConfig.now` to the parts."""
        parts, now = self._parts, self._parts.config.now
        config = now.config
        if plan.log:
            logs.install(config.log.level, config.log.format)
        if plan.publishing:
            parts.uplink.send_samples(telemetry=config.mqtt.telemetry)
        polling = plan.polling or plan.realtime or now.places != before.places
        if polling:
            polled = parts.reconfiguration.polled()
            parts.line.take(polled, now.loaded.profiles, line=plan.line, realtime=plan.realtime)
            if plan.line:
                parts.baudrate_watch.begin()
        if polling or plan.publishing:
            parts.publisher.configure(line_info(config.line), device_infos(config, now.loaded.profiles))
        if polling:
            conflicts = {name: why for name, why in now.conflicts.items() if name not in before.conflicts}
            parts.publisher.on_readings(conflict_readings(conflicts, parts.clock.now().mono))
        parts.dispatcher.allow(frozenset(config.commands))
        parts.uplink.discovery.configure(config.homeassistant.prefix, discovery_payloads(config, now.loaded.profiles))
        parts.storage.look()
        parts.publisher.introduce(config_hash=config_hash(config), changes=now.changes.count, features=features(config))
        parts.access.on_config(before.config, config)
        await parts.reconfiguration.reconfigured(before.config, config)
        parts.uplink.limit(store_limits(config.store))
        await parts.uplink.reload(broker_settings(parts.config) if plan.broker else None)

    def report(self, news: News) -> None:
        """Report changes that an edit of the file overruled or that cannot hold, and a disk that fails."""
        for message in news.messages:
            log.warning("%s", message)
        if news.storage is not None:
            self._parts.storage.on_failure(news.storage)
        for lost in news.dropped:
            facts = {"key": lost.key, "device": lost.device, "lost": lost.lost, "message": lost.message}
            self._parts.publisher.announce("change_dropped", facts)
