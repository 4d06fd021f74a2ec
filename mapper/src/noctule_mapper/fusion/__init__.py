"""Belief fusion: what one reading says of a place (``sensor_model``), and many beliefs about one place as one
(``rules``, and ``streams`` for readings that come and go).
"""

from noctule_mapper.fusion.rules import FusionError, conflict, fuse

__all__ = ["FusionError", "conflict", "fuse"]
