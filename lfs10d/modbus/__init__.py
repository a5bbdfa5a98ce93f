"""The wire: times, frames, the exchange, the port and the bus. Knows no MQTT."""
