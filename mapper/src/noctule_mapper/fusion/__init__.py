"""Belief fusion: what readings say of places, and many readings of one place into one belief."""

from noctule_mapper.fusion.rules import FusionError, conflict, fuse

__all__ = ["FusionError", "conflict", "fuse"]
