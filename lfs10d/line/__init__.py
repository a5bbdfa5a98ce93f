"""The line thread: which device is polled next, retries, probes and other jobs, pauses between requests."""
