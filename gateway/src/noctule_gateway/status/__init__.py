"""A unit's status in words and figures."""
