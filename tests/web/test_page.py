"""What a person does with the page, in Debian's chromium; accessibility by axe-core's rules."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from axe_playwright_python.sync_playwright import Axe  # type: ignore[import-untyped]  # it has no types
from playwright.sync_api import Browser, Page, expect

from lfs10d.web.site_model import Stream
from tests.support.chromium import chromium
from tests.support.page_states import HOSTILE, STATES, ShownLine
from tests.support.pages import TOKEN, PageServer, serving

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.long(45)]
READ_FAILS = {"status": "failed", "words": "It failed: does not answer. Check power, the plug, and the wires."}
IN_TIME = 15_000
"""ms: a loaded machine is slow."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


@pytest.fixture
def server() -> Iterator[PageServer]:
    with serving() as made:
        yield made


@pytest.fixture
def page(browser: Browser, server: PageServer) -> Iterator[Page]:
    """Give a page on a phone; no script may fail, and nothing be asked of another host."""
    context = browser.new_context(viewport={"width": 360, "height": 740}, reduced_motion="reduce")
    made = context.new_page()
    made.set_default_timeout(IN_TIME)
    expect.set_options(timeout=IN_TIME)
    faults: list[str] = []
    made.on("pageerror", lambda error: faults.append(str(error)))
    made.on("request", lambda sent: None if sent.url.startswith(server.address) else faults.append(sent.url))
    yield made
    context.close()
    assert faults == []


def login(page: Page) -> None:
    page.get_by_role("button", name="Enter token", exact=True).click()
    page.get_by_role("textbox", name="Token").fill(TOKEN)
    page.get_by_role("button", name="Open the controls").click()
    expect(page.get_by_role("button", name="Close controls")).to_be_visible()


def test_a_sensor_is_followed_live_its_unit_kept_and_what_is_old_is_grey(page: Page, server: PageServer) -> None:
    line = server.do(lambda: ShownLine(server, sensors=2))
    server.do(lambda: line.measure(10.0))
    page.goto(server.address)
    card = page.locator(".card").first
    expect(card.locator(".speed")).to_have_text("10.0 m/s")
    server.do(lambda: line.measure(20.0))
    expect(card.locator(".speed")).to_have_text("20.0 m/s")
    page.get_by_label("Speed in").select_option("bft")
    expect(card.locator(".speed")).to_have_text("8 Bft")
    page.reload()
    expect(card.locator(".speed")).to_have_text("8 Bft")
    expect(card).to_have_class("card old")
    expect(card.locator(".state")).to_contain_text("ago")


def test_a_phone_that_wakes_after_an_hour_shows_nothing_old_as_live(page: Page, server: PageServer) -> None:
    line = server.do(lambda: ShownLine(server, sensors=1, interval=600.0))
    server.do(lambda: line.measure(10.0))
    server.do(line.wind)
    page.goto(server.address)
    expect(page.locator("#banner")).to_have_text("Live")
    expect(page.locator(".more")).to_have_text("gust 10.2 m/s · mean 5.4 m/s")
    shown = page.evaluate(
        """async () => {
            const later = Date.now() + 3600e3;
            Date.now = () => later;
            document.getElementById("unit").dispatchEvent(new Event("change"));
            return ["#banner", ".more"].map((each) => document.querySelector(each).textContent).concat(
                document.querySelector(".card").className);
        }"""
    )
    assert shown[0].startswith("NOT LIVE")
    assert shown[1] == "last known: gust 10.2\xa0m/s · mean 5.4\xa0m/s"
    assert shown[2] == "card old"


SEEN = """() => {
    window.seen = [];
    const look = () => seen.push([
        document.getElementById("banner").textContent, document.querySelector(".card .speed").textContent,
        document.querySelector(".card").className,
    ]);
    new MutationObserver(look).observe(document.body, { subtree: true, childList: true, characterData: true, attributes: true });
}"""  # noqa: E501  # JavaScript
"""Keeps what the page shows after each change."""


SEE_STATE = """(state) => {
    Object.defineProperty(document, "visibilityState", { value: state, configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
}"""
"""What a browser does when its phone is put away or taken out: without a screen chromium is always visible."""


def test_a_phone_that_is_suspended_for_an_hour_shows_its_old_number_at_no_moment_as_live(
    page: Page, server: PageServer
) -> None:
    line = server.do(lambda: ShownLine(server, sensors=1, interval=3600.0))
    server.do(lambda: line.measure(10.0))
    page.clock.install()
    page.goto(server.address)
    expect(page.locator("#banner")).to_have_text("Live")
    page.evaluate(SEEN)
    page.evaluate(SEE_STATE, "hidden")
    sent = server.viewers._stream.number
    deadline = time.monotonic() + IN_TIME / 1000
    while server.viewers._stream.number < sent + 2:  # events with the old number wait for the phone to wake
        assert time.monotonic() < deadline
        time.sleep(0.05)
    page.clock.fast_forward(3_600_000)
    server.do(lambda: line.measure(20.0))
    page.evaluate(SEE_STATE, "visible")
    expect(page.locator(".card .speed")).to_have_text("20.0 m/s")
    expect(page.locator(".card")).to_have_class("card")
    expect(page.locator("#banner")).to_have_text("Live")
    seen = page.evaluate("seen")
    assert ["NOT LIVE: this page was asleep.", "10.0 m/s", "card old"] in seen, (
        "before it slept: what is seen on waking"
    )
    hidden = seen[seen.index(["NOT LIVE: this page was asleep.", "10.0 m/s", "card old"]) :]
    assert [each for each in hidden if each[1] == "10.0 m/s" and each[2] != "card old"] == [], seen


def test_after_a_sleep_the_hour_has_no_hole(page: Page, server: PageServer) -> None:
    line = server.do(lambda: ShownLine(server, sensors=1, interval=600.0))
    server.do(lambda: line.measure(10.0))
    page.goto(f"{server.address}/device/line0/mast-2")
    expect(page.locator("#banner")).to_have_text("Live")
    server.viewers._stream = Stream("another")  # as after a start of the server: nothing can be resumed

    def end_streams() -> None:
        for queue in server.viewers._queues:
            queue.put_nowait(None)

    with page.expect_request(lambda sent: "/curve/" in sent.url):
        server.do(end_streams)


def test_when_the_server_goes_away_the_page_says_so(page: Page, server: PageServer) -> None:
    line = server.do(lambda: ShownLine(server, sensors=1, interval=600.0))
    server.do(lambda: line.measure(10.0))
    page.goto(server.address)
    expect(page.locator("#banner")).to_have_text("Live")
    server.close()
    expect(page.locator("#banner")).to_contain_text("NOT LIVE")
    expect(page.locator(".card").first).to_have_class("card old")


def test_with_the_token_a_sensor_is_polled_and_readdressed_by_two_clicks(page: Page, server: PageServer) -> None:
    line = server.do(lambda: ShownLine(server, sensors=2, interval=600.0))
    server.do(line.measure)
    actions = server.answers("line0", {"device/read": READ_FAILS})
    page.goto(f"{server.address}/device/line0/mast-2")
    page.get_by_role("button", name="Enter token", exact=True).click()
    page.get_by_role("textbox", name="Token").fill("wrong")
    page.keyboard.press("Enter")
    expect(page.get_by_role("alert")).to_have_text("The token is wrong.")
    page.get_by_role("textbox", name="Token").fill(TOKEN)
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Poll now").click()
    expect(page.locator(".answer.bad").first).to_have_text(READ_FAILS["words"])
    page.get_by_label("New id").fill("9")
    page.get_by_role("button", name="Try it first (changes nothing)").click()
    page.get_by_role("button", name="Change id 2 to 9 now").click()
    expect(page.get_by_text("Done.").first).to_be_visible()
    assert actions.sent == [
        ("device/read", {"device": "mast-2"}),
        ("device/readdress", {"device": "mast-2", "to": 9, "dry_run": True}),
        ("device/readdress", {"device": "mast-2", "to": 9}),
    ]


def test_the_keyboard_alone_reaches_a_sensor_and_comes_back(page: Page, server: PageServer) -> None:
    line = server.do(lambda: ShownLine(server, sensors=2, interval=600.0))
    server.do(line.measure)
    page.goto(server.address)
    expect(page.locator(".card")).to_have_count(2)
    for _ in range(12):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.textContent") == "mast-3":
            break
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("mast-3")
    page.go_back()
    expect(page.get_by_role("heading", level=1)).to_have_text("All lines")


def test_the_keyboard_reaches_every_control_and_its_place_is_seen(page: Page, server: PageServer) -> None:
    server.do(lambda: STATES["line"][1](server))
    page.goto(f"{server.address}/line/line0")
    login(page)
    wanted = page.locator("main button:visible, main input:visible, main select:visible, main a:visible").count()
    places = set()
    for _ in range(wanted + 10):
        page.keyboard.press("Tab")
        place, style, width, visible = page.evaluate(
            """() => {
                const here = document.activeElement, style = getComputedStyle(here), box = here.getBoundingClientRect();
                const all = [...document.querySelectorAll("main button, main input, main select, main a")];
                return [all.indexOf(here), style.outlineStyle, parseFloat(style.outlineWidth), box.bottom > 0 && box.top < innerHeight];
            }"""  # noqa: E501  # JavaScript
        )
        assert place < 0 or (style == "solid" and width >= 2 and visible), place
        places.add(place)
    assert len(places - {-1}) == wanted


def test_nothing_moves_by_itself_and_so_nothing_is_to_be_reduced(page: Page, server: PageServer) -> None:
    server.do(lambda: STATES["scan-running"][1](server))
    page.emulate_media(reduced_motion="no-preference")
    page.goto(f"{server.address}/line/line0")
    login(page)
    expect(page.locator("progress")).to_be_visible()
    assert page.evaluate("document.getAnimations().length") == 0


def test_an_interval_is_set_beginning_with_the_present_one_and_only_one_of_two_buttons_is_offered(
    page: Page, server: PageServer
) -> None:
    line = server.do(lambda: ShownLine(server, sensors=2, interval=30.0))
    server.do(line.measure)
    actions = server.answers("line0", {})
    page.goto(f"{server.address}/device/line0/mast-2")
    login(page)
    expect(page.get_by_label("Interval")).to_have_value("30000ms")
    page.get_by_role("button", name="Set the interval").click()
    expect(page.get_by_text("Done.").first).to_be_visible()
    assert actions.sent == [("device/options", {"device": "mast-2", "interval": "30000ms"})]
    expect(page.get_by_role("button", name="Enable")).to_be_hidden()
    page.get_by_role("button", name="Disable").focus()
    server.do(lambda: line.devices(enabled=False))
    expect(page.get_by_role("button", name="Enable")).to_be_focused()
    expect(page.get_by_role("button", name="Disable")).to_be_hidden()


def test_mounting_is_begun_by_enter_and_each_sensor_is_seen_with_its_value(page: Page, server: PageServer) -> None:
    path, make = STATES["mounting"]
    server.do(lambda: make(server))
    page.goto(server.address + path)
    login(page)
    expect(page.locator(".mounting")).to_have_text("Plug in the next one.")
    expect(page.locator(".mounted li")).to_contain_text("mast-2: slave id 2, 9600 baud6.0 m/sgood")
    expect(page.get_by_label("Names, in order (or none)")).to_be_hidden()
    server.do(lambda: server.answers("line0", {}))
    names = page.get_by_label("Names, in order (or none)")
    names.fill("mast-top MAST")
    names.press("Enter")
    expect(page.locator(".answer.bad")).to_contain_text("'MAST' is not")
    expect(page.get_by_role("button", name="All are mounted")).to_be_hidden()


def test_what_comes_from_a_broker_is_text_and_never_a_script(page: Page, server: PageServer) -> None:
    server.do(lambda: STATES["labels"][1](server))
    page.goto(server.address)
    expect(page.get_by_text(HOSTILE)).to_be_visible()
    assert page.locator("main img, main script").count() == 0
    assert page.title() == "lfs10d"


@pytest.mark.parametrize("state", ["offline", "offline-device", "line", "labels", "status-file", "mounting"])
def test_no_rule_of_accessibility_is_broken_and_nothing_scrolls_sideways(
    state: str, page: Page, server: PageServer
) -> None:
    path, make = STATES[state]
    server.do(lambda: make(server))
    page.goto(server.address + path)
    if state in {"line", "offline-device", "mounting"}:
        login(page)
    expect(page.locator("#banner")).not_to_have_text("Connecting to the page's server ...")
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
        results = Axe().run(page)
        found = [(each["id"], [node["html"] for node in each["nodes"]]) for each in results.response["violations"]]
        assert found == [], scheme
    for width in (360, 768, 1440):
        page.set_viewport_size({"width": width, "height": 740})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
