"""Compiles what every map is made with when it is imported, once, in the process that the mappers are forked from."""

import atexit
import os

from noctule_mapper.mapper import Mapper

Mapper().feature_points()
# Nothing is open in that process, and on a busy machine the libraries' own ends take it seconds.
atexit.register(os._exit, 0)
