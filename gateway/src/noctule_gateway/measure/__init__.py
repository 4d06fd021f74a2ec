"""What a unit measures of itself on demand: its gear, its play, a test of its parts."""
