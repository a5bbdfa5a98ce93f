"""The port: pulled, back, absent, held by another, none at all."""

from __future__ import annotations

import fcntl
import os
import time
from typing import Any

import pytest

from tests.support.sites import Site, View, good

BACK_WITHIN = 2.0
"""Seconds from the return of the port to its use (issue A)."""


def lost(error: dict[str, Any]) -> bool:
    return bool(error["code"] == "port_lost")


def test_a_port_pulled_out_is_one_error_of_the_line_and_is_back_at_once(site: Site, view: View) -> None:
    served = site.line()
    site.write(poll={"interval": "50ms"}, slaves=[1, 2, {"id": 3, "interval": "1h"}])
    run = site.run()
    view.wait("device/slave-2/state", good)
    view.wait_samples("slave-3", 1)

    served.stop()
    error = view.wait("line/error", lost)
    for device in ("slave-1", "slave-2", "slave-3"):
        view.wait(f"device/{device}/availability", "offline".__eq__)
        state = view.wait(f"device/{device}/state", lambda state: state["error"] == "port_lost")
        assert (state["quality"], state["wind_speed"]) == ("bad", None)

    assert error["active"] is True
    assert str(site.tty) in error["message"]
    assert view.wait("line/state", lambda state: not state["open"])
    before = {device: view.samples(device)[-1]["seq"] for device in ("slave-1", "slave-2", "slave-3")}
    time.sleep(1.5)  # nothing may come: there is nothing else to wait for
    for device, seq in before.items():
        assert view.samples(device)[-1]["seq"] == seq
        assert [one["error"] for one in view.samples(device)].count("port_lost") == 1
        assert view.newest(f"device/{device}/error")["active"] is False

    view.clear()
    served.start()
    back = time.monotonic()
    cleared = view.wait("line/error", lambda error: not error["active"])
    view.wait_samples("slave-2", 1, good)
    assert time.monotonic() - back < BACK_WITHIN + 1.0  # and the time our own polling takes
    view.wait_samples("slave-3", 1)  # due at once, not in an hour

    assert cleared["last_code"] == "port_lost"
    assert view.wait("line/state", lambda state: state["open"])
    view.wait("device/slave-1/availability", "online".__eq__)
    assert view.samples("slave-1")[0]["seq"] == before["slave-1"] + 1
    # Once when it hangs up and once when the path is gone; never again while nothing changes.
    assert 1 <= run.log.count("tried again until it is back") <= 2


def test_a_port_that_is_absent_at_the_start_is_awaited(site: Site, view: View) -> None:
    served = site.line(started=False)
    site.write()
    run = site.run()

    error = view.wait("line/error", lost)
    run.ready()
    assert "there is no such device" in error["message"]
    samples = view.wait_samples("slave-1", 1)
    assert [(one["seq"], one["error"]) for one in samples] == [(1, "port_lost")]
    assert view.newest("line/state")["open"] is False

    served.start()
    view.wait("device/slave-1/state", good)

    assert view.newest("line/error")["active"] is False
    assert view.samples("slave-1")[1]["seq"] == 2
    assert run.log.count("there is no such device") == 1


def test_a_port_that_another_program_holds_is_busy_until_it_is_free(site: Site, view: View) -> None:
    site.line()
    held = os.open(site.tty, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(held, fcntl.LOCK_EX)
    site.write()
    run = site.run()

    error = view.wait("line/error", lambda error: error["active"])
    assert error["code"] == "port_busy"
    assert str(os.getpid()) in error["message"]
    assert view.wait_samples("slave-1", 1)[0]["error"] == "port_busy"
    run.ready()

    os.close(held)
    view.wait("device/slave-1/state", good)

    assert run.log.count("in use by") == 1


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: path.write_text("no tty"), "no serial port"),
        (lambda path: path.mkdir(), "directory"),
        (lambda path: path.symlink_to(path), "link"),
    ],
    ids=["file", "directory", "loop"],
)
def test_what_is_no_port_is_named_as_such_and_awaited(site: Site, view: View, make: Any, words: str) -> None:  # noqa: ANN401 - plain data of any shape
    make(site.tty)
    site.write()

    run = site.run()
    error = view.wait("line/error", lost)

    run.ready()
    assert words in error["message"]
