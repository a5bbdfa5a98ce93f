"""What each request does: one file per noun. Whether it is obeyed is decided in `lfs10d.commands.admission`."""
