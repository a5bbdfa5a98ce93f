"""weewx driver for lfs10d: loop packets in METRICWX (m/s) from live samples on MQTT.

A failed poll is a packet with windSpeed None, and an old value is never repeated. Samples from while the broker was
away (`history`) are not read: weewx has closed their archive interval, so a gap stays a gap.
"""

import json
import queue
import time

try:
    import paho.mqtt.client as mqtt
    import weewx
    import weewx.drivers

    METRICWX = weewx.METRICWX
    Base = weewx.drivers.AbstractDevice
except ImportError:  # the tests of WindPackets need neither
    METRICWX = 17
    Base = object

DRIVER_NAME = "Lfs10d"
DRIVER_VERSION = "1.0"
SILENT_AFTER = 60
"""Seconds without a sample after which a packet with None is made."""

DIRECTION_FRESH = 5000
"""Milliseconds by which a direction may be older or newer than the speed that it goes with."""


class WindPackets:
    """Makes loop packets of samples: `packet` is pure, and returns None for what is no news."""

    def __init__(self, anemometer, vane=None):
        self.anemometer = anemometer
        self.vane = vane or None
        self._seen = {}
        self._direction = (None, None)  # degrees, and when in ms

    def packet(self, sample):
        """Return the loop packet of one sample (a decoded payload of `telemetry` or `wind`), or None."""
        device = sample.get("device")
        if not isinstance(sample.get("ts"), int) or device not in (self.anemometer, self.vane):
            return None
        if "seq" in sample:
            key, place = (sample.get("boot"), sample["seq"]), device
            if self._seen.get(place, ("", -1)) >= key:
                return None  # published again after a lost connection
            self._seen[place] = key
        packet = {"dateTime": round(sample["ts"] / 1000), "usUnits": METRICWX}
        if "gust_3s" in sample:
            return {**packet, "windGust": sample["gust_3s"]} if device == self.anemometer else None
        if "wind_direction" in sample and device == (self.vane or self.anemometer):
            self._direction = (_number(sample["wind_direction"]), sample["ts"])
        if device != self.anemometer:
            return None  # weewx takes a direction together with its speed only
        packet["windSpeed"] = _number(sample.get("wind_speed"))
        direction, measured = self._direction
        if measured is not None:
            fresh = abs(sample["ts"] - measured) <= DIRECTION_FRESH
            packet["windDir"] = direction if fresh else None
        return packet

    def silence(self, now):
        """Return the packet for a time without any sample; `now` in epoch seconds."""
        packet = {"dateTime": round(now), "usUnits": METRICWX, "windSpeed": None}
        return {**packet, "windDir": None} if self.vane else packet


def _number(value):
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


class Lfs10dDriver(Base):
    """Yields the packets as weewx asks for them."""

    def __init__(self, **stn):
        self._packets = WindPackets(stn.get("anemometer", "slave-2"), stn.get("vane"))
        self._queue = queue.Queue()
        topic = stn.get("topic", "lfs10d/line0")
        devices = [device for device in (self._packets.anemometer, self._packets.vane) if device]
        self._topics = [(f"{topic}/device/{device}/{kind}", 0) for device in devices for kind in ("telemetry", "wind")]
        self._client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        if stn.get("username"):
            self._client.username_pw_set(stn["username"], stn.get("password"))
        self._client.on_connect = lambda client, *_: client.subscribe(self._topics)
        self._client.on_message = lambda _client, _data, message: self._queue.put(message.payload)
        self._client.connect_async(stn.get("host", "localhost"), int(stn.get("port", 1883)))
        self._client.loop_start()

    @property
    def hardware_name(self):
        """The name that weewx shows."""
        return DRIVER_NAME

    def genLoopPackets(self):  # noqa: N802  # weewx's name
        """Yield loop packets for ever."""
        while True:
            try:
                packet = self._packets.packet(json.loads(self._queue.get(timeout=SILENT_AFTER)))
            except queue.Empty:
                packet = self._packets.silence(time.time())
            except ValueError:
                continue
            if packet is not None:
                yield packet

    def closePort(self):  # noqa: N802  # weewx's name
        """Leave the broker."""
        self._client.loop_stop()
        self._client.disconnect()


def loader(config_dict, engine):
    """Return the driver; weewx calls this."""
    return Lfs10dDriver(**config_dict[DRIVER_NAME])
