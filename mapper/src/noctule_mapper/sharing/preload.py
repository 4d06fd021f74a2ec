"""Done once, in the process that the mappers are forked from: what each of them would compute as it begins."""

import atexit
import gc
import os

import scipy.ndimage  # noqa: F401  of feature points, which the empty map below has none of

from noctule_mapper.live.config import LiveConfig, to_toml
from noctule_mapper.mapper import Mapper

Mapper().feature_points()  # compiles the grid
to_toml(LiveConfig())  # the first time costs twice as much
gc.freeze()  # a mapper's collections would write into each object that is here, and so copy all its pages
# Nothing is open in that process, and on a busy machine the libraries' own ends take it seconds.
atexit.register(os._exit, 0)
