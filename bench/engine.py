"""How much of the wire three ways to wait reach, without any of the daemon's code: the probe behind decision 0001.

`thread` is one thread that blocks in `select`, reporting to an asyncio loop as the daemon's does; `selector`
and `epoll` are a coroutine on an asyncio loop with `SelectSelector` and with the default one. All sleep from the
first byte of an answer to shortly before its last, and all let the loop serialise a sample for each poll and,
with `--burst`, a broker's burst of retained topics once a second. Run as `python -m bench.engine`; prints one
JSON line at its end.
"""

from __future__ import annotations

import argparse
import asyncio
import ctypes
import json
import os
import resource
import select
import selectors
import signal
import sys
import termios
import threading
import time
import tty
from dataclasses import dataclass, field

ANSWER = 9
BITS_PER_CHARACTER = 10
FIXED_ABOVE = 19200
FIXED_T35 = 0.001750
"""Modbus over Serial Line V1.02, section 2.5.1.1."""
TIMEOUT = 0.2
AWAKE_BEFORE = 0.0001
"""A process that sleeps past the last byte hears it late, and its silence of t3.5 begins late."""
PRIORITY = 20
PR_SET_TIMERSLACK = 29
SWITCH_INTERVAL = 1e-4
BURST_TOPICS = 96


def crc16(frame: bytes) -> bytes:
    """Return the two bytes of CRC-16/MODBUS, low byte first."""
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc.to_bytes(2, "little")


@dataclass
class Wire:
    """The times of one rate, in seconds, and the port's descriptor."""

    fd: int
    character: float
    t35: float
    slaves: int
    quiet_since: float = 0.0
    polls: int = 0
    good: int = 0
    ending: bool = False
    requests: list[bytes] = field(default_factory=list)

    @classmethod
    def open(cls, path: str, baudrate: int, slaves: int) -> Wire:
        """Open the port raw at the rate."""
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(fd)
        settings = termios.tcgetattr(fd)
        settings[4] = settings[5] = getattr(termios, f"B{baudrate}")
        termios.tcsetattr(fd, termios.TCSANOW, settings)
        character = BITS_PER_CHARACTER / baudrate
        wire = cls(fd, character, FIXED_T35 if baudrate > FIXED_ABOVE else 3.5 * character, slaves)
        wire.quiet_since = time.monotonic()
        heads = [bytes((slave, 3, 0, 1, 0, 2)) for slave in range(1, slaves + 1)]
        wire.requests = [head + crc16(head) for head in heads]
        return wire

    def send(self) -> float:
        """Send the next request; return when its last character leaves."""
        request = self.requests[self.polls % self.slaves]
        os.write(self.fd, request)
        self.polls += 1
        self.quiet_since = time.monotonic() + len(request) * self.character
        return self.quiet_since

    def read(self) -> bytes:
        """Read what is there."""
        try:
            data = os.read(self.fd, 256)
        except BlockingIOError:
            return b""
        self.quiet_since = time.monotonic()
        return data

    def nap(self, answer: bytes) -> float:
        """Return how long nothing can be decided, awake again before the last byte ends."""
        return max(0.0, (ANSWER - len(answer) - 1) * self.character - AWAKE_BEFORE)

    def settle(self, answer: bytes) -> None:
        """Count the answer."""
        self.good += len(answer) == ANSWER and crc16(answer[:-2]) == answer[-2:]


def serialise(answer: bytes, topics: int) -> None:
    """Do what the loop of a publishing daemon does: JSON."""
    sample = {"v": 1, "line": "line0", "device": "slave-1", "boot": "k3f9a2c7", "seq": 48211, "clock": "synced"}
    for _ in range(topics):
        json.dumps({**sample, "hex": answer.hex(), "unit": "m/s", "quality": "good", "error": None})


async def serialise_bursts(wire: Wire) -> None:
    """Once a second, all retained topics at once."""
    while not wire.ending:
        await asyncio.sleep(1)
        serialise(b"", BURST_TOPICS)


def poll_in_thread(wire: Wire, loop: asyncio.AbstractEventLoop) -> None:
    """Poll for ever, blocking; one message to the loop for each exchange."""
    while not wire.ending:
        pause = wire.quiet_since + wire.t35 - time.monotonic()
        if pause > 0 and select.select([wire.fd], [], [], pause)[0]:
            wire.read()
            continue
        deadline = wire.send() + TIMEOUT
        answer = b""
        while len(answer) < ANSWER:
            pause = deadline - time.monotonic()
            if pause <= 0 or not select.select([wire.fd], [], [], pause)[0]:
                break
            begun = not answer
            answer += wire.read()
            if begun:
                time.sleep(wire.nap(answer))
        wire.settle(answer)
        loop.call_soon_threadsafe(serialise, answer, 2)


async def poll_in_loop(wire: Wire) -> None:
    """Poll for ever on the loop."""
    loop = asyncio.get_running_loop()
    readable = asyncio.Event()
    while not wire.ending:
        pause = wire.quiet_since + wire.t35 - time.monotonic()
        if pause > 0:
            await asyncio.sleep(pause)
            wire.read() if select.select([wire.fd], [], [], 0)[0] else None
            continue
        deadline = wire.send() + TIMEOUT
        answer = b""
        while len(answer) < ANSWER:
            readable.clear()
            loop.add_reader(wire.fd, readable.set)
            try:
                async with asyncio.timeout(deadline - time.monotonic()):
                    await readable.wait()
            except TimeoutError:
                break
            finally:
                loop.remove_reader(wire.fd)
            begun = not answer
            answer += wire.read()
            if begun:
                await asyncio.sleep(wire.nap(answer))
        wire.settle(answer)
        serialise(answer, 2)


def become_prompt(priority: int) -> bool:
    """Give the calling thread exact timers, and the real-time class where asked for and permitted."""
    ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if priority == 0:
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return False
    return True


async def run(wire: Wire, way: str, *, priority: int, burst: bool) -> bool:
    """Poll until a signal comes; return whether the real-time class was granted."""
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, ended.set)
    bursts = asyncio.create_task(serialise_bursts(wire)) if burst else None
    granted = False
    if way == "thread":
        sys.setswitchinterval(SWITCH_INTERVAL)

        def body() -> None:
            nonlocal granted
            granted = become_prompt(priority)
            poll_in_thread(wire, loop)

        thread = threading.Thread(target=body)
        thread.start()
        await ended.wait()
        wire.ending = True
        await asyncio.to_thread(thread.join)
    else:
        granted = become_prompt(priority)
        polling = asyncio.create_task(poll_in_loop(wire))
        await ended.wait()
        wire.ending = True
        await polling
    if bursts is not None:
        bursts.cancel()
    return granted


def main() -> None:
    """Run one way of waiting."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("way", choices=("thread", "selector", "epoll"))
    parser.add_argument("port")
    parser.add_argument("--baudrate", type=int, default=9600)
    parser.add_argument("--slaves", type=int, default=32)
    parser.add_argument("--fifo", action="store_true", help="ask for SCHED_FIFO")
    parser.add_argument("--burst", action="store_true", help="serialise retained topics once a second")
    options = parser.parse_args()
    wire = Wire.open(options.port, options.baudrate, options.slaves)

    def new_loop() -> asyncio.AbstractEventLoop:
        return asyncio.SelectorEventLoop(selectors.SelectSelector() if options.way == "selector" else None)

    with asyncio.Runner(loop_factory=new_loop) as runner:
        granted = runner.run(run(wire, options.way, priority=PRIORITY if options.fifo else 0, burst=options.burst))
    usage = resource.getrusage(resource.RUSAGE_SELF)
    cpu = usage.ru_utime + usage.ru_stime
    print(json.dumps({"polls": wire.polls, "good": wire.good, "cpu_s": round(cpu, 6), "fifo": granted}))


if __name__ == "__main__":
    main()
