"""A line full of sensors, well or ill, in memory or on a pseudo terminal; and a judge of the master."""
