"""Store every sample of lfs10d once, in SQLite: `pip install paho-mqtt`, then `python subscriber.py HOST PORT FILE`.

The session is persistent: what comes while this program is away, the broker keeps (mosquitto: `persistence true`).
The key of a sample keeps it once.
"""

import json
import sqlite3
import sys

import paho.mqtt.client as mqtt

TABLE = """CREATE TABLE IF NOT EXISTS wind (
    base TEXT, line TEXT, device TEXT, boot TEXT, seq INTEGER, ts INTEGER, wind_speed REAL, quality TEXT, error TEXT,
    PRIMARY KEY (base, line, device, boot, seq)) WITHOUT ROWID"""


def rows(topic, payload):
    """Return the rows of one message: `telemetry` is an object, `history` an array of them."""
    base = topic.rsplit("/", 4)[0]
    content = json.loads(payload)
    return [
        (base, *(sample.get(key) for key in ("line", "device", "boot", "seq", "ts", "wind_speed", "quality", "error")))
        for sample in (content if isinstance(content, list) else [content])
    ]


def main(host, port, file):
    """Store until Ctrl-C."""
    database = sqlite3.connect(file)
    database.execute(TABLE)
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, "wind-store", clean_session=False, manual_ack=True)

    def store(client, _userdata, message):
        with database:
            new = rows(message.topic, message.payload)
            database.executemany("INSERT OR IGNORE INTO wind VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", new)
        client.ack(message.mid, message.qos)  # only now it is on the disk

    client.on_connect = lambda client, *_: client.subscribe(
        [("lfs10d/+/device/+/telemetry", 1), ("lfs10d/+/device/+/history", 1)]
    )
    client.on_message = store
    client.reconnect_delay_set(1, 5)
    client.connect(host, port)
    client.loop_forever(retry_first_connection=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
