"""Bearings as an operator says them who stands where the unit is."""

from math import degrees


def words(bearing_rad: float) -> str:
    """``ahead``, ``left 30°``, ``right 90°``, ``behind``: whole degrees, anticlockwise from ahead is left."""
    turned = (round(degrees(bearing_rad)) + 180) % 360 - 180
    if turned == 0:
        return "ahead"
    if turned == -180:
        return "behind"
    return f"{'left' if turned > 0 else 'right'} {abs(turned)}°"
