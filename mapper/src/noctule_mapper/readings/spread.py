"""The spread of a range: the sensor's own, and where nobody has calibrated it what the survey itself tells.

Three readings of one wall from near-collinear places obey Eq. 1; by how much they fail it tells sigma (Section V.A).
Triples on cylinders, in corners or on different reflectors fail it by anything: the estimate is the narrow part of a
mixture of a Gaussian and a uniform. Neighbours share the slow part of a moving sensor's pose error, so triples are
taken near and far, and the widest of their spreads counts.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from noctule_mapper.config import MapperConfig, NoiseConfig
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.collinear import deviation_scale, reference_range_m
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import evidence, newest_of_each_beam
from noctule_mapper.readings.pairs import may_share, offsets

_MOST_TRIPLES = 600
_MOST_NEIGHBOURS = 2000  # echoes among which a triple's other two are sought
_EM_STEPS = 50


def estimate_sigma_m(echoes: Echoes, config: NoiseConfig) -> float:
    """Standard deviation of a range; the assumed one where there are too few triples to tell."""
    edges = config.baseline_edges_m
    spreads = [
        sigma_m
        for shortest_m, longest_m in pairwise(edges)
        for sigma_m, count in [_narrow_part(scaled_deviations_m(echoes, shortest_m, longest_m), config)]
        if count >= config.least_triples
    ]
    if not spreads:
        return config.assumed_sigma_m
    return float(np.clip(max(spreads), config.least_sigma_m, config.most_sigma_m))


def scaled_deviations_m(echoes: Echoes, shortest_m: float, longest_m: float) -> np.ndarray:
    """R2d - R2 (Eq. 1) of echoes between the nearest ones before and behind, divided so that its sigma is a range's;
    (triples,).

    The neighbours are ``shortest_m`` to ``longest_m`` away. Of many echoes the last few hundred stand for all, their
    neighbours are sought among the last few thousand: time and memory are bounded.
    """
    echoes = echoes.take(np.arange(len(echoes))[-_MOST_NEIGHBOURS:])
    middle = np.arange(len(echoes))[-_MOST_TRIPLES:]
    between = offsets(echoes, middle[:, None], echoes, np.arange(len(echoes)))
    dx, dy, baseline = between.dx_m, between.dy_m, between.baseline_m
    turned = wrapped(echoes.axis_rad[None, :] - echoes.axis_rad[middle, None])
    alike = may_share(baseline, between.longer_m, shortest_m, longest_m)
    alike &= np.abs(turned) < echoes.half_beam_rad[middle, None]
    first = np.where(alike, baseline, np.inf).argmin(axis=1)
    rows = np.arange(len(middle))
    across = dx * dx[rows, first][:, None] + dy * dy[rows, first][:, None]
    opposite = alike & (across < -0.95 * baseline * baseline[rows, first][:, None])
    third = np.where(opposite, baseline, np.inf).argmin(axis=1)
    found = alike[rows, first] & opposite[rows, third]
    rows, first, third, middle = rows[found], first[found], third[found], middle[found]
    d12_m = baseline[rows, first]
    d13_m = d12_m + baseline[rows, third]
    reference_m = reference_range_m(echoes.range_m[first], echoes.range_m[third], d12_m, d13_m)
    return (reference_m - echoes.range_m[middle]) / deviation_scale(d12_m, d13_m)


def _narrow_part(deviation_m: np.ndarray, config: NoiseConfig) -> tuple[float, float]:
    """Sigma of the Gaussian in a mixture with a uniform over +- the widest deviation, and how many deviations are of
    it.
    """
    widest = config.widest_deviation_m
    inside = deviation_m[np.abs(deviation_m) < widest]
    if not len(inside):
        return np.nan, 0.0
    sigma, share = float(np.median(np.abs(inside))) + 1e-4, 0.7
    for _ in range(_EM_STEPS):
        narrow = share * np.exp(-0.5 * (inside / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
        weight = narrow / (narrow + (1 - share) / (2 * widest))
        sigma, share = float(np.sqrt((weight * inside**2).sum() / weight.sum())) + 1e-6, float(weight.mean())
    return sigma, float(weight.sum())


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
