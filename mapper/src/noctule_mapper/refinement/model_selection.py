"""Model selection: which objects are there, by what each explains that no other does.

Objects are added while one gains more than its price from echoes that nothing yet explains, and taken away when, beside
the others, they no longer do. Corner points compete with walls and cylinders from the start, or their echoes would
become false ones.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.likelihood import are_facing, contradictions, gains, hidden, price_beside, price_of
from noctule_mapper.contour.reflectors import Circle, Line, Reflector, Spot, box_of_rays
from noctule_mapper.contour.silence import silence_of, silence_of_stretch
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.refinement.candidates import Candidates

_FINALISTS = 3  # candidates of each kind that may be fitted before the best of all is chosen
_LEAST_HOPE = 0.6  # of its price: a rough candidate that gains less won't gain it when fitted
_ALONE = 2.0  # a wall's corners will tell more of its direction than its own echoes do
_MOST_HOPE = 1.3  # times its rough gain: what a candidate may gain when fitted


def add_objects(
    objects: Sequence[Reflector],
    explained: np.ndarray,
    library: Sequence[Candidates],
    data: Evidence,
    config: MapperConfig,
    most: int | None = None,
) -> list[Reflector]:
    """``objects`` and what more the echoes that are not ``explained``, bool (n,), are worth; of that the first ``most``
    if there is such a limit.
    """
    before, objects, free = len(objects), list(objects), ~explained
    prices = {kind: price_of(kind, config.refinement) for kind in (Line, Circle, Spot)}
    library = [one.promising(free, _LEAST_HOPE * prices[one.kind]) for one in library]
    while True:
        best, best_worth = None, 0.0
        hopeful = [(gain, one) for kind in library for gain, one in finalists(kind, free, data, config)]
        for gain, start in sorted(hopeful, key=lambda rough: prices[type(rough[1])] - rough[0]):
            if _MOST_HOPE * gain - prices[type(start)] < best_worth:
                continue
            fitted = fitted_alone(start, free, objects, data, config)
            if fitted is None:
                continue
            worth = worth_of(fitted, free, objects, data, config)
            if worth > best_worth:
                best, best_worth = fitted, worth
        if best is None:
            return objects
        objects.append(best)
        if most is not None and len(objects) - before >= most:
            return objects
        free &= gains(best, data, config.refinement) <= 0


def finalists(
    kind: Candidates, free: np.ndarray, data: Evidence, config: MapperConfig, least_hope: float = _LEAST_HOPE
) -> list[tuple[float, Reflector]]:
    """The best candidates of a kind and their rough gains from the ``free`` echoes, at least ``least_hope`` of the
    price; each of other echoes than the ones before it.
    """
    found = []
    left = free.copy()
    while len(found) < _FINALISTS:
        best = kind.best(left)
        if best is None or best[0] < least_hope * price_of(kind.kind, config.refinement):
            break
        found.append(best)
        left &= gains(best[1], data.respread(2.0), config.refinement) <= 0
    return found


def fitted_alone(
    start: Reflector,
    free: np.ndarray,
    objects: Sequence[Reflector],
    data: Evidence,
    config: MapperConfig,
    slack: float = _ALONE,
) -> Reflector | None:
    """``start`` beside ``objects``, fitted to the ``free`` echoes, bool (n,), that it explains; None where they don't
    determine it, a wall's direction to within ``slack`` times what a report needs.
    """
    tried: Reflector = start
    for relax in (3.0, 1.5, 1.0):
        wide = data.respread(relax)
        tried = trimmed(tried, free & (gains(tried, wide, config.refinement) > 0), objects, data, config)
        used = free & (gains(tried, wide, config.refinement) > 0)
        if not is_heard_enough(tried, data.take(used), config):
            return None
        tried, covariance = _stepped(_unbounded(tried), wide.take(np.nonzero(used)[0]))
    tried = trimmed(tried, free & (gains(tried, data, config.refinement) > 0), objects, data, config)
    places = len(np.unique(data.place[free & (gains(tried, data, config.refinement) > 0)]))
    return tried if determined(tried, covariance, places, data, config, slack) else None


def _stepped(tried: Reflector, used: Evidence) -> tuple[Reflector, np.ndarray]:
    """A step of one object to the ``used`` echoes, far ones weighing less, and the covariance after it."""
    residual, slopes = used.echoes.range_m - tried.ranges(used.echoes), tried.slopes(used.echoes)
    weight, sure = _weights(residual, used)
    turn = wrapped(used.echoes.axis_rad - tried.directions(used.echoes))
    turning = tried.direction_slopes(used.echoes)
    covariance = covariance_of(tried, used)
    return tried.moved(covariance @ (slopes.T @ (weight * residual) + turning.T @ (sure * turn))), covariance


def covariance_of(one: Reflector, used: Evidence) -> np.ndarray:
    """Of an object's parameters (p, p), by the ``used`` echoes alone, far ones weighing less."""
    slopes, turning = one.slopes(used.echoes), one.direction_slopes(used.echoes)
    weight, sure = _weights(used.echoes.range_m - one.ranges(used.echoes), used)
    information = slopes.T @ (weight[:, None] * slopes) + turning.T @ (sure[:, None] * turning)
    return np.linalg.inv(information + _WEAK_PRIOR * np.eye(slopes.shape[1]))


def _weights(residual_m: np.ndarray, used: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Of the ranges and of the directions, (n,) each."""
    weight = 1 / (1 + np.exp(-used.gain(residual_m))) / used.sigma_m**2
    return weight, weight * used.sigma_m**2 / used.turn_sigma_rad**2


_WEAK_PRIOR = 1e-2  # per square metre or radian: keeps what no echo determines where it is


def worth_of(
    tried: Reflector, free: np.ndarray, objects: Sequence[Reflector], data: Evidence, config: MapperConfig
) -> float:
    """What an object beside ``objects`` gains from the ``free`` echoes in whose sight it is, less its price and the
    echoes that contradict it.
    """
    gain = gains(tried, data, config.refinement) * free
    won = np.nonzero(gain)[0]
    return float(gain[won] @ _in_sight(tried, objects, data.take(won), config)) - _cost(tried, objects, data, config)


def determined(
    tried: Reflector, covariance: np.ndarray, places: int, data: Evidence, config: MapperConfig, slack: float = 1.0
) -> bool:
    """Whether the echoes that a fit used, from so many ``places``, leave no absurd freedom; a wall's direction may be
    ``slack`` times as free as one that is reported.
    """
    sigma = np.sqrt(np.diag(covariance))
    limits = config.refinement.limits
    match tried:
        case Line():
            # Where directions are known, a corner's echoes don't pass for a short wall.
            long_enough = data.looks is not None or tried.high_m - tried.low_m >= limits.short_wall_m
            long_enough |= places >= limits.short_wall_places
            return bool(sigma[0] < slack * limits.most_theta_sigma_rad and long_enough)
        case Circle():
            size = config.cylinders
            sized = size.smallest_radius_m <= tried.radius_m <= size.largest_radius_m
            loose = 1.0 if data.looks is None else slack  # plateaus know a range half as well as all their readings
            if data.has_fine:  # where it stands is known no better than the units' poses
                return bool(sized and sigma[2] < loose * limits.most_radius_sigma_share * tried.radius_m)
            real = tried.radius_m > limits.least_radius_sigmas / loose * sigma[2]
            return bool(sized and real and sigma.max() < loose * limits.most_cylinder_sigma_m)
        case _:
            return bool(sigma.max() < limits.most_cylinder_sigma_m)


def may_be_a_corner(circle: Circle, walls: Sequence[Line], made: Evidence) -> bool:
    """Whether the plateaus ``made`` of it may as well be of an acute corner: R = k |c - p|, with 3/4 < k < 1, often
    fits as well as a circle. Either one of the ``walls`` makes it with a wall that nobody knows, so that c is on its
    line; or two such walls do, if that fits better than the circle.
    """
    heard = made.echoes
    turn = wrapped(heard.axis_rad - circle.directions(heard)) / made.turn_sigma_rad
    square = float((((heard.range_m - circle.ranges(heard)) / made.sigma_m) ** 2).sum() + (turn**2).sum())
    of_known = min((_corner_square(made, wall) for wall in walls), default=np.inf)
    return of_known < square + _CORNER_NATS or _corner_square(made) < square


_CORNER_NATS = 6.0  # squared normalised errors by which a circle must be better than a corner, its parameter more
_LEAST_FACTOR = 0.75


def _corner_square(made: Evidence, wall: Line | None = None) -> float:
    """Squared normalised errors of the acute corner that fits best, on the line of ``wall`` if there is one, by
    Gauss-Newton steps in where it is and its factor k; infinite where none fits.

    k is the sine of the angle between the corner's walls, and it is heard from between them only: directions to it lie
    within that angle.
    """
    heard = made.echoes
    basis, origin_m = (np.eye(2), np.zeros(2)) if wall is None else (wall.tangent[:, None], wall.rho_m * wall.normal)
    axis = np.stack([np.cos(heard.axis_rad), np.sin(heard.axis_rad)])
    feet_m = np.stack([heard.x_m, heard.y_m]) + heard.range_m * axis
    at_m, factor = basis.T @ feet_m.mean(axis=1), 0.95
    weight = np.concatenate([1 / made.sigma_m, 1 / made.turn_sigma_rad])
    square, directions_rad = np.inf, heard.axis_rad
    for _ in range(_CORNER_STEPS):
        corner = Spot(*(float(c) for c in origin_m + basis @ at_m))
        distance_m, directions_rad = corner.ranges(heard) - heard.face_offset_m, corner.directions(heard)
        longer_m = heard.range_m - heard.face_offset_m - factor * distance_m
        off = weight * np.concatenate([longer_m, wrapped(heard.axis_rad - directions_rad)])
        by_range = np.column_stack([factor * (corner.slopes(heard) @ basis), distance_m])
        by_turn = np.column_stack([corner.direction_slopes(heard) @ basis, np.zeros(len(heard))])
        slopes = weight[:, None] * np.concatenate([by_range, by_turn])
        step = np.linalg.lstsq(slopes, off, rcond=None)[0]
        at_m, factor = at_m + step[:-1], factor + float(step[-1])
        square = float(np.sum((off - slopes @ step) ** 2))
    if not _LEAST_FACTOR < factor < 1:
        return np.inf
    apart_rad = np.abs(wrapped(directions_rad[:, None] - directions_rad)).max()
    return square if apart_rad <= np.arcsin(factor) else np.inf


_CORNER_STEPS = 6


def trimmed(
    tried: Reflector, used: np.ndarray, objects: Sequence[Reflector], data: Evidence, config: MapperConfig
) -> Reflector:
    """A wall beside ``objects`` cut to the longest run of its ``used`` feet without a long hole, without a lone foot at
    its end; anything else as it is.
    """
    if not isinstance(tried, Line) or not used.any():
        return tried
    along = np.sort(tried.along(data.echoes)[used])
    runs = np.split(along, np.nonzero(_holes(tried, along, objects, data, config))[0] + 1)
    longest = max(runs, key=len)
    for _ in range(2):
        if data.looks is None and len(longest) > 2 and longest[1] - longest[0] > config.refinement.limits.lone_end_m:
            longest = longest[1:]
        longest = -longest[::-1]
    return Line(tried.theta_rad, tried.rho_m, float(longest[0]), float(longest[-1]))


def sure_stretch(wall: Line, made: Evidence, corners_m: Sequence[float] = ()) -> Line:
    """The wall cut to where it surely goes on, by the echoes ``made`` of it and its corners, ``corners_m`` along it: at
    its end a corner sounds like the wall, so it may end before its last foot.
    """
    if not len(made.echoes):
        return wall
    along = wall.along(made.echoes)
    most_m = np.ptp([*along, *corners_m]) / 3
    low_m = float((along + np.minimum(_before_feet_m(wall, made, 1), most_m)).min())
    high_m = float((along - np.minimum(_before_feet_m(wall, made, -1), most_m)).max())
    if low_m > high_m:  # of feet in one spot the corner tells which end is open
        low_m = high_m = min(low_m, high_m, key=lambda end_m: abs(end_m - corners_m[0]))
    return Line(wall.theta_rad, wall.rho_m, low_m, high_m)


def _before_feet_m(wall: Line, made: Evidence, side: int) -> np.ndarray:
    """How far before the foot of each of the echoes ``made`` of it a wall may end, (n,), in metres; the wall goes on
    from there to higher (``side`` 1) or lower (-1) places along it.

    An echo from d beyond a corner is longer than the wall's by d^2 / (2 R) only, so within sqrt(2 R sigma) of its foot
    the wall may end, whatever the direction. Seen from there the corner lies d / R off the wall's normal. A plateau
    whose direction is off by t towards the wall may be a corner's at d if that makes up for what the range says:

        (d^2 / (2 R sigma))^2 + ((d / R - t) / sigma_t)^2 <= (t / sigma_t)^2 + 1.

    What one plateau says holds for all echoes from its place.
    """
    echoes, known = made.echoes, np.isfinite(made.direction_sigma_rad)
    _, place = np.unique(made.stand, return_inverse=True)
    sigma_m, before_m = np.full(len(echoes), np.inf), np.zeros(len(echoes))
    np.minimum.at(sigma_m, place, made.sigma_m)
    spread_m2 = 2 * echoes.range_m * sigma_m[place]
    turn_rad = side * wrapped(echoes.axis_rad - wall.directions(echoes))
    turn_rad, turn_sigma_rad = np.where(known, [np.maximum(turn_rad, 0), made.turn_sigma_rad], [[0.0], [np.inf]])
    tried_m = _TRIED_M[:, None]
    against = (tried_m**2 / spread_m2) ** 2 + ((tried_m / echoes.range_m - turn_rad) / turn_sigma_rad) ** 2
    may = against <= (turn_rad / turn_sigma_rad) ** 2 + 1
    np.maximum.at(before_m, place, np.maximum(np.sqrt(spread_m2), (may * tried_m).max(axis=0)))
    return before_m[place]


_TRIED_M = np.arange(0.0, 0.6, 0.005)  # before a foot; a corner beyond that is told by its range


def _holes(
    wall: Line, along_m: np.ndarray, objects: Sequence[Reflector], data: Evidence, config: MapperConfig
) -> np.ndarray:
    """Between which feet, sorted (n,), the wall has a hole, bool (n - 1,): where nobody looked with a fine sweep, in
    any long gap.
    """
    if data.looks is None:
        return np.diff(along_m) > config.refinement.limits.longest_hole_m
    stretches = pairwise(along_m)
    silence = [silence_of_stretch(wall, low, high, data, config.refinement, objects) for low, high in stretches]
    return np.array(silence) > config.refinement.prices.hole_nats


def is_heard_enough(one: Reflector, made: Evidence, config: MapperConfig) -> bool:
    """Whether the echoes ``made`` of an object are from places enough: two arcs whose directions are known have one
    common tangent, and one crossing. Of a circle they leave the radius open, unless they are of its two sides: what
    lies between two units that face each other is no wall, and no edge of two.
    """
    places = len(np.unique(made.place)) + (made.looks is not None)
    if isinstance(one, Circle) and made.looks is not None:
        places -= not (made.has_fine and are_facing(one, made))
    return places >= config.refinement.limits.least_places


def _in_sight(one: Reflector, objects: Sequence[Reflector], data: Evidence, config: MapperConfig) -> np.ndarray:
    """Whether no wall among ``objects`` stands before it, bool (n,)."""
    seen = np.ones(len(data.echoes), bool)
    if not len(seen):
        return seen
    rays = box_of_rays(one, data.echoes)
    for wall in objects:
        if isinstance(wall, Line) and np.all(rays[:2] <= wall.box[2:]) and np.all(rays[2:] >= wall.box[:2]):
            seen &= ~hidden(one, wall, data.echoes, data.sigma_m, config.refinement)
    return seen


def _cost(one: Reflector, objects: Sequence[Reflector], data: Evidence, config: MapperConfig) -> float:
    """An object's price and that of the echoes, or looks, which contradict it beside ``objects``."""
    if data.looks is None:
        against = config.refinement.prices.contradiction_nats * contradictions(one, data, config.refinement)
    else:
        against = silence_of(one, data, config.refinement, objects)
    return price_beside(one, data, config.refinement) + against


def _unbounded(tried: Reflector) -> Reflector:
    return Line(tried.theta_rad, tried.rho_m) if isinstance(tried, Line) else tried
