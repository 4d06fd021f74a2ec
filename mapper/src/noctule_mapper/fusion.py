"""Belief fusion on the frame {occupied, free}: many readings of one cell into one belief.

A belief is (occupied, free, unknown), summing to one. PCR6+ (Dezert, Dambreville, Smarandache, JAIF 16(1), 2021) is the
default: exact for any number of readings in any order, and one pass over them. With 1/S = integral of exp(-S t) over t
> 0, its sum over all 3^s ways that s readings can disagree becomes

    m(occupied) = integral of prod_j G_j(t) * sum_i o_i^2 exp(-t o_i) / G_i(t)
    G_j(t) = o_j exp(-t o_j) + f_j exp(-t f_j) + u_j

and m(free) likewise with f_i, so all that must be kept of the readings are three sums per node of the integral: they
add up, and a reading can be taken out again. What is known, 1 - prod_j u_j, is divided in the ratio of the two
integrals: what the nodes miss where S is large, they miss of both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Literal, Self, get_args

import numpy as np

from noctule_mapper.quadrature import nodes

Rule = Literal["pcr6+", "pcr6", "pcr5", "pcr2", "dempster"]
NODES = 32  # errs by less than 1e-6
_MOST_SUMMED_SOURCES = 10  # PCR5 and PCR6 are summed term by term: 3^s terms
_LEAST_MASS = 1e-300  # stands for zero under a logarithm and below a fraction bar
_LEAST_SINGLE_MASS = 1e-30  # the same in single precision


@dataclass(frozen=True)
class Evidence:
    """What PCR6+ keeps of any number of readings; evidence is added and subtracted, and nothing depends on the order.

    (nodes, ...): ``log_product``, the sum of log G; ``occupied_share``, that of o^2 exp(-t o) / G; ``free_share``, that
    of f^2 exp(-t f) / G. (...): ``log_unknown``, the sum of log u.
    """

    log_product: np.ndarray
    occupied_share: np.ndarray
    free_share: np.ndarray
    log_unknown: np.ndarray

    def __add__(self, other: Self) -> "Evidence":
        return Evidence(
            self.log_product + other.log_product,
            self.occupied_share + other.occupied_share,
            self.free_share + other.free_share,
            self.log_unknown + other.log_unknown,
        )

    def __sub__(self, other: Self) -> "Evidence":
        return Evidence(
            self.log_product - other.log_product,
            self.occupied_share - other.occupied_share,
            self.free_share - other.free_share,
            self.log_unknown - other.log_unknown,
        )

    def belief(self) -> np.ndarray:
        """The fused belief, (..., 3)."""
        weights = nodes(len(self.log_product))[1].astype(self.log_product.dtype)
        product = np.exp(self.log_product - self.log_product.max(axis=0))
        # Evidence taken out again leaves rounding errors of either sign: no integral is below 0, no mass above 1.
        occupied, free = (
            np.maximum(np.tensordot(weights, product * share, axes=1), 0)
            for share in (self.occupied_share, self.free_share)
        )
        unknown = np.minimum(np.exp(self.log_unknown), 1)
        occupied = (1 - unknown) * occupied / np.maximum(occupied + free, _least_mass(weights.dtype))
        return np.stack([occupied, 1 - occupied - unknown, unknown], axis=-1)


def evidence(masses: np.ndarray, count: int = NODES) -> Evidence:
    """Evidence of single readings, masses (..., 3), at ``count`` nodes, in the masses' own precision."""
    t = nodes(count)[0].astype(masses.dtype).reshape(-1, *[1] * (masses.ndim - 1))
    log_o, log_f, log_u = (np.log(np.maximum(masses[..., k], _least_mass(masses.dtype))) for k in range(3))
    occupied_term, free_term = log_o - t * masses[..., 0], log_f - t * masses[..., 1]
    log_g = np.logaddexp(np.logaddexp(occupied_term, free_term), log_u)
    return Evidence(log_g, np.exp(log_o + occupied_term - log_g), np.exp(log_f + free_term - log_g), log_u)


def _least_mass(dtype: np.dtype) -> np.ndarray:
    return np.asarray(_LEAST_MASS if dtype == np.float64 else _LEAST_SINGLE_MASS, dtype)


def fuse(masses: np.ndarray, rule: Rule = "pcr6+") -> np.ndarray:
    """Fuse masses (sources, ..., 3) of occupied, free, unknown into (..., 3).

    Raises ValueError for an unknown rule, masses that are no beliefs, and PCR5 or PCR6 over more than ten sources.
    """
    masses = np.asarray(masses, dtype=float)
    if masses.ndim < 2 or masses.shape[-1] != 3 or not len(masses):
        raise ValueError(f"masses have the shape {masses.shape}; give (sources, ..., 3) with at least one source")
    if np.any(masses < 0) or not np.allclose(masses.sum(axis=-1), 1, atol=1e-6):
        raise ValueError("every belief must be three masses of at least 0 that sum to 1")
    if rule not in _RULES:
        raise ValueError(f"no fusion rule {rule!r}; there are {', '.join(get_args(Rule))}")
    return _RULES[rule](masses)


def _conjunctive(masses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What all sources agree on: occupied, free, unknown; the rest of 1 is conflict."""
    occupied, free, unknown = np.moveaxis(masses, -1, 0)
    nothing = unknown.prod(axis=0)
    return (occupied + unknown).prod(axis=0) - nothing, (free + unknown).prod(axis=0) - nothing, nothing


def _dempster(masses: np.ndarray) -> np.ndarray:
    agreed = np.stack(_conjunctive(masses), axis=-1)
    total = agreed.sum(axis=-1, keepdims=True)
    if np.any(total <= 0):
        raise ValueError("Dempster's rule is not defined where sources contradict each other wholly; use a PCR rule")
    return agreed / total


def _pcr2(masses: np.ndarray) -> np.ndarray:
    """Eq. 3-4 of Liu et al. 2019 (there called PCR6): one pot of conflict, shared by the column sums of occupied and
    free.
    """
    occupied, free, unknown = _conjunctive(masses)
    column = masses.sum(axis=0)
    involved = np.maximum(column[..., 0] + column[..., 1], _LEAST_MASS)
    conflict = 1 - occupied - free - unknown
    return np.stack(
        [occupied + conflict * column[..., 0] / involved, free + conflict * column[..., 1] / involved, unknown], axis=-1
    )


def _pcr6_plus(masses: np.ndarray) -> np.ndarray:
    single = evidence(masses)
    return Evidence(
        single.log_product.sum(axis=1),
        single.occupied_share.sum(axis=1),
        single.free_share.sum(axis=1),
        single.log_unknown.sum(axis=0),
    ).belief()


def _pcr5(masses: np.ndarray) -> np.ndarray:
    """A conflicting product goes back to its sets in proportion to each set's own product (Smarandache & Dezert,
    cs/0408064).
    """
    return _redistribute(masses, lambda chosen: chosen.prod(axis=0))


def _pcr6(masses: np.ndarray) -> np.ndarray:
    """A conflicting product goes back to its sets in proportion to each set's own sum (Martin & Osswald 2006)."""
    return _redistribute(masses, lambda chosen: chosen.sum(axis=0))


def _redistribute(masses: np.ndarray, worth: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Sum over all 3^s products; one in conflict is shared out by ``worth`` of the masses that chose each set."""
    if len(masses) > _MOST_SUMMED_SOURCES:
        raise ValueError(
            f"PCR5 and PCR6 are summed term by term, so for {_MOST_SUMMED_SOURCES} sources at most; use pcr6+"
        )
    fused = np.stack(_conjunctive(masses), axis=-1)
    for choice in product(range(3), repeat=len(masses)):
        if 0 not in choice or 1 not in choice:
            continue
        chosen = np.stack([masses[source, ..., set_] for source, set_ in enumerate(choice)])
        shares = {set_: worth(chosen[[c == set_ for c in choice]]) for set_ in set(choice)}
        scale = chosen.prod(axis=0) / np.maximum(sum(shares.values()), _LEAST_MASS)
        for set_, share in shares.items():
            fused[..., set_] += scale * share
    return fused


_RULES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "pcr6+": _pcr6_plus,
    "pcr6": _pcr6,
    "pcr5": _pcr5,
    "pcr2": _pcr2,
    "dempster": _dempster,
}
