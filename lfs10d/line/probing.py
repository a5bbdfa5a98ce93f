"""Which offline or doubtful device is probed next, and when.

An offline device is probed after 1 s, 2 s, 4 s ... up to `probe_interval_max`. All probes together take at most 5 % of
the line while any device answers. While none does they have the line in turn, each at most once a second; the first
answer then makes all of them due at once, share or no share: after a power cut every device is found in seconds.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

from lfs10d.line.device import Device
from lfs10d.line.quota import Quota

PROBE_SHARE = 0.04
"""The part of the line that probes are given while any device answers: what one of them takes beyond that, and the
polls that some sensors ignore right after it, must fit into the 5 % that all probes together may cost."""
PROBE_CREDIT = 1.0
"""Line time in s that probes may take ahead of their share, so that a single silent device is probed at 1, 2, 4 s."""
PROBE_SPACING = 1.0
"""Shortest interval in s between probes of a device while none answers."""


class ProbeAccount:
    """The common share of all probes; it limits them only while any device answers."""

    def __init__(self, probing: Probing, quota: Quota) -> None:
        self._probing = probing
        self._quota = quota

    def allows(self, now: float) -> bool:
        """Whether the line may be used now."""
        return not self._probing.anyone_online or self._quota.allows(now)

    def ready_at(self, now: float) -> float:
        """When the line may be used next; not before `now`."""
        return self._quota.ready_at(now) if self._probing.anyone_online else now

    def spend(self, taken: float, now: float) -> None:
        """Note that `taken` s of the line were used."""
        if self._probing.anyone_online:
            self._quota.spend(taken, now)


class Probing:
    """The offline devices of one line; `now` is the line's clock at the beginning."""

    def __init__(self, now: float) -> None:
        self._quota = Quota(PROBE_SHARE, credit=PROBE_CREDIT, now=now)
        self._offline: list[Device] = []
        self.anyone_online = False
        self.next_at = inf

    def review(self, devices: Iterable[Device], now: float) -> None:
        """Look at all devices again, after any change of health or configuration."""
        polled = [device for device in devices if device.spec.enabled]
        self._offline = [device for device in polled if device.doubtful]
        answering = any(device.online for device in polled)
        if answering and not self.anyone_online:
            for device in self._offline:
                device.next_probe = now
                device.probe_exempt = True
        self.anyone_online = answering
        self.plan(now)

    def plan(self, now: float) -> None:
        """Find out when a probe may be next: `next_at`."""
        ready = self._quota.ready_at(now)
        self.next_at = min((self._allowed_at(device, ready) for device in self._offline), default=inf)

    def stop(self) -> None:
        """Probe no device until the next review."""
        self._offline = []
        self.anyone_online = False
        self.next_at = inf

    def choose(self, now: float, excluded: frozenset[int]) -> Device | None:
        """Return the device to probe now, if any."""
        if now < self.next_at:
            return None
        ready = self._quota.ready_at(now)
        waiting = [d for d in self._offline if not d.polling and d.slave not in excluded]
        device = min(waiting, key=lambda d: (not d.probe_exempt, self._wished_at(d)), default=None)
        if device is None:
            self.next_at = now + PROBE_SPACING
            return None
        self.next_at = self._allowed_at(device, ready)
        return device if self.next_at <= now else None

    @property
    def account(self) -> ProbeAccount:
        """The share of probes, for jobs that probe too."""
        return ProbeAccount(self, self._quota)

    def spend(self, device: Device, taken: float, now: float) -> None:
        """Note that a probe of `device` took `taken` s of the line."""
        if self.anyone_online and not device.probe_exempt:
            self._quota.spend(taken, now)

    def _wished_at(self, device: Device) -> float:
        return device.next_probe if self.anyone_online else device.last_asked + PROBE_SPACING

    def _allowed_at(self, device: Device, ready: float) -> float:
        wished = self._wished_at(device)
        return max(wished, ready) if self.anyone_online and not device.probe_exempt else wished
