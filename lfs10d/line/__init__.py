"""The line thread: who is polled next, one exchange after the other."""
