"""A screenshot of every state of the page: `python -m tests.web.screens [FOLDER] [STATE ...]`, or `make screens`."""

from __future__ import annotations

import sys
from pathlib import Path

from playwright.sync_api import Browser

from tests.support.chromium import chromium
from tests.support.page_states import STATES
from tests.support.pages import serving

WIDTHS = {"360": (360, False), "768": (768, True), "1440": (1440, False)}
"""Pixels, and whether it is dark."""
WITH_CONTROLS = ("line", "device", "scan-running", "mounting", "request-")


def shoot(browser: Browser, state: str, folder: Path) -> None:
    """Write one state at each width."""
    path, make = STATES[state]
    with serving() as server:
        server.do(lambda: make(server))
        context = browser.new_context()
        page = context.new_page()
        if state.startswith(WITH_CONTROLS):
            cookie = server.do(server.token.cookie.reveal)
            context.add_cookies([{"name": "lfs10d_session", "value": cookie, "url": server.address}])
        page.goto(server.address + path)
        for name, (width, dark) in WIDTHS.items():
            page.set_viewport_size({"width": width, "height": 800})
            page.emulate_media(color_scheme="dark" if dark else "light")
            page.wait_for_timeout(500)
            page.screenshot(path=folder / f"{state}-{name}.png", full_page=state != "247-sensors")
        context.close()


def main(arguments: list[str]) -> None:
    """Write the states that are named, or all."""
    folder = Path(arguments[0] if arguments else "screens")
    folder.mkdir(parents=True, exist_ok=True)
    with chromium() as browser:
        for state in arguments[1:] or STATES:
            shoot(browser, state, folder)
            print(state, flush=True)  # noqa: T201  # what it is for


if __name__ == "__main__":
    main(sys.argv[1:])
