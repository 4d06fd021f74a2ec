"""What tells time: a unit's ticks in UTC, and the time that has passed on the host."""
