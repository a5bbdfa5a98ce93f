"""lfs10d: one RS485 line of Modbus sensors, polled with true gaps and published over MQTT."""

__version__ = "1.0.0"
