"""The demo's remarks and its last line. Pure."""

from __future__ import annotations

from typing import Final

from lfs10d.cli.demo.broker import Broker
from lfs10d.cli.demo.page import Page
from lfs10d.cli.demo.scenario import BASE_TOPIC, BAUDRATE, SENSORS
from lfs10d.cli.render.live_state import LiveState

SUBJECT: Final = f"lfs10d demo: eight LFS10 wind sensors on a simulated RS485 line, {BAUDRATE} baud"
NEWEST: Final = "5"
"""The newest version of MQTT."""


def remarks(broker: Broker, page: Page | None) -> tuple[str, ...]:
    """Return the lines below the table: what is shown, which sensors are faulty, the page, how to subscribe."""
    seen = ("The page in a browser needs starlette and uvicorn: install lfs10d[web], as docs/web.md shows.",)
    if page is not None:
        seen = (f"In a browser: {page.address} (token for its controls: {page.token})",)
    return (
        SUBJECT,
        f"simulated line > lfs10d > {broker.name} (MQTT {broker.speaks}, 127.0.0.1:{broker.port}) > this view",
        *(
            ()
            if broker.speaks == NEWEST
            else (f"{broker.name} supports no newer MQTT; with mosquitto installed this is MQTT {NEWEST}.",)
        ),
        *(f"{sensor.name} {sensor.remark}" for sensor in SENSORS if sensor.remark is not None),
        *seen,
        f"Subscribe too: mosquitto_sub -h 127.0.0.1 -p {broker.port} -t '{BASE_TOPIC}/#' -v",
        "Ctrl-C ends the demo and leaves nothing behind.",
    )


def summary(live: LiveState, seconds: float) -> str:
    """Return the last line; samples are numbered from 1 for each sensor."""
    devices = live.devices.values()
    samples = sum(max(0, device.seq) for device in devices)
    online = sum(device.online for device in devices)
    return (
        f"lfs10d demo: {samples} samples in {seconds:.0f} s, {online} of {len(devices)} sensors online; "
        "nothing is left running"
    )
