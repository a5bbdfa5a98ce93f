"""What a device is: its registers, limits and settings, as YAML files of one schema; registers to values."""
