"""Jobs of the line, all pure: polls and probes, pings, register access, scans and procedures."""
