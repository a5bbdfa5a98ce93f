"""The queue to the broker, in memory and on disk: order, losses, retries. Knows no MQTT client."""
