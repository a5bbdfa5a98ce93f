"""The output of the verbs: tables, live views, progress."""
