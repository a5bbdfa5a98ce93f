"""Debian's chromium, driven by playwright; nothing is downloaded."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, sync_playwright

from tests.support.brokers import path_of


@contextmanager
def chromium() -> Iterator[Browser]:
    """Give the browser, headless; without it the test fails in CI and is skipped elsewhere."""
    path = path_of("chromium")
    arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*arguments, "--disable-gpu"])
        try:
            yield browser
        finally:
            browser.close()
