"""What is done on the line, each as a pure job: poll, probe, and later scan and changes."""
