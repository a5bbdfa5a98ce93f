"""Samples for the store, and files of it."""

from __future__ import annotations
