"""States of the page that a person or the browser brings about, on top of those that `page_states` makes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from playwright.sync_api import Page, expect

from tests.support.pages import PageServer

Act = Callable[[Page, PageServer], object]
HOUR: Final = 3600
"""s"""
LATER = """(seconds) => {
    const dates = Date.now.bind(Date), ticks = performance.now.bind(performance);
    Date.now = () => dates() + seconds * 1000;
    performance.now = () => ticks() + seconds * 1000;
}"""
"""The browser's clocks as they stand after a sleep."""


def guess(page: Page, token: str = "wrong-horse") -> None:  # noqa: S107 - a wrong one
    """Enter a token, in the dialog that is opened for it."""
    if not page.get_by_role("dialog").is_visible():
        page.get_by_role("button", name="Enter token", exact=True).click()
    page.get_by_role("textbox", name="Token").fill(token)
    page.keyboard.press("Enter")


def _wrong(page: Page, server: PageServer) -> None:
    del server
    guess(page)
    expect(page.get_by_role("alert")).to_have_text("The token is wrong.")


def _limited(page: Page, server: PageServer) -> None:
    for _ in range(5):
        _wrong(page, server)
        page.get_by_role("textbox", name="Token").fill("")
    guess(page)
    expect(page.get_by_role("alert")).to_contain_text("too many wrong tokens", ignore_case=True)


def _tabbed(times: int) -> Act:
    def act(page: Page, server: PageServer) -> None:
        del server
        page.locator(".card, h1").first.wait_for()
        for _ in range(times):
            page.keyboard.press("Tab")

    return act


def _woken(page: Page, server: PageServer) -> None:
    """Wake after an hour in which nothing came: the network is not there yet."""
    expect(page.locator("#banner")).to_contain_text("Live")
    server.close()
    page.evaluate(LATER, HOUR)
    expect(page.locator("#banner")).to_contain_text("NOT LIVE: nothing has come from the page's server for 60")


def _server_away(page: Page, server: PageServer) -> None:
    expect(page.locator("#banner")).to_contain_text("Live")
    server.close()
    expect(page.locator("#banner")).to_contain_text("NOT LIVE: nothing has come", timeout=15_000)


def _in_unit(unit: str) -> Act:
    def act(page: Page, server: PageServer) -> None:
        del server
        page.get_by_label("Speed in").select_option(unit)

    return act


def _tried(page: Page, server: PageServer) -> None:
    """Another slave id, tried and about to be carried out."""
    server.answers("line0", {})
    page.get_by_label("New id").fill("9")
    page.get_by_role("button", name="Try it first (changes nothing)").click()
    page.get_by_role("button", name="Change id 2 to 9 now").wait_for()


ACTED: Final[Mapping[str, tuple[str, Act]]] = {
    "token-wrong": ("all-well", _wrong),
    "token-limited": ("all-well", _limited),
    "keyboard-skip": ("all-well", _tabbed(1)),
    "keyboard-unit": ("all-well", _tabbed(3)),
    "keyboard-card": ("all-well", _tabbed(7)),
    "keyboard-controls": ("line", _tabbed(14)),
    "reduced-motion": ("device", lambda page, _: page.emulate_media(reduced_motion="reduce")),
    "woken": ("all-well", _woken),
    "server-away": ("device", _server_away),
    "storm-kmh": ("storm", _in_unit("km/h")),
    "beaufort": ("storm-device", _in_unit("bft")),
    "readdress-tried": ("device", _tried),
}
"""State: the state of `page_states` it begins with, and what is done."""
