"""What was heard: a sweep's readings, checked and corrected, and the echoes of many."""
