"""Angles."""

import numpy as np


def wrapped(angle_rad: np.ndarray) -> np.ndarray:
    """The same angle within -pi to pi."""
    return (angle_rad + np.pi) % (2 * np.pi) - np.pi
