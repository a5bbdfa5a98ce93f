"""The backlog on disk while the broker is away: samples in one SQLite file. Knows no MQTT."""
