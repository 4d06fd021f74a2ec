"""The serial line to a unit: a port of any kind, and the thread that keeps it open."""
