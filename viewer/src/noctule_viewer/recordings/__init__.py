"""Recordings of what the relay passes on, by day, on disk."""
