"""The operating system: disk, threads, systemd, logs, clock."""
