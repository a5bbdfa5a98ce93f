"""The wire: silences, frames, one request and its reply, the serial port. Knows no MQTT."""
