"""Every setting has its effect, seen on the wire, at the broker or in the log."""

from __future__ import annotations

import json
import os
import re
import socket
import termios

import pytest

from lfs10d.simulator.faults import FaultKind
from lfs10d.simulator.wire import Format
from tests.support.brokers import Mosquitto
from tests.support.faulty_sensors import add_fault
from tests.support.sites import Site, View, eventually, good, tell

NOT_PERMITTED = """
import errno, os, sys
def refuse(*_):
    raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
os.sched_setscheduler = refuse
from lfs10d.__main__ import main
main()
"""
"""The daemon on a system that permits no real-time scheduling."""


def realtime_permitted() -> bool:
    """Tell whether a thread here may run under SCHED_FIFO."""
    child = os.fork()
    if not child:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        except OSError:
            os._exit(1)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def scheduler(thread: int) -> int:
    """Return the scheduler of a thread without its flags; an ordinary one if it is over."""
    try:
        return os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK
    except ProcessLookupError:
        return os.SCHED_OTHER


def test_parity_and_stop_bits_make_characters_and_gaps_longer(site: Site, view: View) -> None:
    served = site.line(shape=Format(9600, parity="even", stopbits=2))
    site.write(line={"baudrate": 9600, "parity": "even", "stopbits": 2}, poll={"interval": 0})
    site.run()
    view.wait_samples("slave-1", 20, good)

    control = termios.tcgetattr(served._master)[2]
    assert control & termios.CSTOPB
    assert control & termios.CSIZE == termios.CS8
    gap = 3.5 * 12 / 9600
    assert view.newest("line/stats")["gap_required_us"] == round(gap * 1e6)
    assert served.line.judge.min_gap is not None
    assert served.line.judge.min_gap >= gap * 1e9
    state = view.newest("line/state")
    assert (state["parity"], state["stopbits"], state["databits"], state["framing"]) == ("even", 2, 8, "rtu")


def test_an_extra_gap_is_kept_before_every_request(site: Site, view: View) -> None:
    served = site.line()
    site.write(line={"extra_gap": "20ms"}, poll={"interval": 0})
    site.run()
    view.wait_samples("slave-1", 20, good)

    assert served.line.judge.min_excess is not None
    assert served.line.judge.min_excess >= 0.02 * 1e9


@pytest.mark.parametrize("echo", ["auto", "on"])
def test_an_adapter_that_echoes_is_no_trouble(site: Site, view: View, echo: str) -> None:
    site.line(echo=True)
    site.write(line={"echo": echo}, poll={"interval": "50ms"})
    site.run()

    samples = view.wait_samples("slave-1", 15)

    assert all(good(one) for one in samples)


def test_intervals_are_each_slaves_own(site: Site, view: View) -> None:
    site.line((1, 2, 3))
    site.write(poll={"interval": "100ms"}, slaves=[1, {"id": 2, "interval": "1h"}, {"id": 3, "interval": "400ms"}])
    site.run()
    view.wait_samples("slave-2", 1)

    view.wait_samples("slave-1", 40)

    assert len(view.samples("slave-2")) == 1
    times = [one["ts"] for one in view.samples("slave-3")]
    intervals = (times[-1] - times[0]) / 400  # by its own clock: on a busy machine slave-1 needs longer for its 40
    assert 0.8 <= (len(times) - 1) / intervals <= 1.3


def test_a_slave_that_is_not_enabled_is_not_asked(site: Site, view: View) -> None:
    served = site.line()
    site.write(slaves=[1, {"id": 2, "enabled": False}])
    site.run()
    view.wait_samples("slave-1", 5, good)

    assert not view.samples("slave-2")
    assert view.newest("device/slave-2/availability") == "offline"
    assert view.newest("device/slave-2/state")["quality"] == "bad"
    assert {request.frame[0] for request in list(served.line.log)} == {1}


def test_a_fixed_time_out_is_waited_for_and_no_longer(site: Site, view: View) -> None:
    served = site.line()
    for sensor in served.line.sensors:
        sensor.turnaround = 0.5
    site.write(poll={"interval": "1s", "retries": 0}, slaves=[{"id": 1, "response_timeout": "100ms"}])
    site.run()
    assert view.wait_samples("slave-1", 1)[0]["error"] in {"timeout", "late"}
    assert view.newest("device/slave-1/config")["response_timeout"] == 0.1

    site.runs[0].process.kill()
    view.wait("availability", "offline".__eq__)
    view.clear()
    site.write(poll={"interval": "1s", "retries": 0}, slaves=[{"id": 1, "response_timeout": "2s"}])
    site.run()
    first = view.wait_samples("slave-1", 1)[0]
    assert good(first), first


def test_a_failed_poll_is_asked_again_as_often_as_told(site: Site, view: View) -> None:
    served = site.line((1,))
    site.write(poll={"interval": "300ms", "retries": 2, "offline_after": 1}, slaves=[1])
    site.run()
    view.wait_samples("slave-1", 3, good)

    tell(served, lambda line: add_fault(line.sensor(1), FaultKind.NOISY))
    asked = len(served.line.log)
    error = view.wait("device/slave-1/error", lambda error: error["active"])

    assert (error["code"], error["count"]) == ("crc", 1)
    assert len(served.line.log) - asked >= 3
    view.wait("device/slave-1/availability", "offline".__eq__)


def test_names_are_as_configured(site: Site, mosquitto: Mosquitto) -> None:
    view = View(mosquitto.subscribe(), f"wind/{socket.gethostname()}/roof-2")
    site.write(
        line={"name": "roof-2"},
        slaves=[{"id": 9, "name": "mast-top", "label": "Mast, 10 m"}],
        mqtt={"base_topic": "wind/%H", "client_id": "gate-7", "keepalive": "7s"},
    )
    site.run()

    assert view.wait("devices") == [
        {"name": "mast-top", "id": 9, "label": "Mast, 10 m", "profile": "lfs10", "enabled": True, "interval": 0.2}
    ]
    assert re.search(r"as gate-7 \(p5, c1, k7\)", mosquitto.log)


def test_the_line_is_called_as_the_file_where_it_has_no_name(site: Site, mosquitto: Mosquitto) -> None:
    view = View(mosquitto.subscribe(), "lfs10d/roof")
    site.write(slaves=[])
    site.file.rename(site.folder / "roof.yaml")
    site.run("-c", str(site.folder / "roof.yaml"))

    view.wait("availability", "online".__eq__)


@pytest.mark.parametrize(("form", "beginning"), [("journal", "<6>lfs10d "), ("text", "20"), ("auto", "20")])
def test_the_log_has_the_form_that_was_asked_for(site: Site, form: str, beginning: str) -> None:
    site.write(slaves=[], log={"format": form})
    run = site.run()
    run.ready()

    assert run.log.startswith(beginning)


def test_only_warnings_are_logged_where_only_those_are_wanted(site: Site) -> None:
    site.write(slaves=[], log={"level": "warning"})
    run = site.run()
    run.says("connection refused")

    assert " info " not in run.log


def test_a_driver_without_rs485_mode_is_told_of_once_and_used(site: Site, view: View) -> None:
    site.line()
    site.write(line={"rs485": {"rts_on_send": True, "delay_before_send": "1ms"}})
    run = site.run()

    view.wait("device/slave-1/state", good)

    told = [line for line in run.log.splitlines() if "no RS485 mode" in line]
    assert len(told) == 1
    assert " warning " in told[0]


def test_realtime_puts_the_lines_thread_alone_under_fifo_where_that_is_permitted(site: Site, view: View) -> None:
    permitted = realtime_permitted()
    site.line()
    site.write(line={"realtime": True})
    run = site.run()
    view.wait("device/slave-1/state", good)

    real = [thread for thread in run.threads if scheduler(thread) == os.SCHED_FIFO]

    assert len(real) == permitted
    assert run.process.pid not in real
    assert run.log.count("SCHED_FIFO") == (not permitted)

    site.write(line={"realtime": False})
    run.reload()
    eventually(lambda: all(scheduler(each) == os.SCHED_OTHER for each in run.threads), "an ordinary thread again")
    site.write(line={"realtime": True})
    run.reload()
    eventually(lambda: len([1 for each in run.threads if scheduler(each) == os.SCHED_FIFO]) == permitted, "FIFO again")


def test_realtime_that_is_not_permitted_is_one_warning(site: Site, view: View) -> None:
    site.line()
    site.write(line={"realtime": True})
    run = site.run(program=("-c", NOT_PERMITTED))
    view.wait("device/slave-1/state", good)

    site.write(line={"realtime": True, "extra_gap": "1ms"})
    run.reload()
    known = view.samples("slave-1")[-1]["seq"]
    view.wait_samples("slave-1", known + 2)

    told = [line for line in run.log.splitlines() if "SCHED_FIFO" in line]
    assert len(told) == 1
    assert " warning " in told[0]
    assert "realtime.conf.example" in told[0]


def test_requests_of_classes_that_are_not_obeyed_are_rejected(site: Site, view: View) -> None:
    site.write(slaves=[], commands=[])
    site.run()
    view.wait("availability", "online".__eq__)

    view.listener.publish("lfs10d/line0/request/config/reload", json.dumps({"id": "a"}))
    view.listener.publish("lfs10d/line0/request/health", "{}")

    assert view.wait("response/health")["status"] == "ok"
    answer = view.wait("response/config/reload")
    assert (answer["id"], answer["status"], answer["error"]["code"]) == ("a", "rejected", "not_allowed")
