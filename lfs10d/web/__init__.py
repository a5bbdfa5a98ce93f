"""The live page and the figures for Prometheus: a process of its own, and an MQTT client like any other."""
