"""Fusion rules as sums: what a rule must keep of the readings of a cell, so that they come and go one by one in any
order.

PCR rules are not associative, so beliefs already fused can't be fused on. But with 1/S = integral of exp(-S t) over
t > 0 the 3^s products of s readings factorise: their sum becomes an integral over products of one factor per reading,
and logarithms of products add up. PCR6+ (Dezert, Dambreville, Smarandache, JAIF 16(1), 2021) shares all products:

    m(occupied) = integral of prod_j G_j(t) * sum_i o_i^2 exp(-t o_i) / G_i(t)
    G_j(t) = o_j exp(-t o_j) + f_j exp(-t f_j) + u_j

and m(free) likewise with f_i. PCR6 (Martin & Osswald 2006) counts the unknown too, u_j exp(-t u_j), and shares the
products in conflict alone: those of all three sets, less those without free, less those without occupied, but for
those that are in both. What is shared is divided in the ratio of the integrals, so that what the nodes miss where S is
large, they miss alike.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from noctule_mapper.fusion.quadrature import nodes

StreamedRule = Literal["pcr6+", "pcr6", "pcr2", "dempster", "dsmc"]
NODES = 32  # with these a fused belief errs by less than 1e-6
_LEAST_MASS = 1e-300  # stands for zero under a logarithm and below a fraction bar


@dataclass(frozen=True)
class Stream:
    """A rule as sums: ``terms`` of single beliefs (..., 3) are (..., width) and are added and subtracted; ``belief``
    makes the fused (..., 3) of such a sum.
    """

    terms: Callable[[np.ndarray], np.ndarray]
    belief: Callable[[np.ndarray], np.ndarray]


def stream(rule: StreamedRule, count: int = NODES) -> Stream:
    """The rule's sums, the integrals of PCR6 and PCR6+ at ``count`` nodes (ValueError for a count not in the table)."""
    t, w = nodes(count)
    streams = {
        "pcr6+": Stream(partial(_pcr6_plus_terms, t), partial(_pcr6_plus_belief, w)),
        "pcr6": Stream(partial(_pcr6_terms, t), partial(_pcr6_belief, t, w)),
        "pcr2": Stream(_pcr2_terms, _pcr2_belief),
        "dempster": Stream(_agreed_terms, _dempster_belief),
        "dsmc": Stream(_agreed_terms, _agreed),
    }
    return streams[rule]


def _log(values: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(values, _LEAST_MASS))


def _pcr6_plus_terms(t: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """At each node log G, o^2 exp(-t o) / G and f^2 exp(-t f) / G; and log u."""
    occupied, free = (_at_nodes(t, masses[..., k, None]) for k in (0, 1))
    log_unknown = _log(masses[..., 2:])
    log_g = np.logaddexp(np.logaddexp(occupied, free), log_unknown)
    shares = (np.exp(_log(masses[..., k, None]) + one - log_g) for k, one in ((0, occupied), (1, free)))
    return np.concatenate([log_g, *shares, log_unknown], axis=-1)


def _pcr6_plus_belief(w: np.ndarray, sums: np.ndarray) -> np.ndarray:
    log_g, occupied, free = (sums[..., k * len(w) : (k + 1) * len(w)] for k in range(3))
    weight = w * np.exp(log_g - log_g.max(axis=-1, keepdims=True))
    # Evidence taken out again leaves rounding errors of either sign: no integral is below 0, no mass above 1.
    occupied, free = (np.maximum((weight * share).sum(axis=-1), 0) for share in (occupied, free))
    unknown = np.minimum(np.exp(sums[..., -1]), 1)
    occupied = (1 - unknown) * occupied / np.maximum(occupied + free, _LEAST_MASS)
    return np.stack([occupied, 1 - occupied - unknown, unknown], axis=-1)


def _at_nodes(t: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """log(m exp(-t m)), (..., nodes)."""
    return _log(mass) - t * mass


def _pcr6_terms(t: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """At each node the logarithms of G, of G without free and of G without occupied, m^2 exp(-t m) over each of those
    that hold m; then u and the terms of what all agree on.
    """
    single = [_at_nodes(t, masses[..., k, None]) for k in range(3)]
    not_free, not_occupied = np.logaddexp(single[0], single[2]), np.logaddexp(single[1], single[2])
    log_g = np.logaddexp(single[0], not_occupied)
    held_by = ((log_g, (0, 1, 2)), (not_free, (0, 2)), (not_occupied, (1, 2)))
    shares = [np.exp(_log(masses[..., k, None]) + single[k] - log) for log, sets in held_by for k in sets]
    return np.concatenate([log_g, not_free, not_occupied, *shares, masses[..., 2:], _agreed_terms(masses)], axis=-1)


def _pcr6_belief(t: np.ndarray, w: np.ndarray, sums: np.ndarray) -> np.ndarray:
    parts = np.split(sums[..., : 10 * len(t)], 10, axis=-1)
    total_unknown, agreed = sums[..., 10 * len(t), None], _agreed(sums[..., -3:])
    scale = parts[0].max(axis=-1, keepdims=True)
    everything, not_free, not_occupied = (np.exp(log - scale) for log in parts[:3])
    neither = np.exp(sums[..., -1:] - t * total_unknown - scale)
    conflicting = (
        everything * parts[3] - not_free * parts[6],
        everything * parts[4] - not_occupied * parts[8],
        everything * parts[5] - not_free * parts[7] - not_occupied * parts[9] + neither * total_unknown,
    )
    shares = np.stack([np.maximum((w * one).sum(axis=-1), 0) for one in conflicting], axis=-1)
    conflict = np.maximum(1 - agreed.sum(axis=-1, keepdims=True), 0)
    return agreed + conflict * shares / np.maximum(shares.sum(axis=-1, keepdims=True), _LEAST_MASS)


def _agreed_terms(masses: np.ndarray) -> np.ndarray:
    """log(o + u), log(f + u), log u: their sums are the products of the conjunctive rule."""
    occupied, free, unknown = np.moveaxis(masses, -1, 0)
    return np.stack([_log(occupied + unknown), _log(free + unknown), _log(unknown)], axis=-1)


def _agreed(sums: np.ndarray) -> np.ndarray:
    """The classic DSm rule (Smarandache & Dezert, cs/0408064, on the free DSm model): what all agree on; what is
    missing to 1 is the mass of occupied-and-free.
    """
    not_free, not_occupied, unknown = np.exp(np.minimum(np.moveaxis(sums, -1, 0), 0))
    return np.stack([np.maximum(not_free - unknown, 0), np.maximum(not_occupied - unknown, 0), unknown], axis=-1)


def _dempster_belief(sums: np.ndarray) -> np.ndarray:
    """What all agree on, over its sum; of many readings both may be tiny, hence the scale."""
    agreed = _agreed(sums - sums.max(axis=-1, keepdims=True))
    return agreed / agreed.sum(axis=-1, keepdims=True)


def _pcr2_terms(masses: np.ndarray) -> np.ndarray:
    return np.concatenate([masses[..., :2], _agreed_terms(masses)], axis=-1)


def _pcr2_belief(sums: np.ndarray) -> np.ndarray:
    """Eq. 3-4 of Liu et al. 2019 (there called PCR6): one pot of conflict, shared by the column sums of occupied and
    free.
    """
    column, agreed = np.maximum(sums[..., :2], 0), _agreed(sums[..., 2:])
    conflict = np.maximum(1 - agreed.sum(axis=-1, keepdims=True), 0)
    agreed[..., :2] += conflict * column / np.maximum(column.sum(axis=-1, keepdims=True), _LEAST_MASS)
    return agreed
