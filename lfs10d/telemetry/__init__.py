"""What is published about line and devices, computed from readings and time. Pure."""
