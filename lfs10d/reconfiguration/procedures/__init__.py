"""Physical changes step by step, pure, run in the line thread."""
