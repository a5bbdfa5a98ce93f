"""`lfs10d trace`."""

from __future__ import annotations

import json
import re
import signal

import pytest

from tests.support.brokers import Mosquitto
from tests.support.shells import Shell, running, typed
from tests.support.sites import Site, View

CLOCK = r"\d\d:\d\d:\d\d\.\d{3} [A-Z]+"


def test_trace_shows_each_frame_in_words_and_ends_by_itself(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site)
    done = typed(site, "trace", "--for", "1s")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert any(
        re.fullmatch(
            CLOCK + r" +[\d.]+ ms > 02 03 00 01 00 02 95 F8 +mast-top: read 2 registers at 0x0001 of slave 2",
            line,
        )
        for line in lines
    )
    assert any(
        re.fullmatch(
            CLOCK + r" +< 02 03 04 .{17} +mast-top: slave 2 answers \w{4} \w{4}: wind_speed [\d.]+ m/s",
            line,
        )
        for line in lines
    )


def test_trace_on_a_terminal_of_80_columns_puts_the_bytes_below(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    del mosquitto
    running(site)
    tracing = shell.terminal("trace", "--for", "5m")
    indent = " " * len("12:00:00.000 UTC     3.65 ms > ")
    tracing.says(f"mast-top: read 2 registers at 0x0001 of slave 2\n{indent}02 03 00 01 00 02 95 F8")
    assert tracing.ends(signal.SIGINT) == 0
    assert all(len(line) <= 80 for line in tracing.text.splitlines())


def test_trace_for_programs_is_the_payloads(site: Site, mosquitto: Mosquitto, shell: Shell, view: View) -> None:
    del mosquitto
    running(site)
    tracing = shell.pipe("trace", "--json", "--for", "10m")
    tracing.says('"direction": "rx"')
    assert tracing.ends(signal.SIGTERM) == 0
    told = [json.loads(line) for line in tracing.text.splitlines()]
    assert all(one in view.history_of("trace") for one in told)


def test_trace_that_is_refused_ends_with_1(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site, commands=["polling"])
    done = typed(site, "trace")
    assert (done.returncode, done.stdout) == (1, "")
    assert "line/trace: rejected: not_allowed" in done.stderr


def test_trace_ends_with_69_when_the_daemon_goes_away(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    del mosquitto
    run = running(site)
    tracing = shell.pipe("trace", "--for", "10m")
    tracing.says("slave 1")
    run.process.send_signal(signal.SIGTERM)
    assert tracing.ends() == 69
    assert "the daemon went offline" in tracing.text


def test_trace_ends_with_69_when_the_broker_goes_away(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    running(site)
    tracing = shell.pipe("trace", "--for", "10m")
    tracing.says("slave 1")
    mosquitto.kill()
    assert tracing.ends() == 69
    assert "the connection is lost" in tracing.text


def test_trace_without_a_daemon_ends_with_69(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    site.write()
    assert typed(site, "trace").returncode == 69


@pytest.mark.parametrize("duration", ["11m", "0", "soon", "-1s"])
def test_trace_takes_durations_up_to_ten_minutes(site: Site, duration: str) -> None:
    site.write()
    assert typed(site, "trace", f"--for={duration}").returncode == 2
