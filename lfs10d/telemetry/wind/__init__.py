"""Wind as meteorologists count it (docs/wind.md): figures of the last minutes, and records of whole spans. Pure."""
