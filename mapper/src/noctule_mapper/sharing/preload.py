"""Compiles what every map is made with when it is imported, once, in the process that the mappers are forked from."""

from noctule_mapper.mapper import Mapper

Mapper().feature_points()
