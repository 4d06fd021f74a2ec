"""Sweeps to contours, logged to Rerun."""
