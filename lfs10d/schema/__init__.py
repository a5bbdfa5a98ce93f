"""Text to validated data, for files and for requests."""
