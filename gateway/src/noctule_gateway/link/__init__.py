"""The conversation with a unit, without I/O and without a clock."""
