"""The spread of the echoes' ranges: the sensor's own, and where nobody has calibrated it what the survey tells."""

from dataclasses import replace

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.likelihood import evidence, newest_of_each_beam
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.noise import estimate_sigma_m


def distinct_echoes(echoes: Echoes, config: MapperConfig) -> Echoes:
    """Of the echoes from one place in one direction the newest: a thousand of them prove no more than one."""
    data = evidence(echoes, echoes.sigma_m, config.sensor.longest_range_m, config.refinement)
    return echoes.take(newest_of_each_beam(data))


def with_spread(echoes: Echoes, config: MapperConfig) -> Echoes:
    """``echoes`` with the estimated spread where theirs is only assumed."""
    if echoes.calibrated.all():
        return echoes
    estimate_m = estimate_sigma_m(distinct_echoes(echoes, config), config.noise)
    return replace(echoes, sigma_m=np.where(echoes.calibrated, echoes.sigma_m, estimate_m))
