"""What is published about line and devices: a pure fold of readings and time into publications."""
