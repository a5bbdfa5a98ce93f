"""`lfs10d request line/adopt --repeat`: mounting sensors at a running daemon."""

from __future__ import annotations

import json
import signal
from typing import Any

import pytest

from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.brokers import Mosquitto
from tests.support.faulty_sensors import add_fault, power_cycle
from tests.support.shells import BASE, Shell, typed
from tests.support.sites import QUICK, Run, Site, eventually, tell

REPEAT = ("line/adopt", "--repeat")
FIRST = "Plug in a sensor. Ctrl-C when all are adopted.\n"
ADOPTED_WITHIN = 60.0
"""Seconds; with its share of 30 % an adoption takes about 15, and what was asked before it about 10."""
NEXT = "Plug in the next one.\n"


def mounted(site: Site, **mqtt: Any) -> tuple[PtyLine, Run]:  # noqa: ANN401 - as Site.write
    """Start a line with one sensor at 19200 baud and a daemon that is at the broker."""
    served = site.line((2,))
    site.pace = QUICK
    site.write(slaves=[2], poll={"interval": "1s"}, mqtt=mqtt)
    run = site.run()
    run.says("connected by MQTT")
    return served, run


def plug(served: PtyLine, fault: str | None = None, baudrate: int = 9600) -> Sensor:
    sensor = Sensor(1, format=Format(baudrate), turnaround=0.003)
    if fault is not None:
        add_fault(sensor, fault)
    tell(served, lambda line: line.add(sensor))
    return sensor


@pytest.mark.long(16)
def test_one_sensor_after_the_other_gets_the_next_id_and_a_table_tells_them_in_the_end(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    del mosquitto
    served, run = mounted(site)
    loop = shell.pipe("request", *REPEAT, "label=Roof")
    loop.says(FIRST)
    run.says("request line/adopt: rejected (timeout)")  # nobody is there yet, and nothing is told
    first = plug(served)
    loop.says(f"slave-3: slave id 3, 19200 baud\n{NEXT}", within=ADOPTED_WITHIN)
    plug(served, baudrate=19200)
    loop.says("slave-4: slave id 4, 19200 baud\n", within=ADOPTED_WITHIN)
    assert loop.ends(signal.SIGINT) == 0
    told = f"{FIRST}slave-3: slave id 3, 19200 baud\n{NEXT}slave-4: slave id 4, 19200 baud\n{NEXT}"
    assert loop.text == f"{told}2 sensors adopted:\nname     id   baud\nslave-3   3  19200\nslave-4   4  19200\n"
    assert (first.slave, first.format.baudrate) == (3, 19200)
    assert json.loads((site.folder / "state" / "journal.json").read_text())["answers"] == []


def test_named_sensors_are_one_line_of_json_each_and_the_last_one_ends_it(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    del mosquitto
    served, _ = mounted(site)
    plug(served)
    done = typed(site, "request", *REPEAT, "name=north", "--json")
    assert (done.returncode, done.stderr) == (0, FIRST)
    assert json.loads(done.stdout) == {"device": "north", "slave": 3, "baudrate": 19200}
    refused = shell.pipe("request", *REPEAT, "name=north")
    assert refused.ends() == 1
    assert "invalid_param: name: north is taken" in refused.text
    assert "No sensor was adopted." in refused.text


@pytest.mark.long(28)
def test_by_3_1_1_too_a_sensor_whose_switch_is_set_is_told_once_and_the_next_one_is_adopted(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    listener = mosquitto.subscribe(f"{BASE}/request/line/adopt")
    served, _ = mounted(site, version="3.1.1")
    locked = plug(served, "dip_locked")
    loop = shell.pipe("request", *REPEAT)
    loop.says("dip_switch: the sensor stays at slave id 1", within=ADOPTED_WITHIN)
    tell(served, lambda _: locked.power_cut())
    plug(served)
    loop.says("slave-3: slave id 3, 19200 baud\n", within=ADOPTED_WITHIN)
    assert loop.text.count("dip_switch") == 1
    assert loop.ends(signal.SIGTERM) == 0
    ids = [json.loads(each.payload)["id"] for each in listener.on(f"{BASE}/request/line/adopt")]
    assert len(set(ids)) == len(ids) >= 2, "by 3.1.1 an answer is known by its id alone"


@pytest.mark.long(21)
def test_a_sensor_that_obeys_after_a_power_cycle_is_adopted_then(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    del mosquitto
    served, _ = mounted(site)
    sensor = plug(served, "power_cycle", baudrate=19200)
    loop = shell.pipe("request", *REPEAT)
    loop.says("power_cycle_needed: the sensor stored what was written", within=ADOPTED_WITHIN)
    tell(served, lambda _: power_cycle(sensor))
    loop.says(f"slave-3: slave id 3, 19200 baud\n{NEXT}", within=ADOPTED_WITHIN)
    assert loop.ends(signal.SIGINT) == 0
    assert loop.text.count("power_cycle_needed") == 1


def test_a_broker_that_goes_away_is_waited_for(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    served, run = mounted(site)
    loop = shell.pipe("request", *REPEAT)
    loop.says(FIRST)
    mosquitto.stop()
    loop.says("waiting until it is there again")
    plug(served)
    mosquitto.start()
    run.says("connected by MQTT", 2)
    loop.says("It is there again.")
    loop.says("slave-3: slave id 3, 19200 baud\n", within=ADOPTED_WITHIN)
    assert loop.ends(signal.SIGINT) == 0


@pytest.mark.long(11)
def test_a_daemon_that_is_started_again_is_waited_for(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    del mosquitto
    served, run = mounted(site)
    loop = shell.pipe("request", *REPEAT)
    loop.says(FIRST)
    run.says("request line/adopt: rejected (timeout)")
    assert run.ends(signal.SIGTERM) == 0
    loop.says("waiting until it is there again")
    plug(served)
    site.run()
    loop.says("slave-3: slave id 3, 19200 baud\n", within=ADOPTED_WITHIN)
    assert loop.ends(signal.SIGINT) == 0


def test_on_a_terminal_something_turns_while_a_sensor_is_waited_for(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    del mosquitto
    mounted(site)
    loop = shell.terminal("request", *REPEAT)
    loop.says("waiting for a sensor ... 1 s")
    assert loop.ends(signal.SIGINT) == 1
    assert loop.text.endswith("No sensor was adopted.\n")


def test_without_a_broker_or_a_daemon_it_ends_with_69_at_once(site: Site) -> None:
    site.write()
    done = typed(site, "request", *REPEAT)
    assert (done.returncode, done.stdout) == (69, "")
    assert "connection refused" in done.stderr


def test_where_the_broker_does_not_let_requests_through_it_ends(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    mosquitto.publish(f"{BASE}/availability", "online", retain=True)
    site.write()
    asking = shell.pipe("request", *REPEAT)
    eventually(lambda: asking.ends() == 69, "it ends")
    assert "no subscriber for requests" in asking.text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("device/read", "--repeat"), "--repeat goes with line/adopt alone"),
        ((*REPEAT, "--timeout", "10s"), "it goes on until Ctrl-C"),
        ((*REPEAT, "to=9"), "to cannot be the same for every sensor"),
        ((*REPEAT, "id=9"), "id cannot be the same"),
        ((*REPEAT, "name=a,B"), "'B' is not a name of 1 to 32"),
        ((*REPEAT, "name=a,b,a"), "a name is given twice"),
        ((*REPEAT, "label"), "is not KEY=VALUE"),
    ],
)
def test_a_slip_on_the_command_line_is_an_error_of_usage(site: Site, arguments: tuple[str, ...], words: str) -> None:
    site.write()
    done = typed(site, "request", *arguments)
    assert done.returncode == 2
    assert words in done.stderr
