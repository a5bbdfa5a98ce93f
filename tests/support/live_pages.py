"""The page in front of everything: a simulated line, a real mosquitto, the daemon, `lfs10d web` and chromium."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page

from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.brokers import Mosquitto, path_of
from tests.support.shells import environment
from tests.support.sites import Run, Site, eventually, tell

TOKEN = "correct-horse-battery"  # noqa: S105 - of a test
LINE = "roof"
PHONE = {"width": 360, "height": 740}


class LivePage:
    """The whole; each part can be killed and started again."""

    def __init__(self, folder: Path, *, sensors: tuple[int, ...] = (), seen_status: bool = False) -> None:
        self.mosquitto = Mosquitto(path_of("mosquitto"), folder)
        self.mosquitto.start()
        self.site = Site(folder, self.mosquitto.port)
        self.line: PtyLine = self.site.line(sensors)
        self.site.write(line={"name": LINE}, slaves=list(sensors), poll={"interval": "1s"})
        self.daemon: Run = self.start_daemon()
        token = folder / "token"
        token.write_text(TOKEN + "\n")
        self._log = folder / "web.log"
        verb = ["web", "-c", str(self.site.file), "--listen", "127.0.0.1:0", "--token-file", str(token)]
        variables = environment(self.daemon.status.parent if seen_status else None)
        with self._log.open("wb") as log:
            self.web = subprocess.Popen(
                [sys.executable, "-m", "lfs10d", *verb], stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=variables
            )
        eventually(lambda: self.address, "the page's address")

    def start_daemon(self) -> Run:
        """Start a daemon as a process of its own."""
        self.daemon = self.site.run(program=("-m", "lfs10d"))
        self.daemon.ready()
        return self.daemon

    @property
    def address(self) -> str | None:
        """Return the page's address, None while it has none."""
        found = re.search(r"http://127\.0\.0\.1:\d+", self._log.read_text())
        return None if found is None else found[0]

    def plug(self, *, baudrate: int = 9600) -> Sensor:
        """Connect a factory-new sensor to the line."""
        sensor = Sensor(1, format=Format(baudrate), turnaround=0.003)
        tell(self.line, lambda line: line.add(sensor))
        return sensor

    def close(self) -> None:
        """End everything."""
        self.web.kill()
        self.web.wait()
        self.site.close()
        self.mosquitto.close()


@contextmanager
def live_page(folder: Path, *, sensors: tuple[int, ...] = (), seen_status: bool = False) -> Iterator[LivePage]:
    """Give it, in a folder of its own; `seen_status`: the page can read the daemon's status file."""
    folder.mkdir(parents=True)
    whole = LivePage(folder, sensors=sensors, seen_status=seen_status)
    try:
        yield whole
    finally:
        whole.close()


@contextmanager
def phone(browser: Browser) -> Iterator[Page]:
    """Give a page on a phone: small, touched, dense."""
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True, device_scale_factor=2)  # type: ignore[arg-type]  # a dict of its two keys
    page = context.new_page()
    page.set_default_timeout(20_000)
    try:
        yield page
    finally:
        context.close()


def seconds_until(claim: Callable[[], bool], *, since: float, within: float = 60.0) -> float:
    """Return the seconds from `since` (monotonic) until a claim holds; fails after `within`."""
    while not claim():
        assert time.monotonic() - since < within, "it does not happen"
        time.sleep(0.01)
    return time.monotonic() - since
