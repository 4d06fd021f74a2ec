"""Contacts: where each reading touched its reflector, found with the readings near it.

Two readings with a common reflector have a common tangent circle: of radius infinity on a wall, of its own radius on a
cylinder, of none in a corner or at an edge (Liu et al. 2019, Section II.B, taken from three collinear positions to any
number anywhere). So each other reading votes along a curve in the (direction, curvature) plane of reading i (the
equation of the module tangency), as far as the contact lies inside both beams, and the curves of those that share the
reflector cross in one point.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from noctule_mapper.config import ContactConfig
from noctule_mapper.contacts.tangency import SIDES, direction_rad, other_direction_rad, turn_rad
from noctule_mapper.readings import arrays
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.pairs import may_share, offsets


class Kind(IntEnum):
    """What a contact touched."""

    NONE = 0
    WALL = 1
    CYLINDER = 2
    CORNER = 3


@dataclass(frozen=True)
class Contacts:
    """The contact of each echo, (n,): direction from the sensor, curvature 1 / (r + R), kind (NONE where too few
    agree), votes, and the direction's sigma beside the heading's, finite where a plateau tells it and no vote does.
    """

    direction_rad: np.ndarray
    curvature_per_m: np.ndarray
    kind: np.ndarray
    votes: np.ndarray
    direction_sigma_rad: np.ndarray

    take = arrays.take


def join_contacts(parts: Sequence[Contacts]) -> Contacts:
    """Several sets of contacts as one, in their order."""
    return arrays.join(parts or [_NO_CONTACTS])


_NO_CONTACTS = Contacts(np.zeros(0), np.zeros(0), np.zeros(0, int), np.zeros(0), np.zeros(0))


def votes(echoes: Echoes, others: Echoes, config: ContactConfig) -> np.ndarray:
    """Accumulators of ``echoes``, (n, direction_bins, curvature_bins), with the votes of ``others`` (m,) from other
    sweeps.

    Curvature bin 0 is a wall, the last one a point at the reading's own range; directions run evenly over beam and
    slack.
    """
    relative = np.linspace(0, 1, config.curvature_bins)
    every = offsets(echoes, np.arange(len(echoes))[:, None], others, np.arange(len(others)))
    i, j = np.nonzero(
        may_share(every.baseline_m, every.longer_m, config.shortest_baseline_m, config.longest_baseline_m)
    )
    between = every.take((i, j, np.newaxis))
    curvature = relative / echoes.range_m[i, None]
    turn = turn_rad(between, curvature)
    touching = np.isfinite(turn)
    turn = np.where(touching, turn, 0.0)
    sigma_rad = np.hypot(echoes.sigma_m[i], others.sigma_m[j])[:, None] / (
        between.baseline_m * np.maximum(np.sin(turn), 0.05)
    )
    bin_rad = 2 * (echoes.half_beam_rad[i, None] + config.beam_slack_rad) / config.direction_bins
    weight = 1 / np.sqrt(1 + (sigma_rad / bin_rad) ** 2)
    total = np.zeros((len(echoes), config.direction_bins, config.curvature_bins))
    for side in SIDES:
        direction = direction_rad(between, turn, side)
        other_direction = other_direction_rad(between, direction, curvature)
        shared = touching & (
            np.abs(wrapped(other_direction - others.axis_rad[j, None]))
            <= others.half_beam_rad[j, None] + config.beam_slack_rad
        )
        position = wrapped(direction - echoes.axis_rad[i, None]) / bin_rad + (config.direction_bins - 1) / 2
        lower = np.floor(position).astype(int)
        for bin_, share in ((lower, lower + 1 - position), (lower + 1, position - lower)):
            pair, column = np.nonzero(shared & (bin_ >= 0) & (bin_ < config.direction_bins))
            np.add.at(total, (i[pair], bin_[pair, column], column), (weight * share)[pair, column])
    return total


def contacts(echoes: Echoes, accumulators: np.ndarray, config: ContactConfig) -> Contacts:
    """Read the accumulators, (n, directions, curvatures): the simplest kind that explains nearly all the votes of the
    best circle.

    A wall is simpler than a corner, a corner simpler than a cylinder: it has one radius to choose. What the votes can't
    tell apart, because their baselines are short against the noise, is so left with the simpler kind. As fine as the
    bins are; the module tangent_circle fits the circle about it.
    """
    by_curvature = accumulators.max(axis=1)
    best = by_curvature.max(axis=1)
    wall, corner = (by_curvature[:, k] >= config.simpler_kind_share * best for k in (0, -1))
    column = np.where(wall, 0, np.where(corner, accumulators.shape[2] - 1, by_curvature.argmax(axis=1)))
    kind = np.where(wall, Kind.WALL, np.where(corner, Kind.CORNER, Kind.CYLINDER))
    chosen = np.take_along_axis(accumulators, column[:, None, None], axis=2)[:, :, 0]
    peak = chosen.argmax(axis=1)
    bins = np.arange(chosen.shape[1])
    near = np.where(np.abs(bins - peak[:, None]) <= 1, chosen, 0)
    centre = (near * bins).sum(axis=1) / np.maximum(near.sum(axis=1), 1e-12)
    bin_rad = 2 * (echoes.half_beam_rad + config.beam_slack_rad) / chosen.shape[1]
    count = near.sum(axis=1)
    return Contacts(
        direction_rad=echoes.axis_rad + (centre - (chosen.shape[1] - 1) / 2) * bin_rad,
        curvature_per_m=column / (accumulators.shape[2] - 1) / echoes.range_m,
        kind=np.where(count >= config.least_votes, kind, Kind.NONE),
        votes=count,
        direction_sigma_rad=np.full(len(echoes), np.inf),
    )
