"""What the verbs show: tables, live views, progress."""
