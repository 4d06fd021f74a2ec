"""What gateway and mapper load and compute as they begin, done once, in the process that they are forked from.

Not Rerun's SDK, which begins threads as it is imported: a process that has some can't be forked safely.
"""

import gc
from importlib import import_module

from noctule_mapper.mapper import Mapper

for _loaded in ("noctule_gateway.cli.serve", "noctule_mapper.live.map_process", "noctule_mapper.live.service"):
    import_module(_loaded)
Mapper().feature_points()  # compiles the grid
gc.freeze()  # a collection of the forked would write into each object that is here, and so copy its page
