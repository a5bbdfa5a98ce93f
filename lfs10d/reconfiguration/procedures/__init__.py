"""Physical changes step by step on the line: what is read and written, in which order. Pure; run in the line thread."""
