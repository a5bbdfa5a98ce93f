"""What a device is: its registers, limits and settings, as data files of one schema; registers to numbers."""
