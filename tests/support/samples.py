"""A good sample, as the contract's example has it, for tests of what carries samples."""

from __future__ import annotations

from lfs10d.telemetry.publication import Sample

SAMPLE = Sample(
    device="mast-top",
    boot="k3f9a2c7",
    seq=48211,
    ts=1795298022003,
    clock="synced",
    values={"wind_speed": 12.34},
    units={"wind_speed": "m/s"},
    names=("wind_speed",),
    quality="good",
    error=None,
    rtt_ms=18.2,
)
