"""Home Assistant: what its MQTT discovery is told of a line and its devices. Pure."""
