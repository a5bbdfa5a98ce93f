"""A daemon in sixty lines that speaks enough of the contract for the bench; `--swapped` makes it lie.

Run as `daemon_double.py [--swapped] run -c FILE --state-dir DIR`.
"""

from __future__ import annotations

import json
import select
import signal
import struct
import sys
import time
from pathlib import Path

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

from tests.support.plain_wire import ANSWER, Wire


def poll(wire: Wire) -> bytes:
    """Poll one sensor."""
    time.sleep(max(0.0, wire.quiet_since + wire.t35 - time.monotonic()))
    deadline = wire.send() + 1.0
    answer = b""
    while len(answer) < ANSWER and select.select([wire.fd], [], [], deadline - time.monotonic())[0]:
        answer += wire.read()
    return answer


def main() -> None:
    """Poll and publish until SIGTERM."""
    swapped = "--swapped" in sys.argv
    configuration = json.loads(Path(sys.argv[sys.argv.index("-c") + 1]).read_text())
    line, mqtt = configuration["line"], configuration["mqtt"]
    base = f"{mqtt['base_topic']}/{line['name']}"
    client = Client(CallbackAPIVersion.VERSION2, protocol=MQTTProtocolVersion.MQTTv5)
    client.connect(mqtt["host"], mqtt["port"])
    client.loop_start()
    wire = Wire.open(line["port"], line["baudrate"], len(configuration["slaves"]))
    ending: list[int] = []
    signal.signal(signal.SIGTERM, lambda *_: ending.append(1))
    seqs: dict[str, int] = {}
    while not ending:
        answer = poll(wire)
        if len(answer) != ANSWER:
            continue
        device = f"slave-{3 - answer[0] if swapped else answer[0]}"
        seqs[device] = seqs.get(device, 0) + 1
        (value,) = struct.unpack(">f", answer[3:7])
        sample = {"device": device, "boot": "b", "seq": seqs[device], "wind_speed": value, "error": None}
        client.publish(f"{base}/device/{device}/telemetry", json.dumps(sample), qos=1)
    client.disconnect()
    client.loop_stop()


if __name__ == "__main__":
    main()
