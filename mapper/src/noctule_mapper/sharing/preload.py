"""What every mapper of a site needs, loaded and compiled when this is imported, in the process that forks them."""

from noctule_mapper.live import service
from noctule_mapper.mapper import Mapper

__all__ = ["service"]

Mapper().feature_points()
