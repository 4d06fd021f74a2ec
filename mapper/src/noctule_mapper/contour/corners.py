"""The contour: which wall's end meets which wall's start, from what has been seen of them.

A wall runs so that the room lies on its left, hence going round the room each end is followed by a start. Ends and
starts are linked one to one at the least total gap, by assignment: true gaps are long beside a cylinder or in a blind
corner, and no limit on gaps alone gets an L right.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.assignment import assignment
from noctule_mapper.contour.contour import Contour, Corner, Cylinder, Wall
from noctule_mapper.contour.reflectors import Circle, Crossing, Line, Reflector
from noctule_mapper.contour.silence import silence_of_link
from noctule_mapper.readings.evidence import Evidence


@dataclass(frozen=True)
class Link:
    """Wall ``first`` ends where wall ``second`` starts: indices into the objects."""

    first: int
    second: int


def crossing(objects: Sequence[Reflector], link: Link) -> Crossing:
    """The corner of two linked walls."""
    first, second = objects[link.first], objects[link.second]
    if not isinstance(first, Line) or not isinstance(second, Line):
        raise TypeError(f"{link} joins {first} and {second}; only walls have ends to join")
    return Crossing(first, second)


@dataclass(frozen=True)
class Fit:
    """The objects after the fit, and the covariance of all their parameters, those of object i from offsets[i] on;
    ``held`` is the same if the site's frame and the sensors were exactly known: how well the objects fit one another.
    """

    objects: list[Reflector]
    covariance: np.ndarray
    held: np.ndarray
    offsets: np.ndarray

    def covariance_of(self, *indices: int) -> np.ndarray:
        """Joint covariance of the parameters of some objects."""
        rows = self._rows(indices)
        return self.covariance[np.ix_(rows, rows)]

    def held_covariance_of(self, *indices: int) -> np.ndarray:
        """The same if the site's frame were exactly known."""
        rows = self._rows(indices)
        return self.held[np.ix_(rows, rows)]

    def _rows(self, indices: Sequence[int]) -> np.ndarray:
        return np.concatenate([np.arange(self.offsets[i], self.offsets[i + 1]) for i in indices])


def link_ends(
    walls: dict[int, Line],
    data: Evidence,
    config: RefinementConfig,
    support: Callable[[Crossing], float] | None = None,
    heard: Callable[[Crossing], float] | None = None,
    objects: Sequence[Reflector] = (),
) -> list[Link]:
    """Links between ``walls`` (by the numbers they bear), at the least total price in nats.

    A link costs by the gap that it closes and by what was heard through the stretches it would add (``heard_price``,
    unless the caller knows ``heard``); what its corner explains, ``support``, it is given back. Among ``objects`` walls
    may hide the gap from those who looked.
    """
    if len(walls) < 2:
        return []
    numbers, lines = list(walls), list(walls.values())
    cost = np.full((len(lines), 2 * len(lines)), config.linking.open_end_nats)  # the right half: an end that stays open
    cost[:, : len(lines)] = np.inf
    longest_m = config.linking.longest_gap_m if data.looks is None else np.inf
    end_gap_m, start_gap_m = _gaps_m(lines, longest_m, config)
    for i, j in np.argwhere(np.isfinite(end_gap_m)):
        corner = Crossing(lines[i], lines[j])
        price = _gap_price(float(end_gap_m[i, j]), float(start_gap_m[i, j]), data, config)
        price += heard(corner) if heard else heard_price(corner, data, config)
        price -= support(corner) if support else 0.0
        if data.looks is not None and price < config.linking.open_end_nats:  # dearer, both ends stay open
            price += silence_of_link(corner, data, config, objects)
        cost[i, j] = price
    starts = assignment(cost)
    return [Link(numbers[i], numbers[j]) for i, j in enumerate(starts) if j < len(lines)]


def _gap_price(end_gap_m: float, start_gap_m: float, data: Evidence, config: RefinementConfig) -> float:
    """Price of a link for its gap, as if nobody had looked at it: of fine sweeps the looks tell more."""
    gap_m = abs(end_gap_m) + abs(start_gap_m)
    if data.looks is None:
        return min(config.linking.gap_nats_per_m * gap_m, config.linking.most_gap_nats)
    unseen = config.linking.link_nats + config.linking.unseen_nats_per_m * gap_m
    return unseen + config.linking.between_nats_per_m * max(min(end_gap_m, start_gap_m), 0.0)


def _gaps_m(lines: Sequence[Line], longest_gap_m: float, config: RefinementConfig) -> tuple[np.ndarray, np.ndarray]:
    """What a corner of wall i's end and wall j's start would add to either, (i, j) each, negative where it would take
    away; infinite where there can be none.
    """
    theta, rho, low, high = np.array([(one.theta_rad, one.rho_m, one.low_m, one.high_m) for one in lines]).T
    turn = theta[None, :] - theta[:, None]
    sine, cosine = np.sin(turn), np.cos(turn)
    with np.errstate(divide="ignore", invalid="ignore"):
        end_gap = (rho[None, :] - rho[:, None] * cosine) / sine - high[:, None]
        start_gap = low[None, :] - (rho[None, :] * cosine - rho[:, None]) / sine
        possible = (np.abs(sine) >= config.linking.least_crossing_sine) & (
            np.minimum(end_gap, start_gap) >= -config.linking.overshoot_m
        )
        possible &= np.maximum(end_gap, start_gap) <= longest_gap_m
    return np.where(possible, end_gap, np.inf), np.where(possible, start_gap, np.inf)


def heard_price(corner: Crossing, data: Evidence, config: RefinementConfig) -> float:
    """Price of the echoes that were heard through the stretches which a corner adds to its walls."""
    first, second = corner.first, corner.second
    stretches = ((first.at(first.high_m), corner.point), (corner.point, second.at(second.low_m)))
    return config.prices.contradiction_nats * sum(heard_through(a, b, data, config) for a, b in stretches)


def heard_through(start: np.ndarray, end: np.ndarray, data: Evidence, config: RefinementConfig) -> float:
    """How many echoes came back from beyond the stretch ``start`` to ``end`` though it would have filled their beam.

    One that is no farther than the stretch's far end may be an echo of that end.
    """
    length = float(np.hypot(*(end - start)))
    if length < 2 * config.beam.behind_m:
        return 0.0
    along = (end - start) / length
    offset_x, offset_y = data.echoes.x_m - start[0], data.echoes.y_m - start[1]
    axis_x, axis_y = np.cos(data.echoes.axis_rad), np.sin(data.echoes.axis_rad)
    across = axis_x * along[1] - axis_y * along[0]
    safe = np.where(np.abs(across) < 1e-9, np.inf, across)
    distance = (offset_y * along[0] - offset_x * along[1]) / safe
    at = (offset_y * axis_x - offset_x * axis_y) / safe
    farthest = np.maximum(np.hypot(offset_x, offset_y), np.hypot(data.echoes.x_m - end[0], data.echoes.y_m - end[1]))
    through = (distance > 0) & (at > config.beam.behind_m) & (at < length - config.beam.behind_m)
    through &= data.echoes.range_m > farthest + config.beam.gate_sigmas * data.sigma_m + config.beam.behind_m
    return float(through.sum())


def parting(corner: Crossing, data: Evidence, config: RefinementConfig) -> np.ndarray:
    """Which plateaus would, as walls, part the corner from what has been seen of both its walls, bool (n,); where
    nothing but coarse sweeps looked, which echoes might do so in some direction of their beam.

    There may be a wall between these two that only one place has heard.
    """
    if data.tells_direction is not None:
        return data.tells_direction & _parts(corner, data.echoes.axis_rad, data, config)
    if data.looks is None or data.has_fine:
        return np.zeros(len(data.echoes), bool)
    turns_rad = [share * data.echoes.half_beam_rad for share in _SHARES_OF_A_BEAM]
    return np.any([_parts(corner, data.echoes.axis_rad + turn_rad, data, config) for turn_rad in turns_rad], axis=0)


_SHARES_OF_A_BEAM = (-0.6, 0.0, 0.6)  # from its axis: where most of what is heard lies


def _parts(corner: Crossing, direction_rad: np.ndarray, data: Evidence, config: RefinementConfig) -> np.ndarray:
    """Whether lines in ``direction_rad`` (n,) part the corner from what has been seen of both walls, bool (n,)."""
    normal = np.stack([np.cos(direction_rad), np.sin(direction_rad)], axis=1)
    rho_m = normal[:, 0] * data.echoes.x_m + normal[:, 1] * data.echoes.y_m + data.echoes.range_m
    seen = (corner.first.at(corner.first.high_m), corner.second.at(corner.second.low_m))
    before = [normal @ foot < rho_m for foot in seen]
    return before[0] & before[1] & (normal @ corner.point > rho_m + config.beam.behind_m)


def is_known(fit: Fit, link: Link, config: RefinementConfig) -> bool:
    """Whether the walls of a link tell their corner well enough to state it: to within ``most_corner_sigma_m``."""
    slopes = crossing(fit.objects, link).point_slopes()
    held = slopes @ fit.held_covariance_of(link.first, link.second) @ slopes.T
    return bool(np.sqrt(np.trace(held)) < config.limits.most_corner_sigma_m)


def contour_of(fit: Fit, links: Sequence[Link], readings: Sequence[int], config: RefinementConfig) -> Contour:
    """Fitted objects, each resting on ``readings`` of its own, as walls, corners and cylinders.

    Points that are no corner of known walls are left out, and so are corners that are not known to within
    ``most_corner_sigma_m``.
    """
    lines = {number: one for number, one in enumerate(fit.objects) if isinstance(one, Line)}
    order = list(lines)
    ends = {number: (line.at(line.low_m), line.at(line.high_m)) for number, line in lines.items()}
    corners = []
    for link in links:
        if is_known(fit, link, config):
            corner = crossing(fit.objects, link)
            slopes = corner.point_slopes()
            covariance = slopes @ fit.covariance_of(link.first, link.second) @ slopes.T
            x, y = (float(coordinate) for coordinate in corner.point)
            corners.append(Corner(x, y, covariance, (order.index(link.first), order.index(link.second))))
            ends[link.first] = (ends[link.first][0], corner.point)
            ends[link.second] = (corner.point, ends[link.second][1])
    walls = [
        Wall(
            line.theta_rad,
            line.rho_m,
            _pair(ends[number][0]),
            _pair(ends[number][1]),
            fit.covariance_of(number),
            readings[number],
        )
        for number, line in lines.items()
    ]
    cylinders = [
        Cylinder(one.x_m, one.y_m, one.radius_m, fit.covariance_of(number), readings[number])
        for number, one in enumerate(fit.objects)
        if isinstance(one, Circle)
    ]
    return Contour(tuple(walls), tuple(corners), tuple(cylinders))


def _pair(point: np.ndarray) -> tuple[float, float]:
    return float(point[0]), float(point[1])
