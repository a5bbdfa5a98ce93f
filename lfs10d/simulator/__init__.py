"""A simulated line of sensors, with faults, in memory or on a pseudo terminal; and a judge of the master."""
