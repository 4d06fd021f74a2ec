"""Model selection: which objects are there, by what each explains that no other does.

Objects are added while one gains more than its price from echoes that nothing yet explains, and taken away when, beside
the others, they no longer do. Corner points compete with walls and cylinders from the start, or their echoes would
become false ones.
"""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.candidates import Candidates
from noctule_mapper.config import MapperConfig
from noctule_mapper.joint_fit import Link, crossing, joint_fit
from noctule_mapper.likelihood import Evidence, contradictions, gains, hidden, price_of
from noctule_mapper.reflectors import Circle, Crossing, Line, Reflector, Spot

_FINALISTS = 3  # candidates of each kind that may be fitted before the best of all is chosen
_LEAST_HOPE = 0.6  # of its price: a rough candidate that gains less won't gain it when fitted
_MOST_HOPE = 1.3  # times its rough gain: what a candidate may gain when fitted


def add_objects(
    objects: Sequence[Reflector],
    explained: np.ndarray,
    library: Sequence[Candidates],
    data: Evidence,
    config: MapperConfig,
) -> list[Reflector]:
    """``objects`` and what more the echoes that are not ``explained``, bool (n,), are worth."""
    objects, free = list(objects), ~explained
    prices = {kind: price_of(kind, config.refinement) for kind in (Line, Circle, Spot)}
    library = [one.promising(free, _LEAST_HOPE * prices[one.kind]) for one in library]
    while True:
        best, best_worth = None, 0.0
        finalists = [(gain, one) for kind in library for gain, one in _finalists(kind, free, data, config)]
        for gain, start in sorted(finalists, key=lambda rough: prices[type(rough[1])] - rough[0]):
            if _MOST_HOPE * gain - prices[type(start)] < best_worth:
                continue
            fitted = fitted_alone(start, free, data, config)
            if fitted is None:
                continue
            worth = worth_of(fitted, free & in_sight(fitted, objects, data, config), data, config)
            if worth > best_worth:
                best, best_worth = fitted, worth
        if best is None:
            return objects
        objects.append(best)
        free &= gains(best, data, config.refinement) <= 0


def _finalists(
    kind: Candidates, free: np.ndarray, data: Evidence, config: MapperConfig
) -> list[tuple[float, Reflector]]:
    """The best candidates of a kind and their rough gains from the ``free`` echoes; each of other echoes than the ones
    before it.
    """
    finalists = []
    left = free.copy()
    while len(finalists) < _FINALISTS:
        best = kind.best(left)
        if best is None or best[0] < _LEAST_HOPE * price_of(kind.kind, config.refinement):
            break
        finalists.append(best)
        left &= gains(best[1], data.relaxed(2.0), config.refinement) <= 0
    return finalists


def fitted_alone(start: Reflector, free: np.ndarray, data: Evidence, config: MapperConfig) -> Reflector | None:
    """``start`` fitted to the ``free`` echoes, bool (n,), that it explains; None where they don't determine it."""
    tried: Reflector = start
    for relax in (3.0, 1.5, 1.0):
        wide = data.relaxed(relax)
        tried = trimmed(tried, free & (gains(tried, wide, config.refinement) > 0), data, config)
        used = free & (gains(tried, wide, config.refinement) > 0)
        if len(np.unique(data.place[used])) < config.refinement.least_places:
            return None
        fit = joint_fit([tried], [], np.where(used, 0, -1), wide, iterations=1)
        tried = _unbounded(fit.objects[0])
    tried = trimmed(tried, free & (gains(tried, data, config.refinement) > 0), data, config)
    places = len(np.unique(data.place[free & (gains(tried, data, config.refinement) > 0)]))
    return tried if determined(tried, fit.covariance, places, config) else None


def worth_of(tried: Reflector, free: np.ndarray, data: Evidence, config: MapperConfig) -> float:
    """What an object gains from the ``free`` echoes, less its price and the echoes that contradict it."""
    gain = float((gains(tried, data, config.refinement) * free).sum())
    return gain - _cost(tried, data, config)


def determined(tried: Reflector, covariance: np.ndarray, places: int, config: MapperConfig) -> bool:
    """Whether the echoes that a fit used, from so many ``places``, leave no absurd freedom."""
    sigma = np.sqrt(np.diag(covariance))
    limits = config.refinement
    match tried:
        case Line():
            long_enough = tried.high_m - tried.low_m >= limits.short_wall_m or places >= limits.short_wall_places
            return bool(sigma[0] < limits.most_theta_sigma_rad and long_enough)
        case Circle():
            size = config.cylinders
            sized = size.smallest_radius_m <= tried.radius_m <= size.largest_radius_m
            real = tried.radius_m > limits.least_radius_sigmas * sigma[2]
            return bool(sized and real and sigma.max() < limits.most_cylinder_sigma_m)
        case _:
            return bool(sigma.max() < limits.most_cylinder_sigma_m)


def trimmed(tried: Reflector, used: np.ndarray, data: Evidence, config: MapperConfig) -> Reflector:
    """A wall cut to the longest run of its ``used`` feet without a long hole; anything else as it is."""
    if not isinstance(tried, Line) or not used.any():
        return tried
    along = tried.along(data.echoes)[used]
    order = np.argsort(along)
    runs = np.split(order, np.nonzero(np.diff(along[order]) > config.refinement.longest_hole_m)[0] + 1)
    longest = max(runs, key=len)
    return Line(tried.theta_rad, tried.rho_m, float(along[longest[0]]), float(along[longest[-1]]))


def in_sight(one: Reflector | Crossing, walls: Sequence[Reflector], data: Evidence, config: MapperConfig) -> np.ndarray:
    """Whether none of ``walls`` stands before it, bool (n,)."""
    seen = np.ones(len(data.echoes), bool)
    for wall in walls:
        if isinstance(wall, Line):
            seen &= ~hidden(one, wall, data, config.refinement)
    return seen


def assign(
    objects: Sequence[Reflector], links: Sequence[Link], data: Evidence, config: MapperConfig
) -> tuple[np.ndarray, np.ndarray]:
    """Who made each echo, (n,): objects, then links, -1 for none; and every maker's gains, (makers, n).

    A wall hides what is behind it, unless what is behind explains more than the wall does.
    """
    table = np.zeros((len(objects) + len(links), len(data.echoes)))
    if not len(table):
        return np.full(len(data.echoes), -1), table
    for number, one in enumerate(objects):
        table[number] = gains(one, data, config.refinement, margin_m=config.refinement.growth_m)
    weighty = list(np.argsort(-table[: len(objects)].sum(axis=1)))
    for rank, number in enumerate(weighty):
        _hide(table[number], objects[number], [objects[other] for other in weighty[:rank]], data, config)
    for number, link in enumerate(links, len(objects)):
        corner = crossing(objects, link)
        table[number] = gains(corner, data, config.refinement)
        _hide(
            table[number],
            corner,
            [one for i, one in enumerate(objects) if i not in (link.first, link.second)],
            data,
            config,
        )
        for wall, line, outward in ((link.first, corner.first, 1), (link.second, corner.second, -1)):
            table[wall, outward * (line.along(data.echoes) - float(line.tangent @ corner.point)) > 0] = 0
    return np.where(table.max(axis=0) > 0, table.argmax(axis=0), -1), table


def _hide(
    row: np.ndarray, one: Reflector | Crossing, walls: Sequence[Reflector], data: Evidence, config: MapperConfig
) -> None:
    """Take from ``row``, the gains of ``one``, the echoes that one of ``walls`` hides it from."""
    won = np.nonzero(row)[0]
    row[won] *= in_sight(one, walls, data.take(won), config)


def own_worth(objects: Sequence[Reflector], table: np.ndarray, data: Evidence, config: MapperConfig) -> np.ndarray:
    """What each object is worth beside the others, in nats, (objects,); ``table`` as from ``assign``."""
    worth = np.zeros(len(objects))
    for number, one in enumerate(objects):
        others = np.delete(table, number, axis=0).max(axis=0, initial=0)
        alone = float(np.maximum(table[number] - others, 0).sum())
        worth[number] = alone - _cost(one, data, config)
    return worth


def total_worth(objects: Sequence[Reflector], table: np.ndarray, data: Evidence, config: MapperConfig) -> float:
    """What all objects together are worth, in nats."""
    gain = float(table.max(axis=0, initial=0).sum())
    return gain - sum(_cost(one, data, config) for one in objects)


def _cost(one: Reflector, data: Evidence, config: MapperConfig) -> float:
    """An object's price and that of the echoes which contradict it."""
    against = config.refinement.contradiction_price_nats * contradictions(one, data, config.refinement)
    return price_of(type(one), config.refinement) + against


def _unbounded(tried: Reflector) -> Reflector:
    return Line(tried.theta_rad, tried.rho_m) if isinstance(tried, Line) else tried
