"""What tells time: a unit's ticks in UTC, and the host's wall clock as it is set."""
