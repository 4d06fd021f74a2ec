"""Candidates: reflectors that a few echoes suggest, each to be weighed against all the echoes.

Walls and points come from pairs of echoes (their common tangent line, the crossing of their arcs), cylinders from
triples (their common tangent circle). Contacts, where there are any, come first: many neighbours already agree on them.
"""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import ContactConfig, CylinderConfig, MapperConfig, RefinementConfig
from noctule_mapper.contacts.tangency import SIDES, direction_rad, other_direction_rad, turn_rad
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.contour.likelihood import FACING_RAD
from noctule_mapper.contour.reflectors import Circle, Line, Reflector, Spot
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.readings.pairs import may_share, offsets


@dataclass(frozen=True)
class Candidates:
    """Reflectors of one kind as rows of parameters (m, p), and the gain of each echo under each, float32 (m, n)."""

    kind: type[Line] | type[Circle] | type[Spot]
    parameters: np.ndarray
    gains: np.ndarray

    def promising(self, free: np.ndarray, least: float) -> "Candidates":
        """Those that gain at least ``least`` nats from ``free`` echoes, bool (n,)."""
        rows = self.gains @ free.astype(np.float32) >= least
        return Candidates(self.kind, self.parameters[rows], self.gains[rows])

    def touching(self, its: np.ndarray) -> "Candidates":
        """Those that gain from any of the echoes ``its``, bool (n,)."""
        rows = (self.gains[:, its] > 0).any(axis=1)
        return Candidates(self.kind, self.parameters[rows], self.gains[rows])

    def best(self, free: np.ndarray) -> tuple[float, Reflector] | None:
        """The candidate that gains most from echoes weighed ``free`` (n,), and what it gains; None where there are no
        candidates.
        """
        if not len(self.parameters):
            return None
        total = self.gains @ free.astype(np.float32)
        row = int(total.argmax())
        return float(total[row]), self.kind(*(float(p) for p in self.parameters[row]))


def candidates(
    data: Evidence, found: Contacts, contact: ContactConfig, cylinder: CylinderConfig, config: RefinementConfig
) -> list[Candidates]:
    """Candidates of every kind, weighed."""
    rng = np.random.default_rng(cylinder.seed)
    i, j = _pairs(data, contact, config, rng)
    all_around = config.search.cylinders_from_all_around
    round_i, round_j = _pairs(data, contact, config, rng, np.inf) if all_around else (i, j)
    lines = np.concatenate(
        [_contact_lines(data.echoes, found), _tangent_lines(data.echoes, i, j), _plateau_lines(data)]
    )
    spots = np.concatenate([_contact_spots(data.echoes, found), _arc_crossings(data.echoes, i, j)])
    circles = np.concatenate(
        [
            _contact_circles(data.echoes, found, cylinder),
            _tangent_circles(data.echoes, *_triples(round_i, round_j, config, rng), cylinder),
            _plateau_circles(data, cylinder, config),
        ]
    )
    lines, spots, circles = (_distinct(one, float(np.median(data.sigma_m))) for one in (lines, spots, circles))
    return [
        Candidates(Line, lines, _line_gains(lines, data, config)),
        Candidates(Spot, spots, _round_gains(spots, np.zeros(len(spots)), data, config)),
        Candidates(Circle, circles, _round_gains(circles[:, :2], circles[:, 2], data, config)),
    ]


def line_candidates(lines: np.ndarray, data: Evidence, config: MapperConfig) -> Candidates:
    """Lines (theta, rho), (m, 2), weighed, but for those that are the same."""
    lines = _distinct(lines, float(np.median(data.sigma_m)))
    return Candidates(Line, lines, _line_gains(lines, data, config.refinement))


def _distinct(parameters: np.ndarray, sigma_m: float) -> np.ndarray:
    """Of candidates that are the same to within about the spread, one; (m, p)."""
    _, first = np.unique(np.rint(parameters / (_SAME_SIGMAS * sigma_m)).astype(int), axis=0, return_index=True)
    return parameters[np.sort(first)]


_SAME_SIGMAS = 2.0  # also for theta, as metres at a metre's arm


def _pairs(
    data: Evidence,
    contact: ContactConfig,
    config: RefinementConfig,
    rng: np.random.Generator,
    most_turn_beams: float = 4.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of echoes that may share a reflector, drawn evenly where there are more than enough; (m,) each, i of any
    order to j. The axes of coarse sweeps are turned by ``most_turn_beams`` half beams at most.
    """
    echoes, has_direction = data.echoes, np.isfinite(data.direction_sigma_rad)
    first = np.arange(len(echoes))
    if len(first) > config.search.most_pair_echoes:
        first = rng.choice(first, config.search.most_pair_echoes, replace=False)
    between = offsets(echoes, first[:, None], echoes, np.arange(len(echoes)))
    turned = np.abs(wrapped(echoes.axis_rad[None, :] - echoes.axis_rad[first, None]))
    # A beam alone is too wide to tell, far off, whether two echoes are of one reflector; a plateau's direction is not.
    directed = has_direction[first, None] & has_direction[None, :]
    longest_m = np.where(directed, np.inf, contact.longest_baseline_m)
    near = may_share(between.baseline_m, between.longer_m, contact.shortest_baseline_m, longest_m)
    near &= directed | (turned <= most_turn_beams * echoes.half_beam_rad[first, None])
    i, j = np.nonzero(near)
    if len(i) > config.search.most_pairs:
        drawn = rng.choice(len(i), config.search.most_pairs, replace=False)
        i, j = i[drawn], j[drawn]
    return first[i], j


def _triples(
    i: np.ndarray, j: np.ndarray, config: RefinementConfig, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triples made of two pairs with the same first echo, (m,) each."""
    order = np.argsort(i, kind="stable")
    i, j = i[order], j[order]
    if not len(i):
        return i, j, j
    start = np.searchsorted(i, i, side="left")
    count = np.searchsorted(i, i, side="right") - start
    drawn = rng.integers(0, len(i), config.search.most_triples)
    other = start[drawn] + rng.integers(0, count[drawn])
    distinct = j[drawn] != j[other]
    return i[drawn][distinct], j[drawn][distinct], j[other][distinct]


def _tangent_lines(echoes: Echoes, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Common tangent lines (theta, rho) of pairs of arcs, (m, 2), those inside both beams."""
    return np.concatenate(
        [_line_through(echoes, at, direction) for at, direction in _touched_by_both(echoes, i, j, np.zeros(len(i)))]
    )


def _arc_crossings(echoes: Echoes, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Crossings of pairs of arcs, (m, 2), those inside both beams."""
    return np.concatenate(
        [_foot(echoes, at, direction) for at, direction in _touched_by_both(echoes, i, j, 1 / echoes.range_m[i])]
    )


def _touched_by_both(
    echoes: Echoes, i: np.ndarray, j: np.ndarray, curvature_per_m: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """On either side the pairs whose common circle of ``curvature_per_m`` (p,) lies inside both beams: the numbers of
    their first echoes, and the directions from these.
    """
    between, found = offsets(echoes, i, echoes, j), []
    turned_rad = turn_rad(between, curvature_per_m)
    for side in SIDES:
        direction = direction_rad(between, turned_rad, side)
        inside = _in_beam(echoes, i, direction)
        inside &= _in_beam(echoes, j, other_direction_rad(between, direction, curvature_per_m))
        found.append((i[inside], direction[inside]))
    return found


def _tangent_circles(
    echoes: Echoes, i: np.ndarray, j: np.ndarray, k: np.ndarray, cylinder: CylinderConfig
) -> np.ndarray:
    """Circles (x, y, radius) that three arcs touch from outside, (m, 3), those of a cylinder's size and inside the
    beams.
    """
    x, y, r = echoes.x_m, echoes.y_m, echoes.range_m
    to_j, to_k = (np.stack([x[m] - x[i], y[m] - y[i]], axis=1) for m in (j, k))
    across = to_j[:, 0] * to_k[:, 1] - to_j[:, 1] * to_k[:, 0]
    straight = np.abs(across) < _STRAIGHT_RAD * np.hypot(*to_j.T) * np.hypot(*to_k.T)
    found = []
    for some, solved in ((~straight, _circles_off_a_line), (straight, _circles_beside_a_line)):
        rows = np.nonzero(some)[0]
        for offset, radius in solved(to_j[rows], to_k[rows], r[i[rows]], r[j[rows]], r[k[rows]]):
            centre = np.stack([x[i[rows]], y[i[rows]]], axis=1) + offset
            good = (radius >= cylinder.smallest_radius_m) & (radius <= cylinder.largest_radius_m)
            for m in (i[rows], j[rows], k[rows]):
                good &= _in_beam(echoes, m, np.arctan2(centre[:, 1] - y[m], centre[:, 0] - x[m]))
            found.append(np.column_stack([centre, radius])[good])
    return np.concatenate(found)


_STRAIGHT_RAD = 0.01  # three places count as on a line when the ways to two of them differ by less
_Circles = list[tuple[np.ndarray, np.ndarray]]  # centres from the first place (m, 2) and radii (m,), NaN for none


def _circles_off_a_line(
    to_j: np.ndarray, to_k: np.ndarray, r_i: np.ndarray, r_j: np.ndarray, r_k: np.ndarray
) -> _Circles:
    """|c - p| = R + r for three p: differences are linear in c and r, c = a + b r; the first equation then is a
    quadratic in r.
    """
    matrix = 2 * np.stack([to_j, to_k], axis=1)
    constant = np.stack([(to**2).sum(axis=1) - r_m**2 + r_i**2 for to, r_m in ((to_j, r_j), (to_k, r_k))], axis=1)
    linear = 2 * np.stack([r_i - r_j, r_i - r_k], axis=1)
    a = np.linalg.solve(matrix, constant[..., None])[..., 0]
    b = np.linalg.solve(matrix, linear[..., None])[..., 0]
    qa, qb, qc = (b**2).sum(axis=1) - 1, (a * b).sum(axis=1) - r_i, (a**2).sum(axis=1) - r_i**2
    root = np.sqrt(np.where(qb**2 >= qa * qc, qb**2 - qa * qc, np.nan))
    radii = [(-qb + sign * root) / np.where(np.abs(qa) < 1e-12, np.nan, qa) for sign in (1, -1)]
    return [(a + b * radius[:, None], radius) for radius in radii]


def _circles_beside_a_line(
    to_j: np.ndarray, to_k: np.ndarray, r_i: np.ndarray, r_j: np.ndarray, r_k: np.ndarray
) -> _Circles:
    """Three places on a line: the differences 2 s a + 2 (R - R_i) r = s^2 - R^2 + R_i^2, s and a along it, give a, r;
    the first equation how far off the line the centre is; on which side, the beams must tell.
    """
    along = to_j / np.hypot(*to_j.T)[:, None]
    s_j, s_k = np.hypot(*to_j.T), (to_k * along).sum(axis=1)
    c_j, c_k = (s**2 - r_m**2 + r_i**2 for s, r_m in ((s_j, r_j), (s_k, r_k)))
    determinant = 2 * (s_j * (r_k - r_i) - s_k * (r_j - r_i))
    determinant = np.where(np.abs(determinant) < 1e-12, np.nan, determinant)
    a = (c_j * (r_k - r_i) - c_k * (r_j - r_i)) / determinant
    radius = (s_j * c_k - s_k * c_j) / determinant
    off = np.sqrt(np.where((r_i + radius) ** 2 >= a**2, (r_i + radius) ** 2 - a**2, np.nan))
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return [(a[:, None] * along + side * off[:, None] * left, radius) for side in (1, -1)]


def _plateau_lines(data: Evidence) -> np.ndarray:
    """Lines through single plateaus, (m, 2): two whose feet are one point have no common tangent but this."""
    at = np.nonzero(np.isfinite(data.direction_sigma_rad))[0]
    return _line_through(data.echoes, at, data.echoes.axis_rad[at])


def _plateau_circles(data: Evidence, cylinder: CylinderConfig, config: RefinementConfig) -> np.ndarray:
    """Circles (x, y, radius) by the ranges and directions of three plateaus from different places, or of two that face
    each other, (m, 3): three ranges alone tell a radius poorly, and directions choose among few triples.
    """
    flat = data.take(np.isfinite(data.direction_sigma_rad))
    pairs = circles_of_pairs(flat, cylinder)[0]
    may = np.zeros((len(flat.echoes), len(flat.echoes)), bool)
    may[pairs[:, 0], pairs[:, 1]] = True
    pair, third = np.nonzero(may[pairs[:, 0]] & may[pairs[:, 1]])
    triples = np.column_stack([pairs[pair], third])[: config.search.most_triples]
    turned = flat.echoes.axis_rad[pairs[:, 0]] - flat.echoes.axis_rad[pairs[:, 1]]
    facing = pairs[np.cos(turned) < np.cos(FACING_RAD)]
    both = [_circles_through(members, flat, cylinder) for members in (triples, facing)]
    return np.concatenate([circle[likely] for circle, likely in both])


def circles_of_pairs(flat: Evidence, cylinder: CylinderConfig) -> tuple[np.ndarray, np.ndarray]:
    """Which plateaus from two places may be of one cylinder, pairs of numbers (m, 2), and the circles, (m, 3)."""
    number = np.arange(len(flat.echoes))
    apart = (flat.place[:, None] != flat.place[None, :]) & (number[:, None] < number[None, :])
    pairs = np.stack(np.nonzero(apart), axis=1)
    circle, likely = _circles_through(pairs, flat, cylinder)
    return pairs[likely], circle[likely]


def _circles_through(members: np.ndarray, flat: Evidence, cylinder: CylinderConfig) -> tuple[np.ndarray, np.ndarray]:
    """Circles of sets of plateaus (m, k), (m, 3), and which are likely, bool (m,).

    Along and across its axis u a plateau says u . (c - p) - r = R and v . (c - p) = 0: least squares in c and r.
    """
    heard = flat.echoes
    axis = np.stack([np.cos(heard.axis_rad), np.sin(heard.axis_rad)], axis=1)
    along = np.column_stack([axis, -np.ones(len(heard))]) / _ALONG_M
    off_m = (heard.range_m + cylinder.smallest_radius_m) * flat.turn_sigma_rad
    across = np.column_stack([-axis[:, 1], axis[:, 0], np.zeros(len(heard))]) / off_m[:, None]
    start = np.stack([heard.x_m, heard.y_m, -heard.range_m], axis=1)
    said = np.stack([(along * start).sum(axis=1), (across * start).sum(axis=1)], axis=1)
    rows = np.stack([along, across], axis=1)
    matrix = np.einsum("nki,nkj->nij", rows, rows)[members].sum(axis=1) + 1e-3 * np.eye(3)
    wanted = np.einsum("nki,nk->ni", rows, said)[members].sum(axis=1)
    circle = np.linalg.solve(matrix, wanted[..., None])[..., 0]
    left = (said**2).sum(axis=1)[members].sum(axis=1) - (circle * wanted).sum(axis=1)
    spread = np.sqrt(np.linalg.inv(matrix)[:, 2, 2])
    sized = circle[:, 2] >= cylinder.smallest_radius_m - 2 * spread
    return circle, sized & (circle[:, 2] <= cylinder.largest_radius_m + 2 * spread) & (left < _LIKELY_SQUARE)


_ALONG_M = 0.005  # of a plateau's range for a start
_LIKELY_SQUARE = 20.0  # of the squared normalised errors of two or three plateaus that are of one cylinder


def _contact_lines(echoes: Echoes, found: Contacts) -> np.ndarray:
    chosen = np.nonzero(found.kind == Kind.WALL)[0]
    return _line_through(echoes, chosen, found.direction_rad[chosen])


def _contact_spots(echoes: Echoes, found: Contacts) -> np.ndarray:
    at = np.nonzero(found.kind == Kind.CORNER)[0]
    return _foot(echoes, at, found.direction_rad[at])


def _contact_circles(echoes: Echoes, found: Contacts, cylinder: CylinderConfig) -> np.ndarray:
    at = np.nonzero(found.kind == Kind.CYLINDER)[0]
    direction, away = found.direction_rad[at], 1 / found.curvature_per_m[at]
    x, y = echoes.x_m[at] + away * np.cos(direction), echoes.y_m[at] + away * np.sin(direction)
    radius = away - echoes.range_m[at]
    good = (radius >= cylinder.smallest_radius_m) & (radius <= cylinder.largest_radius_m)
    return np.stack([x, y, radius], axis=1)[good]


def _line_through(echoes: Echoes, at: np.ndarray, direction: np.ndarray) -> np.ndarray:
    rho = echoes.x_m[at] * np.cos(direction) + echoes.y_m[at] * np.sin(direction) + echoes.range_m[at]
    return np.stack([wrapped(direction), rho], axis=1)


def _foot(echoes: Echoes, at: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Where the echoes ``at`` touched what lies in ``direction``, (m, 2)."""
    r = echoes.range_m[at]
    return np.stack([echoes.x_m[at] + r * np.cos(direction), echoes.y_m[at] + r * np.sin(direction)], axis=1)


def _in_beam(echoes: Echoes, at: np.ndarray, direction: np.ndarray) -> np.ndarray:
    return np.abs(wrapped(direction - echoes.axis_rad[at])) <= echoes.half_beam_rad[at]


def _line_gains(lines: np.ndarray, data: Evidence, config: RefinementConfig) -> np.ndarray:
    theta, rho = lines[:, :1].astype(np.float32), lines[:, 1:].astype(np.float32)
    x, y, r, axis = (
        a.astype(np.float32) for a in (data.echoes.x_m, data.echoes.y_m, data.echoes.range_m, data.echoes.axis_rad)
    )
    predicted = rho - np.cos(theta) * x - np.sin(theta) * y
    return _gains(predicted, np.broadcast_to(theta, predicted.shape), axis, r, data, config)


def _round_gains(centres: np.ndarray, radius: np.ndarray, data: Evidence, config: RefinementConfig) -> np.ndarray:
    dx = centres[:, :1].astype(np.float32) - data.echoes.x_m.astype(np.float32)
    dy = centres[:, 1:].astype(np.float32) - data.echoes.y_m.astype(np.float32)
    predicted = np.hypot(dx, dy) - radius[:, None].astype(np.float32)
    axis = data.echoes.axis_rad.astype(np.float32)
    return _gains(predicted, np.arctan2(dy, dx), axis, data.echoes.range_m.astype(np.float32), data, config)


def _gains(
    predicted: np.ndarray,
    direction: np.ndarray,
    axis: np.ndarray,
    ranges: np.ndarray,
    data: Evidence,
    config: RefinementConfig,
) -> np.ndarray:
    widest = (data.echoes.half_beam_rad + config.beam.slack_rad).astype(np.float32)
    possible = (np.abs(wrapped(direction - axis)) <= widest) & (predicted > 0)
    # A candidate from two or three echoes is itself uncertain, so it is weighed at twice the spread.
    sigma = 2 * data.sigma_m.astype(np.float32)
    own = 2 * data.own_sigma_m.astype(np.float32)
    most = np.log(data.span_m / (own * np.sqrt(2 * np.pi, dtype=np.float32))) - data.lone_nats.astype(np.float32)
    gain = most - 0.5 * ((ranges - predicted) / sigma) ** 2
    if np.isfinite(data.direction_sigma_rad).any():
        gain = gain + data.direction_gain(direction).astype(np.float32)
    return np.where(possible, np.maximum(gain, 0), 0)
