"""What each request does: one file per noun. `lfs10d.commands.admission` decides whether it is accepted."""
