"""The tangent circle of each reading and its supporting neighbours, and what its radius says: wall, cylinder or corner.

Liu et al. 2019, Section II.B and Fig. 2, for positions anywhere. A circle of radius r that reading i touches in
direction n at the range h is touched by reading j, D = p_j - p_i away, at the range

    R_j = h + (s |D|^2 - 2 n . D) / (1 + q),   q^2 = 1 - 2 s n . D + s^2 |D|^2,   s = 1 / (r + h)

for a wall (s = 0), a cylinder and a corner (s = 1 / h) alike. Direction, range and curvature are the least-squares fit
to the range of i and to those of the readings that agree with it, with a covariance. A wall or a corner is the same fit
with s held: by as much as the sum of squares rises, the circle's radius is off infinity or off zero in its own sigma.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from noctule_mapper.config import ContactConfig
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.readings import arrays
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.pairs import near_pairs

_AT_ONCE = 2000  # readings fitted together, which bounds the memory of their pairs
_TOLERANCES_M = (0.04, 0.02, 0.01, 0.0, 0.0)  # beyond support_sigmas, step by step: the votes' bins are coarse
_FARTHEST_M = 0.15  # from the votes' circle, beyond support_sigmas
_LONGEST_STEP_RAD = 0.1
_LEAST_SUPPORTERS = 2  # three readings determine a circle

_Held = Literal["nothing", "no curvature", "no radius"]
_HELD: tuple[_Held, ...] = ("nothing", "no curvature", "no radius")


@dataclass(frozen=True)
class TangentCircles:
    """Arrays (n,): what each reading touches; kind NONE where too few others touch it too, or it bends the wrong
    way.
    """

    direction_rad: np.ndarray  # from the sensor to the contact
    direction_sigma_rad: np.ndarray
    radius_m: np.ndarray  # of the circle that is left free; infinite where it is flat or hollow, negative past a point
    radius_sigma_m: np.ndarray
    kind: np.ndarray
    supporters: np.ndarray  # other readings that touch it

    take = arrays.take


@dataclass(frozen=True)
class _Pairs:
    """A reading and a neighbour, arrays (p,): the number of the reading, and the neighbour as the reading sees it."""

    reading: np.ndarray
    dx_m: np.ndarray
    dy_m: np.ndarray
    range_m: np.ndarray
    axis_rad: np.ndarray
    widest_rad: np.ndarray  # off the axis
    sigma_m: np.ndarray
    gate_m: np.ndarray  # a neighbour that touches the circle misses it by less

    take = arrays.take


@dataclass(frozen=True)
class _Fit:
    """(direction_rad, range_m, curvature_per_m), (n, 3), their covariance (n, 3, 3), supporters and gain (n,), in
    squared sigmas.
    """

    circle: np.ndarray
    covariance: np.ndarray
    supporters: np.ndarray
    gain: np.ndarray


def tangent_circles(echoes: Echoes, others: Echoes, found: Contacts, config: ContactConfig) -> TangentCircles:
    """The tangent circles of ``echoes`` (n,) and their neighbours among ``others`` (m,), sought about the contacts
    ``found`` (n,).
    """
    parts = []
    for chosen in np.array_split(np.arange(len(echoes)), len(echoes) // _AT_ONCE + 1):
        some, near = echoes.take(chosen), found.take(chosen)
        pairs = _hopeful(_pairs(some, others, near, config), some, near)
        free, wall, corner = (_fit(some, near, pairs, held) for held in _HELD)
        parts.append(_judged(free, wall, corner, near.kind != Kind.NONE, config))
    return arrays.join(parts)


def _pairs(echoes: Echoes, others: Echoes, found: Contacts, config: ContactConfig) -> _Pairs:
    """Readings with a contact, and those near enough to share it."""
    i, j, _ = near_pairs(echoes, others, config.shortest_baseline_m, config.longest_baseline_m)
    kept = found.kind[i] != Kind.NONE
    i, j = i[kept], j[kept]
    sigma_m = np.hypot(others.sigma_m, others.sigma_position_m)[j]
    own_m = np.hypot(echoes.sigma_m, echoes.sigma_position_m)[i]
    return _Pairs(
        reading=i,
        dx_m=others.x_m[j] - echoes.x_m[i],
        dy_m=others.y_m[j] - echoes.y_m[i],
        range_m=others.range_m[j],
        axis_rad=others.axis_rad[j],
        widest_rad=others.half_beam_rad[j] + config.beam_slack_rad,
        sigma_m=sigma_m,
        gate_m=config.support_sigmas * np.hypot(sigma_m, own_m),
    )


def _hopeful(pairs: _Pairs, echoes: Echoes, found: Contacts) -> _Pairs:
    """The pairs that a fit can come to: where many sweeps were made close by, few of all."""
    wide = replace(pairs, widest_rad=2 * pairs.widest_rad)
    near = np.zeros(len(pairs.reading), bool)
    for held in _HELD:
        residual, _, shared = _seen(_start(echoes, found, held), wide)
        near |= shared & (np.abs(residual) < pairs.gate_m + _FARTHEST_M)
    return pairs.take(near)


def _fit(echoes: Echoes, found: Contacts, pairs: _Pairs, held: _Held) -> _Fit:
    """Least squares among ever closer supporters; what is ``held`` of the curvature stays so."""
    n = len(echoes)
    circle = _start(echoes, found, held)
    covariance = np.zeros((n, 3, 3))
    own_variance = echoes.sigma_m**2 + echoes.sigma_position_m**2
    for tolerance_m in _TOLERANCES_M:
        residual, slopes, shared = _seen(circle, pairs)
        off = residual / (pairs.gate_m + tolerance_m)
        taper = (1 - off**2) ** 2 if tolerance_m else 1.0
        weight = np.where(shared & (np.abs(off) < 1), taper, 0.0) / pairs.sigma_m**2
        normal, right = _normal_equations(weight, residual, slopes, pairs.reading, n)
        normal[:, 1, 1] += 1 / own_variance
        right[:, 1] += (echoes.range_m - circle[:, 1]) / own_variance
        # What few neighbours leave open stays within the beam and between wall and corner.
        normal[:, 0, 0] += 1 / echoes.half_beam_rad**2
        normal[:, 2, 2] += echoes.range_m**2
        free = _free_parameters(circle, held)
        turned = free.transpose(0, 2, 1)
        covariance = free @ np.linalg.inv(turned @ normal @ free) @ turned
        step = (covariance @ right[..., None])[..., 0]
        longest = np.stack([np.full(n, _LONGEST_STEP_RAD), echoes.range_m / 2, 0.5 / echoes.range_m], axis=1)
        circle = _with_curvature(circle + np.clip(step, -longest, longest), held)
    residual, _, shared = _seen(circle, pairs)
    touching = shared & (np.abs(residual) < pairs.gate_m)
    gain = np.where(touching, (pairs.gate_m**2 - residual**2) / pairs.sigma_m**2, 0)
    own = (echoes.range_m - circle[:, 1]) ** 2 / own_variance
    supporters = np.bincount(pairs.reading, touching, n).astype(int)
    return _Fit(circle, covariance, supporters, np.bincount(pairs.reading, gain, n) - own)


def _start(echoes: Echoes, found: Contacts, held: _Held) -> np.ndarray:
    """The circles of the votes, (n, 3)."""
    return _with_curvature(np.stack([found.direction_rad, echoes.range_m, found.curvature_per_m], axis=1), held)


def _with_curvature(circle: np.ndarray, held: _Held) -> np.ndarray:
    """``circle``, (n, 3), with the curvature of a wall or of a point at its range."""
    curvature = {"nothing": circle[:, 2], "no curvature": np.zeros(len(circle)), "no radius": 1 / circle[:, 1]}[held]
    return np.column_stack([circle[:, :2], curvature])


def _free_parameters(circle: np.ndarray, held: _Held) -> np.ndarray:
    """Derivatives of (direction, range, curvature) by the parameters that are free, (n, 3, 2 or 3)."""
    free = np.tile(np.eye(3), (len(circle), 1, 1))
    if held == "nothing":
        return free
    if held == "no radius":
        free[:, 2, 1] = -1 / circle[:, 1] ** 2
    return free[:, :, :2]


def _seen(circle: np.ndarray, pairs: _Pairs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each pair the neighbour's residual (p,), the slopes of its range (p, 3), and whether its beam holds the
    contact (p,).
    """
    direction, h, s = circle[pairs.reading].T
    nx, ny, dx, dy = np.cos(direction), np.sin(direction), pairs.dx_m, pairs.dy_m
    ahead, aside, square = nx * dx + ny * dy, nx * dy - ny * dx, dx * dx + dy * dy
    q = np.sqrt(np.maximum(1 - 2 * s * ahead + s * s * square, 1e-12))
    residual = pairs.range_m - (h + (s * square - 2 * ahead) / (1 + q))
    by_curvature = aside**2 / (q * (q + np.maximum(1 - s * ahead, 1e-6)))
    towards = np.arctan2(ny - s * dy, nx - s * dx)
    shared = np.abs(wrapped(towards - pairs.axis_rad)) <= pairs.widest_rad
    return residual, np.stack([-aside / q, np.ones(len(h)), by_curvature], axis=1), shared


def _normal_equations(
    weight: np.ndarray, residual: np.ndarray, slopes: np.ndarray, reading: np.ndarray, n: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sums over each reading's pairs: matrices (n, 3, 3) and right-hand sides (n, 3)."""
    normal, right = np.zeros((n, 3, 3)), np.zeros((n, 3))
    for a in range(3):
        weighed = weight * slopes[:, a]
        right[:, a] = np.bincount(reading, weighed * residual, n)
        for b in range(a, 3):
            normal[:, a, b] = normal[:, b, a] = np.bincount(reading, weighed * slopes[:, b], n)
    return normal, right


def _judged(free: _Fit, wall: _Fit, corner: _Fit, heard: np.ndarray, config: ContactConfig) -> TangentCircles:
    """The simplest kind within ``kind_sigmas`` of the best circle: of wall and corner the likelier, else a
    cylinder.
    """
    rise = np.stack([free.gain - wall.gain, free.gain - corner.gain])
    simple = np.where(rise[0] <= rise[1], Kind.WALL, Kind.CORNER)
    kind = np.where(rise.min(axis=0) <= config.kind_sigmas**2, simple, Kind.CYLINDER)
    h, s = free.circle[:, 1], free.circle[:, 2]
    bent = np.where(s > 0, s, np.nan)
    radius_m = np.where(s > 0, 1 / bent - h, np.inf)
    slope = np.stack([np.zeros_like(s), -np.ones_like(s), -1 / bent**2], axis=1)
    radius_variance = np.einsum("na,nab,nb->n", slope, free.covariance, slope)
    which = np.select([kind == Kind.WALL, kind == Kind.CORNER], [1, 2], 0)
    row = np.arange(len(which))
    supporters = np.stack([free.supporters, wall.supporters, corner.supporters])[which, row]
    round_ = (radius_m > 0) & np.isfinite(radius_m)
    proven = heard & (supporters >= _LEAST_SUPPORTERS) & ((kind != Kind.CYLINDER) | round_)
    return TangentCircles(
        direction_rad=np.stack([one.circle[:, 0] for one in (free, wall, corner)])[which, row],
        direction_sigma_rad=np.sqrt(np.stack([one.covariance[:, 0, 0] for one in (free, wall, corner)])[which, row]),
        radius_m=radius_m,
        radius_sigma_m=np.sqrt(radius_variance),
        kind=np.where(proven, kind, Kind.NONE),
        supporters=supporters,
    )
