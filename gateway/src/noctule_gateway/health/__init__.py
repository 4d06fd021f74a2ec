"""What a unit's sweeps say of the unit itself: pure, without files, clock or bus. judge.py puts the detectors together."""
