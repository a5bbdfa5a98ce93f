"""Sensors that all speak at another rate than the line: `line/error` says so, and its advice works."""

from __future__ import annotations

from lfs10d.simulator.wire import Format
from tests.support.sites import Site, View, good

LOST_SOON = """
from lfs10d.__main__ import main
from lfs10d.reconfiguration.procedures import find_baudrate
find_baudrate.LOST_AFTER = 1.0
main()
"""
BROKEN = """
from lfs10d.__main__ import main
from lfs10d.reconfiguration import baudrate_watch
from lfs10d.reconfiguration.procedures import find_baudrate
def message(*_, **__):
    raise KeyError("message")
find_baudrate.LOST_AFTER = 1.0
baudrate_watch.message = message
main()
"""
MESSAGE = (
    "no sensor answers at 9600 baud, but 2 of 2 at 19200 baud do (slave-1, slave-2); "
    "set line.baudrate to 19200; then line/baudrate can move them"
)


def test_the_error_rises_names_the_rate_and_clears_when_its_advice_is_followed(site: Site, view: View) -> None:
    site.line((1, 2), shape=Format(19200))
    site.write(line={"baudrate": 9600}, poll={"interval": "100ms"})
    run = site.run(program=("-c", LOST_SOON))
    view.wait("line/error", lambda error: error["active"] and "2 of 2" in error["message"])
    error = view.newest("line/error")
    assert (error["code"], error["message"], error["also"]) == ("wrong_rate", MESSAGE, [])
    assert all(not good(sample) for name in ("slave-1", "slave-2") for sample in view.samples(name))
    assert f"line0: {MESSAGE}" in run.log or MESSAGE in run.log
    site.write(line={"baudrate": 19200}, poll={"interval": "100ms"})
    run.reload()
    cleared = view.wait("line/error", lambda error: not error["active"])
    assert (cleared["code"], cleared["last_code"]) == (None, "wrong_rate")
    view.wait_samples("slave-1", 3, good)
    view.wait_samples("slave-2", 3, good)


def test_the_error_clears_by_itself_when_a_sensor_answers_at_the_line_s_rate(site: Site, view: View) -> None:
    served = site.line((1,), shape=Format(19200))
    site.write(line={"baudrate": 9600}, poll={"interval": "100ms"}, slaves=[1])
    site.run(program=("-c", LOST_SOON))
    view.wait("line/error", lambda error: error["code"] == "wrong_rate")
    served.tell(lambda line: setattr(line.sensors[0], "format", Format(9600)))
    view.wait("line/error", lambda error: not error["active"])
    view.wait_samples("slave-1", 3, good)


def test_the_watch_for_another_rate_does_not_die_unheard(site: Site) -> None:
    site.line((1,), shape=Format(19200))
    site.write(line={"baudrate": 9600}, poll={"interval": "100ms"}, slaves=[1])
    run = site.run(program=("-c", BROKEN))
    run.says("background task rate watch failed: an internal error")
    assert run.process.poll() is None
    assert run.ends(15) == 0
    site.runs.clear()  # what it logs is the point
    run.manager.close()
