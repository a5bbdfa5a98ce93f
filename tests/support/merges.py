"""Entries of a configuration file with the defaults filled in."""

from __future__ import annotations

USUAL = {
    "interval": 1.0,
    "enabled": True,
    "label": None,
    "response_timeout": None,
    "profile": "lfs10",
    "checksum": None,
}
