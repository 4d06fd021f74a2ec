"""One unit served, from its line to its log."""
