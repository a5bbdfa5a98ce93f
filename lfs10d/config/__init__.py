"""From files to frozen models."""
