"""One process: built, started, watched, stopped."""
