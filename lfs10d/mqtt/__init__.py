"""MQTT: topics, the connection to the broker, sending and receiving. Knows no Modbus."""
