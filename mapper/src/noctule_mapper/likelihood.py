"""What an object explains: log-likelihood gains of echoes over the model that their range is any in the sensor's span.

An object is weighed by the gains of the echoes that it explains best, less its price and a price for each echo that
contradicts it: one that comes from behind it, though it fills the beam.
"""

from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contacts import wrapped
from noctule_mapper.echoes import Echoes
from noctule_mapper.reflectors import Circle, Crossing, Line, Reflector, Spot


@dataclass(frozen=True)
class Evidence:
    """The echoes of a refinement; arrays (n,)."""

    echoes: Echoes
    sigma_m: np.ndarray  # of a range, the pose's error in it
    place: np.ndarray  # a number that the echoes from one place share
    span_m: float  # ranges that an echo of nothing may have

    def take(self, index: np.ndarray) -> "Evidence":
        """The evidence at ``index`` (numbers or a mask)."""
        return replace(
            self,
            echoes=self.echoes.take(index),
            sigma_m=self.sigma_m[index],
            place=self.place[index],
        )

    def relaxed(self, factor: float) -> "Evidence":
        """The same with ``factor`` times the spread."""
        return replace(self, sigma_m=factor * self.sigma_m)

    def gain(self, residual_m: np.ndarray) -> np.ndarray:
        """Gain in nats of residuals (..., n); negative where the outlier model explains the echo better."""
        return np.log(self.span_m / (self.sigma_m * np.sqrt(2 * np.pi))) - 0.5 * (residual_m / self.sigma_m) ** 2


def evidence(echoes: Echoes, sigma_m: np.ndarray, span_m: float, config: RefinementConfig) -> Evidence:
    """Evidence of ``echoes`` whose ranges have the spread ``sigma_m``, (n,), in a span of ``span_m``."""
    cell = np.rint(np.stack([echoes.x_m, echoes.y_m], axis=1) / config.same_place_m).astype(int)
    _, place = np.unique(cell, axis=0, return_inverse=True)
    return Evidence(echoes, np.hypot(sigma_m, echoes.sigma_position_m), place.ravel(), span_m)


def newest_of_each_beam(data: Evidence) -> np.ndarray:
    """Numbers of the echoes that stand for all when objects are weighed: of one place and direction the newest.

    Such echoes share their errors: of pose, of clutter, of what passes by. A thousand of them prove no more than one.
    """
    beam = np.rint(data.echoes.axis_rad % (2 * np.pi) / data.echoes.half_beam_rad).astype(int)
    groups = np.stack([data.place, beam], axis=1)[::-1]
    _, last = np.unique(groups, axis=0, return_index=True)
    return np.sort(len(groups) - 1 - last)


def gains(
    reflector: Reflector | Crossing, data: Evidence, config: RefinementConfig, margin_m: float = 0.0
) -> np.ndarray:
    """Gain of each echo, (n,), 0 where the reflector can't have made it; a wall answers up to ``margin_m`` beyond what
    has been seen of it.
    """
    residual = data.echoes.range_m - reflector.ranges(data.echoes)
    return np.where(possible(reflector, data, config, margin_m), np.maximum(data.gain(residual), 0), 0)


def possible(
    reflector: Reflector | Crossing, data: Evidence, config: RefinementConfig, margin_m: float = 0.0
) -> np.ndarray:
    """Whether the geometry lets the reflector make each echo, bool (n,), whatever its range."""
    slack = config.beam_slack_rad + 2 * data.echoes.sigma_heading_rad
    slack = slack + (reflector.spread_rad if isinstance(reflector, Crossing) else 0.0)
    off_axis = np.abs(wrapped(reflector.directions(data.echoes) - data.echoes.axis_rad))
    can = (off_axis <= data.echoes.half_beam_rad + slack) & (reflector.ranges(data.echoes) > 0)
    if isinstance(reflector, Line):
        along = reflector.along(data.echoes)
        can &= (along >= reflector.low_m - margin_m) & (along <= reflector.high_m + margin_m)
    return can


def hidden(reflector: Reflector | Crossing, wall: Line, data: Evidence, config: RefinementConfig) -> np.ndarray:
    """Whether ``wall`` stands between sensor and reflector, bool (n,): what seems to come from behind it has bounced
    somewhere.
    """
    predicted, direction = reflector.ranges(data.echoes), reflector.directions(data.echoes)
    along_ray_x, along_ray_y = np.cos(direction), np.sin(direction)
    before = wall.ranges(data.echoes)
    approach = along_ray_x * wall.normal[0] + along_ray_y * wall.normal[1]
    to_wall = before / np.where(np.abs(approach) < 1e-9, np.inf, approach)
    crossing = wall.along(data.echoes) + to_wall * (along_ray_x * wall.tangent[0] + along_ray_y * wall.tangent[1])
    deep = predicted * approach - before > config.gate_sigmas * data.sigma_m + config.behind_m
    inside = (crossing > wall.low_m + config.behind_m) & (crossing < wall.high_m - config.behind_m)
    return (before > 0) & (to_wall > 0) & deep & inside


def contradictions(reflector: Reflector, data: Evidence, config: RefinementConfig) -> float:
    """How many echoes come from behind the reflector though it is well inside their beam."""
    if isinstance(reflector, Spot):
        return 0.0
    predicted = reflector.ranges(data.echoes)
    off_axis = np.abs(wrapped(reflector.directions(data.echoes) - data.echoes.axis_rad))
    against = (off_axis <= 0.6 * data.echoes.half_beam_rad) & (predicted > 0.02)
    against &= data.echoes.range_m > predicted + config.gate_sigmas * data.sigma_m + config.behind_m
    if isinstance(reflector, Line):
        along = reflector.along(data.echoes)
        against &= (along > reflector.low_m + config.behind_m) & (along < reflector.high_m - config.behind_m)
    else:
        against &= predicted < config.cylinder_reach_m
    return float(against.sum())


def price_of(kind: type[Line] | type[Circle] | type[Spot], config: RefinementConfig) -> float:
    """What an object of a kind must gain to be believed, in nats."""
    return {Line: config.wall_price_nats, Circle: config.cylinder_price_nats, Spot: config.point_price_nats}[kind]
