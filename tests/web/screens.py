"""A screenshot of every state of the page: `python -m tests.web.screens [FOLDER] [STATE ...]`, or `make screens`.

Each is also checked by axe-core's rules of accessibility, and for what scrolls sideways; it ends with 1 where either
finds anything.
"""

from __future__ import annotations

import sys
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe  # type: ignore[import-untyped]  # it has no types
from playwright.sync_api import Browser, Page

from tests.support.chromium import chromium
from tests.support.page_acts import ACTED
from tests.support.page_states import STATES
from tests.support.pages import PageServer, serving

WIDTHS = {
    "360": (360, False), "360-dark": (360, True), "768": (768, False), "768-dark": (768, True),
    "1440": (1440, False), "1440-dark": (1440, True),
}  # fmt: skip
"""Pixels, and whether it is dark."""
WITH_CONTROLS = ("line", "device", "scan-running", "mounting", "request-")
"""States that are seen by who has entered the token."""


def opened(page: Page, server: PageServer, state: str) -> None:
    """Open the page in a state that `page_states` makes."""
    path, make = STATES[state]
    server.do(lambda: make(server))
    if state.startswith(WITH_CONTROLS):
        cookie = server.do(server.token.cookie.reveal)
        page.context.add_cookies([{"name": "lfs10d_session", "value": cookie, "url": server.address}])
    page.goto(server.address + path)


def findings(page: Page) -> list[str]:
    """Return what is wrong with the page as it is shown now: rules of accessibility, what scrolls sideways."""
    found = [
        f"{each['id']}: {node['html'][:200]}"
        for each in Axe().run(page).response["violations"]
        for node in each["nodes"]
    ]
    wider = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    return found + ([f"it is {wider} px wider than the window"] if wider > 0 else [])


def shoot(browser: Browser, state: str, folder: Path) -> list[str]:
    """Write one state at each width; return what is wrong with it."""
    found = []
    beginning, act = ACTED.get(state, (state, lambda *_: None))
    with serving() as server:
        context = browser.new_context(viewport={"width": 360, "height": 800})
        page = context.new_page()
        opened(page, server, beginning)
        act(page, server)
        page.wait_for_timeout(700)  # the last hour is asked for once the page is there
        for name, (width, dark) in WIDTHS.items():
            page.set_viewport_size({"width": width, "height": 800})
            page.emulate_media(color_scheme="dark" if dark else "light")
            page.wait_for_timeout(300)
            page.screenshot(path=folder / f"{state}-{name}.png", full_page=state != "247-sensors")
            found += [f"{state} {name}: {each}" for each in findings(page)]
        context.close()
    return found


def main(arguments: list[str]) -> int:
    """Write the states that are named, or all; return how the process ends."""
    folder = Path(arguments[0] if arguments else "screens")
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    with chromium() as browser:
        for state in arguments[1:] or (*STATES, *ACTED):
            new = shoot(browser, state, folder)
            print("\n".join([state, *new]), flush=True)  # noqa: T201  # what it is for
            found += new
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
