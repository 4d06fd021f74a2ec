"""The colour of a unit in every picture, on a dark background."""

from collections.abc import Sequence

Colour = tuple[int, int, int]

_UNITS: Sequence[Colour] = ((111, 207, 151), (86, 204, 242), (167, 139, 250), (244, 114, 182), (242, 201, 76))


def unit_colour(unit: str) -> Colour:
    """The same colour for a unit in every run, and different ones for u1, u2, u3 and so on."""
    return _UNITS[sum(unit.encode()) % len(_UNITS)]
