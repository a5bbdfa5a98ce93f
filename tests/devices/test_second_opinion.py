"""A second opinion on every frame: our daemon polls pymodbus's own server, and mbpoll polls our simulated devices."""

from __future__ import annotations

import asyncio
import json
import re
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymodbus import FramerType
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from bench.broker import free_port
from lfs10d.profiles.library import load_profile
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.wire import Format
from tests.support.brokers import Mosquitto, eventually
from tests.support.recordings import RTU, TANK, simulated
from tests.support.sites import Site, View

LONGEST_REQUEST = 17 * 11 / 9600
"""s that a request in ASCII takes at 9600 baud and 11 bits."""

# Content of the registers by slave id, and what the makers' documents say it means.
LFS10 = {0x0001: [0x414F, 0xD70A], 0x0004: [2], 0x0005: [2]}
LD_E = {0x1000: [0], 0x1004: [0xD0F5, 0x0000]}
DZB = {0x3001: [4998, 123, 380, 1450], 0x5000: [7, 8]}
EH600 = {0x1001: [5000], 0x8000: [11], 0xF002: [0, 0]}
VANE = {0x0000: [2173, 10], 0x0010: [5], 0x07D0: [40]}
TANK_REGISTERS = {
    0x0100: [0x0AD7, 0x4F41],
    0x0102: [0xFFFE, 0x0001],
    0x0104: [0xFFFF, 0xFFFE],
    0x0200: [0xFFF6],
    0x0300: [3],
}
"""12.99 with both words and bytes swapped; 0x1FFFE; -2; -10."""

WIND = {"wind_speed": 12.99}
LASER = {"displacement": 53493}
PUMP = {
    "running_frequency": 49.98,
    "output_current": 12.3,
    "output_voltage": 380,
    "speed": 1450,
    "fault": 7,
    "communication_fault": 8,
}
HOIST = {"frequency_reference": 50.0, "fault": 11}
DIRECTION = {"wind_direction": 217.3, "compass_point": 10}
TANK_VALUES = {"level": 12.99, "volume": 0x1FFFE, "trend": -50.002, "temperature": -41.0}


@dataclass(frozen=True)
class Place:
    """One device of pymodbus's server, and what our samples of it must say."""

    slave: int
    name: str
    profile: str
    registers: dict[int, list[int]]
    values: Mapping[str, float]


IN_RTU = (
    Place(2, "mast-top", "lfs10", LFS10, WIND),
    Place(255, "mast-low", "lfs10", LFS10, WIND),
    Place(10, "laser-a", "ld-e", LD_E, LASER),
    Place(20, "pump", "fuling-dzb", DZB, PUMP),
    Place(30, "hoist", "eh600", EH600, HOIST),
    Place(40, "vane", RTU[10].profile, VANE, DIRECTION),
    Place(41, "tank", "profiles/tank.yaml", TANK_REGISTERS, TANK_VALUES),
)
IN_ASCII = tuple(place for place in IN_RTU if place.name in {"laser-a", "pump", "tank"})


class Served:
    """pymodbus's own server on a free port of the loopback, in a loop and thread of its own."""

    def __init__(self, places: tuple[Place, ...], framer: FramerType) -> None:
        self._devices = [
            SimDevice(
                place.slave,
                simdata=[
                    SimData(first, values=list(words), datatype=DataType.REGISTERS)
                    for first, words in sorted(place.registers.items())
                ],
            )
            for place in places
        ]
        self._framer = framer
        self.port = free_port()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)
        self._thread.start()
        assert self._ready.wait(10)

    async def _serve(self) -> None:
        self._over = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        server = ModbusTcpServer(
            self._devices, framer=self._framer, address=("127.0.0.1", self.port), trace_packet=_as_on_a_wire
        )
        await server.serve_forever(background=True)
        self._ready.set()
        await self._over.wait()
        await server.shutdown()  # type: ignore[no-untyped-call]  # pymodbus leaves it so

    def stop(self) -> None:
        """End it."""
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(10)


def _as_on_a_wire(sending: bool, frame: bytes) -> bytes:  # noqa: FBT001 - pymodbus's call
    """Let no answer come before the request can have left a wire: such bytes answer nothing."""
    if sending:
        time.sleep(LONGEST_REQUEST)
    return frame


@dataclass
class Bridge:
    """Puts up servers behind pseudo terminals, and daemons that poll them."""

    folder: Path
    broker: Mosquitto
    socat: str

    @contextmanager
    def run(self, places: tuple[Place, ...], framing: str, **line: Any) -> Iterator[View]:  # noqa: ANN401  # keys of `line:`
        (self.folder / "profiles").mkdir()
        (self.folder / "profiles" / "tank.yaml").write_text(TANK)
        served = Served(places, FramerType(framing))
        site = Site(self.folder, self.broker.port)
        relay = subprocess.Popen(
            [self.socat, f"pty,raw,echo=0,link={site.tty}", f"tcp:127.0.0.1:{served.port},nodelay"]
        )
        try:
            eventually(site.tty.exists, "the pseudo terminal")
            site.write(
                line={"framing": framing, **line},
                poll={"interval": "100ms"},
                slaves=[{"id": place.slave, "name": place.name, "profile": place.profile} for place in places],
                commands=["registers"],
            )
            view = View(self.broker.subscribe())
            site.run()
            yield view
        finally:
            site.close()
            relay.terminate()
            relay.wait(10)
            served.stop()


@pytest.fixture
def bridge(tmp_path: Path, mosquitto: Mosquitto, program: Callable[[str], str]) -> Bridge:
    return Bridge(tmp_path, mosquitto, program("socat"))


def check_values(view: View, places: tuple[Place, ...]) -> None:
    for place in places:
        for sample in view.wait_samples(place.name, 3):
            assert (sample["quality"], sample["error"]) == ("good", None)
            assert {name: sample[name] for name in place.values} == place.values


@pytest.mark.needs("mosquitto", "socat")
@pytest.mark.parametrize(
    ("places", "framing", "line"),
    [(IN_RTU, "rtu", {}), (IN_ASCII, "ascii", {"databits": 7, "parity": "even"}), (IN_ASCII, "ascii", {})],
    ids=["rtu", "ascii-7E1", "ascii-8N1"],
)
def test_pymodbus_answers_our_polls_of_every_profile_with_the_values_it_holds(
    bridge: Bridge, places: tuple[Place, ...], framing: str, line: dict[str, Any]
) -> None:
    with bridge.run(places, framing, **line) as view:
        check_values(view, places)
        topic = f"{view.base}/request/register/write"
        view.listener.publish(topic, json.dumps({"device": "laser-a", "address": 0x1000, "value": 1}))
        answer = view.wait("response/register/write")
        assert (answer["status"], answer["data"]["before"], answer["data"]["value"]) == ("ok", 0, 1)


# -- mbpoll


@pytest.fixture(name="polled")
def _polled(tmp_path: Path) -> Iterator[PtyLine]:
    """Give the simulated RTU line of all devices whose check is a CRC."""
    (tmp_path / "profiles").mkdir()
    (tmp_path / "profiles" / "tank.yaml").write_text(TANK)
    shape = Format(19200)
    sensors = [
        simulated(unit, load_profile(unit.profile, relative_to=tmp_path), shape, "rtu")
        for unit in RTU
        if unit.check == "crc"
    ]
    with PtyLine(SimulatedLine(sensors, format=shape), link=tmp_path / "line0") as served:
        yield served


@pytest.mark.needs("mbpoll")
@pytest.mark.parametrize(
    ("slave", "address", "count", "form"),
    [
        (2, 0x0001, 1, ["-t", "4:float", "-B"]),
        (10, 0x1004, 1, ["-t", "4:int"]),
        (20, 0x3001, 4, ["-t", "4"]),
        (20, 0x5000, 2, ["-t", "4"]),
        (30, 0x1001, 1, ["-t", "4"]),
        (40, 0x0000, 2, ["-t", "4"]),
        (41, 0x0200, 1, ["-t", "3"]),
    ],
    ids=["lfs10", "ld-e", "fuling-dzb", "fuling-dzb-faults", "eh600", "wind-vane", "input-register"],
)
def test_mbpoll_reads_what_a_simulated_device_means(
    polled: PtyLine, program: Callable[[str], str], slave: int, address: int, count: int, form: list[str]
) -> None:
    how = ["-m", "rtu", "-b", "19200", "-P", "none", "-0", "-1", "-o", "1"]
    done = subprocess.run(
        [program("mbpoll"), *how, *form, "-a", str(slave), "-r", str(address), "-c", str(count), polled.path],
        capture_output=True, text=True, check=False, timeout=30,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    read = [float(text) for text in re.findall(r"^\[\d+\]:\s+(-?[\d.]+)", done.stdout, re.MULTILINE)]
    (request,) = polled.line.log
    (answer,) = request.answers
    signals = {signal.address: signal for signal in answer.sensor.blueprint.signals}
    width = 2 if ":" in form[1] else 1
    scales = [signals[address + place * width] for place in range(count)]
    meant = [(value - each.offset) / each.scale for value, each in zip(answer.values, scales, strict=True)]
    assert read == pytest.approx(meant, rel=1e-5)
