"""What an object explains: log-likelihood gains of echoes over the model that their range is any in the sensor's span.

An object is weighed by the gains of the echoes that it explains best, less its price and a price for each echo that
contradicts it: one that comes from behind it, though it fills the beam.
"""

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.reflectors import Circle, Crossing, Line, Reflector, Spot
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.readings.lobe import lobe_rad


def gains(
    reflector: Reflector | Crossing, data: Evidence, config: RefinementConfig, margin_m: float = 0.0
) -> np.ndarray:
    """Gain of each echo, (n,), 0 where the reflector can't have made it; a wall answers up to ``margin_m`` beyond what
    has been seen of it.
    """
    predicted, direction = reflector.ranges(data.echoes), reflector.directions(data.echoes)
    at = np.nonzero(_possible(reflector, predicted, direction, data, config, margin_m))[0]
    residual = data.echoes.range_m[at] - predicted[at]
    gain = np.zeros(len(predicted))
    gain[at] = np.maximum(data.gain(residual, at) + data.direction_gain(direction[at], at), 0)
    return gain


def _possible(
    reflector: Reflector | Crossing,
    predicted_m: np.ndarray,
    direction_rad: np.ndarray,
    data: Evidence,
    config: RefinementConfig,
    margin_m: float,
) -> np.ndarray:
    """Whether the geometry lets the reflector, which predicts these ranges and directions, make each echo, bool (n,),
    whatever its range.
    """
    slack = config.beam.slack_rad + 2 * data.echoes.sigma_heading_rad
    slack = slack + (reflector.spread_rad if isinstance(reflector, Crossing) else 0.0)
    off_axis = np.abs(wrapped(direction_rad - data.echoes.axis_rad))
    can = (predicted_m > 0) & (predicted_m <= data.span_m + config.beam.behind_m)
    can &= off_axis <= data.echoes.half_beam_rad + slack
    if isinstance(reflector, Line):
        along = reflector.along(data.echoes)
        can &= (along >= reflector.low_m - margin_m) & (along <= reflector.high_m + margin_m)
    return can


def answering(reflector: Reflector | Crossing, data: Evidence, config: RefinementConfig) -> np.ndarray:
    """Chance that the reflector, a wall of any length, answers each reading, (n,), if nothing is before it.

    Sure on the beam's axis, even at its nominal edge, small up to the slack; close by the lobe is wider than nominal.
    """
    predicted = reflector.ranges(data.echoes)
    off_axis = np.abs(wrapped(reflector.directions(data.echoes) - data.echoes.axis_rad))
    if isinstance(reflector, Crossing):
        off_axis = np.maximum(off_axis - reflector.spread_rad, 0)
    half, slack = data.echoes.half_beam_rad, config.beam.slack_rad + 2 * data.echoes.sigma_heading_rad
    inside = np.interp(off_axis / half, (0.6, 1.0), (1.0, 0.5))
    edge = np.where(off_axis <= half + slack, 0.3, np.where(off_axis <= lobe_rad(predicted, half, config), 0.3, 0.0))
    in_span = (predicted > 0) & (predicted <= data.span_m + config.beam.behind_m)
    return reach(reflector, predicted, config) * np.where(off_axis <= half, inside, edge) * in_span


def reach(reflector: Reflector | Crossing, predicted: np.ndarray, config: RefinementConfig) -> np.ndarray:
    """Chance that a reflector on the beam's axis answers at a range."""
    match reflector:
        case Line():
            return np.full(len(predicted), config.beam.wall_chance)
        case Circle():
            return np.where(predicted < config.beam.cylinder_reach_m, config.beam.wall_chance, config.beam.faint_chance)
        case Crossing() if reflector.sine < 0:
            return np.where(predicted < config.beam.edge_reach_m, 0.5, config.beam.faint_chance)
        case Crossing():
            obtuse_rad = max(0.0, float(np.pi / 2 - reflector.turn_rad))
            return np.full(
                len(predicted),
                np.clip(1 - obtuse_rad / config.beam.obtuse_rad, config.beam.faint_chance, config.beam.corner_chance),
            )
        case _:
            return np.full(len(predicted), 0.5)


def hidden(
    reflector: Reflector | Crossing, wall: Line, echoes: Echoes, sigma_m: np.ndarray, config: RefinementConfig
) -> np.ndarray:
    """Whether ``wall`` stands between sensor and reflector, bool (n,): what seems to come from behind it has bounced
    somewhere. ``sigma_m`` (n,) is of the ranges.
    """
    predicted, direction = reflector.ranges(echoes), reflector.directions(echoes)
    along_ray_x, along_ray_y = np.cos(direction), np.sin(direction)
    before = wall.ranges(echoes)
    approach = along_ray_x * wall.normal[0] + along_ray_y * wall.normal[1]
    to_wall = before / np.where(np.abs(approach) < 1e-9, np.inf, approach)
    crossing = wall.along(echoes) + to_wall * (along_ray_x * wall.tangent[0] + along_ray_y * wall.tangent[1])
    deep = predicted * approach - before > config.beam.gate_sigmas * sigma_m + config.beam.behind_m
    inside = (crossing > wall.low_m + config.beam.behind_m) & (crossing < wall.high_m - config.beam.behind_m)
    return (before > 0) & (to_wall > 0) & deep & inside


def shaded(reflector: Reflector | Crossing, circle: Circle, echoes: Echoes) -> np.ndarray:
    """Whether ``circle`` stands between sensor and reflector, bool (n,): its own echo may go past the sensor's beam."""
    predicted, direction = reflector.ranges(echoes), reflector.directions(echoes)
    offset_x, offset_y = circle.x_m - echoes.x_m, circle.y_m - echoes.y_m
    along_m = offset_x * np.cos(direction) + offset_y * np.sin(direction)
    across_m = offset_y * np.cos(direction) - offset_x * np.sin(direction)
    return (along_m > 0) & (along_m < predicted) & (np.abs(across_m) < circle.radius_m)


def contradictions(reflector: Reflector, data: Evidence, config: RefinementConfig) -> float:
    """How many echoes come from behind the reflector though it is well inside their beam."""
    if isinstance(reflector, Spot):
        return 0.0
    predicted = reflector.ranges(data.echoes)
    off_axis = np.abs(wrapped(reflector.directions(data.echoes) - data.echoes.axis_rad))
    against = (off_axis <= 0.6 * data.echoes.half_beam_rad) & (predicted > 0.02)
    against &= data.echoes.range_m > predicted + config.beam.gate_sigmas * data.sigma_m + config.beam.behind_m
    if isinstance(reflector, Line):
        along = reflector.along(data.echoes)
        against &= (along > reflector.low_m + config.beam.behind_m) & (along < reflector.high_m - config.beam.behind_m)
    else:
        against &= predicted < config.beam.cylinder_reach_m
    return float(against.sum())


def price_beside(one: Reflector, data: Evidence, config: RefinementConfig) -> float:
    """What an object must gain to be believed, in nats. A cylinder costs more than a wall because arcs of walls and
    corners may agree on one; those lie on one side of it, so one that is heard from both sides costs what a wall does.
    So does one that two plateaus tell, if they are not at a right angle, as the walls of most corners are.
    """
    if isinstance(one, Circle) and data.has_fine:
        made = data.take(gains(one, data, config) > 0)
        if are_facing(one, made) or (is_told_by_two(one, made) and not _is_right_angled(one, made)):
            return min(config.prices.cylinder_nats, config.prices.wall_nats)
    return price_of(type(one), config)


def are_facing(one: Circle, made: Evidence) -> bool:
    """Whether among the echoes ``made`` of a cylinder are two from its two sides: an edge has no such two walls."""
    directions_rad = one.directions(made.echoes)
    return bool((np.abs(wrapped(directions_rad[:, None] - directions_rad)) > FACING_RAD).any())


def is_told_by_two(one: Reflector, made: Evidence) -> bool:
    """Whether ``one`` is a cylinder and the echoes ``made`` of it are of two places, both with directions."""
    has_direction = np.isfinite(made.direction_sigma_rad)
    return isinstance(one, Circle) and len(np.unique(made.place)) == len(np.unique(made.place[has_direction])) == 2


def _is_right_angled(one: Circle, made: Evidence) -> bool:
    """Whether two of the echoes ``made`` of a cylinder are at a right angle, to within the errors of plateaus."""
    directions_rad = one.directions(made.echoes)
    return bool((np.abs(np.cos(directions_rad[:, None] - directions_rad)) < _RIGHT_ANGLE_COSINE).any())


_RIGHT_ANGLE_COSINE = np.sin(np.radians(5.0))
FACING_RAD = np.radians(100.0)  # of two directions: more than a right angle, for edges are mostly right-angled


def price_of(kind: type[Line] | type[Circle] | type[Spot], config: RefinementConfig) -> float:
    """What an object of a kind must gain to be believed, in nats."""
    return {Line: config.prices.wall_nats, Circle: config.prices.cylinder_nats, Spot: config.prices.point_nats}[kind]
