"""Calibration of a range sensor from repeated readings of a wall: Liu et al. 2019, Section V.A."""
