"""What waits for the broker, in memory and on disk. Knows no MQTT client."""
