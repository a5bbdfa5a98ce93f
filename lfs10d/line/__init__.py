"""The line thread: which device is polled next, one exchange after the other; jobs; pauses between requests."""
