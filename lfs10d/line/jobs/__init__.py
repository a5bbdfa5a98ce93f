"""Jobs of the line, all pure: polls with retries, probes, pings, register access, scans and procedures."""
