"""Home Assistant: the MQTT discovery payloads of a line and its devices. Pure."""
