"""The page in front of a real daemon, looked at from outside: `python -m tests.web.live FOLDER [mount | outages]`.

`mount`: two factory-new sensors are adopted one after the other on a phone, by taps and typing alone, with a
screenshot of each step. `outages`: broker, daemon and port are killed and come back, five times each; printed are the
seconds until the page shows it. Not in CI: each takes minutes.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from playwright.sync_api import Browser, Page, expect

from tests.support.chromium import chromium
from tests.support.live_pages import LINE, TOKEN, LivePage, live_page, phone, seconds_until

TIMES = 5
ADOPTED_WITHIN = 90_000
"""ms: an adoption takes 20 to 25 s, more on a busy machine."""


class Steps:
    """What the person sees at each step: a screenshot, and the words on the page."""

    def __init__(self, page: Page, folder: Path) -> None:
        self._page = page
        self._folder = folder
        self._number = 0
        self._began = time.monotonic()
        folder.mkdir(parents=True, exist_ok=True)

    def see(self, name: str) -> None:
        """Take it."""
        self._number += 1
        self._page.screenshot(path=self._folder / f"mount-{self._number:02}-{name}.png")
        print(f"{time.monotonic() - self._began:6.1f} s  {name}", flush=True)  # noqa: T201  # what it is for


def mount(browser: Browser, whole: LivePage, folder: Path) -> None:
    """Adopt two sensors as a person on a roof does."""
    with phone(browser) as page:
        steps = Steps(page, folder)
        page.goto(whole.address or "")
        expect(page.locator("#banner")).to_have_text("Live")
        steps.see("overview")
        page.get_by_role("link", name=LINE, exact=True).tap()
        page.get_by_role("button", name="Enter the token").tap()
        page.get_by_role("textbox", name="Token").press_sequentially("Wrong-horse", delay=20)
        page.get_by_role("button", name="Open the controls").tap()
        expect(page.get_by_role("alert")).to_have_text("The token is wrong.")
        steps.see("wrong-token")
        page.get_by_role("textbox", name="Token").fill("")
        page.get_by_role("textbox", name="Token").press_sequentially(TOKEN, delay=20)
        page.get_by_role("button", name="Open the controls").tap()
        names = page.get_by_label("Names, in order (or none)")
        names.tap()
        names.press_sequentially("mast-top mast-low", delay=20)
        steps.see("named")
        page.get_by_role("button", name="Mount sensors").tap()
        state = page.locator(".mounting")
        expect(state).to_contain_text("Plug in a sensor.")
        steps.see("waiting")
        for number, name in enumerate(("mast-top", "mast-low")):
            whole.plug(baudrate=9600 if number == 0 else 19200)
            since = time.monotonic()
            seen = set[str]()
            while not page.locator(".mounted li").nth(number).is_visible():
                words = state.inner_text()
                if words not in seen:
                    seen.add(words)
                    print(f"{time.monotonic() - since:6.1f} s  after plugging in: {words!r}", flush=True)  # noqa: T201  # as above
                    steps.see(f"{name}-plugged")
                assert time.monotonic() - since < ADOPTED_WITHIN / 1000
                page.wait_for_timeout(200)
            expect(page.locator(".mounted li").nth(number)).to_contain_text("m/s")
            steps.see(f"{name}-adopted")
            print(f"{time.monotonic() - since:6.1f} s  {name} adopted and its value seen", flush=True)  # noqa: T201  # as above
        expect(state).to_contain_text("All are adopted.")
        steps.see("all-adopted")
        page.get_by_role("link", name="lfs10d").tap()
        expect(page.locator(".card")).to_have_count(2)
        figures = page.locator(".card .speed").first
        first = figures.inner_text()
        expect(figures).not_to_have_text(first)
        steps.see("both-turn")


def notice(page: Page) -> str:
    """Return what the page says of the line above its sensors, in words; empty where all is well."""
    words: str = page.evaluate("[...document.querySelectorAll('.notice')].map((each) => each.textContent).join(' ')")
    return words


def all_well(page: Page) -> bool:
    """Whether every sensor has a live, good value and nothing is said of the line."""
    well: bool = page.evaluate(
        """() => document.getElementById("banner").textContent === "Live" && !document.querySelector(".notice")
            && document.querySelectorAll(".card").length === 2
            && [...document.querySelectorAll(".card:not(.old) .state.good")].length === 2"""
    )
    return well


def outages(browser: Browser, whole: LivePage, folder: Path) -> None:
    """Kill each part and let it come back, and print how long the page takes to show it."""
    del folder

    def kill_broker() -> None:
        whole.mosquitto.kill()

    def kill_daemon() -> None:
        whole.daemon.process.kill()
        whole.daemon.process.wait()

    parts: dict[str, tuple[Callable[[], object], Callable[[], object], str]] = {
        "broker": (kill_broker, whole.mosquitto.start, "broker"),
        "daemon": (kill_daemon, whole.start_daemon, "daemon"),
        "port": (whole.line.stop, whole.line.start, "port"),
    }
    with phone(browser) as page:
        page.goto(whole.address or "")
        for part, (kill, revive, word) in parts.items():
            gone, back, starts, words = [], [], [], ""
            for _ in range(TIMES):
                seconds_until(lambda: all_well(page), since=time.monotonic())
                page.wait_for_timeout(3000)
                began = time.monotonic()
                kill()
                # mypy does not infer the type of a lambda's parameter from its default.
                gone.append(seconds_until(lambda word=word: word in notice(page), since=began))  # type: ignore[misc]
                words = notice(page)
                page.wait_for_timeout(4000)
                began = time.monotonic()
                revive()
                starts.append(time.monotonic() - began)
                back.append(seconds_until(lambda: all_well(page), since=time.monotonic()))
            shown = ", ".join(
                f"{name} {median(times):.2f} s ({min(times):.2f} to {max(times):.2f})"
                for name, times in (("gone", gone), ("start", starts), ("back after the start", back))
            )
            print(f"{part}: {shown}; {words!r}", flush=True)  # noqa: T201  # as above


VIEWS: dict[str, tuple[tuple[int, ...], Callable[[Browser, LivePage, Path], None]]] = {
    "mount": ((), mount),
    "outages": ((2, 3), outages),
}


def main(arguments: list[str]) -> None:
    """Look at what is named, or at all."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # it would make each start slow
    folder = Path(arguments[0] if arguments else "screens")
    for name in arguments[1:] or VIEWS:
        sensors, view = VIEWS[name]
        with (
            tempfile.TemporaryDirectory() as place,
            live_page(Path(place, "site"), sensors=sensors) as whole,
            chromium() as browser,
        ):
            view(browser, whole, folder)


if __name__ == "__main__":
    main(sys.argv[1:])
