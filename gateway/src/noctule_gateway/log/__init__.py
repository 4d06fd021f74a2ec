"""A unit's log on the disk."""
