"""The demo: a simulated line, the daemon and a broker, each in a process of its own, and a live table from MQTT."""
