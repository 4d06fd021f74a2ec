"""What a unit's sweeps say of the unit itself: pure, but for memory_file. judge.py puts all together."""
