"""MQTT: topics, what waits, the connection and the uplink. Knows no Modbus."""
