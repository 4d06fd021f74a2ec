"""Belief fusion on the frame {occupied, free}: what many readings say of one cell, as one belief.

A belief is (occupied, free, unknown), summing to one. ``fuse`` takes beliefs as an array; ``streams`` has the same
rules for readings that come and go.
"""

from typing import get_args

import numpy as np

from noctule.errors import NoctuleError
from noctule_mapper.choices import Rule
from noctule_mapper.fusion.streams import StreamedRule, stream

MOST_PCR5_SOURCES = 10  # PCR5 shares by products of masses, which do not factorise: its 3^s terms are summed
_MOST_TERMS = 3_000_000  # at a time
_LEAST_MASS = 1e-300


class FusionError(NoctuleError, ValueError):
    """Beliefs that can't be fused, or not by this rule."""


def fuse(masses: np.ndarray, rule: Rule = "pcr6+") -> np.ndarray:
    """Fuse masses (sources, ..., 3) of occupied, free, unknown into (..., 3).

    dsmc keeps conflict as the mass of occupied-and-free, so its three masses sum to 1 - ``conflict``.
    Raises FusionError for an unknown rule, masses that are no beliefs, PCR5 over more than ten sources, and Dempster's
    rule where sources are certain of the contrary.
    """
    masses = _beliefs(masses)
    if rule not in get_args(Rule):
        raise FusionError(f"no fusion rule {rule!r}; there are {', '.join(get_args(Rule))}")
    if rule == "pcr5":
        return _pcr5(masses)
    if rule == "dempster" and np.any((masses[..., 0] == 1).any(axis=0) & (masses[..., 1] == 1).any(axis=0)):
        raise FusionError("Dempster's rule is not defined where sources contradict each other wholly; use a PCR rule")
    return _by_sums(masses, rule)


def conflict(masses: np.ndarray) -> np.ndarray:
    """m(occupied and free), (...), of masses (sources, ..., 3): what the sources contradict one another about."""
    return np.maximum(1 - _by_sums(_beliefs(masses), "dsmc").sum(axis=-1), 0)


def _by_sums(masses: np.ndarray, rule: StreamedRule) -> np.ndarray:
    sums = stream(rule)
    return sums.belief(sums.terms(masses).sum(axis=0))


def _beliefs(masses: np.ndarray) -> np.ndarray:
    masses = np.asarray(masses, dtype=float)
    if masses.ndim < 2 or masses.shape[-1] != 3 or not len(masses):
        raise FusionError(f"masses have the shape {masses.shape}; give (sources, ..., 3) with at least one source")
    if np.any(masses < 0) or not np.allclose(masses.sum(axis=-1), 1, atol=1e-6):
        raise FusionError("every belief must be three masses of at least 0 that sum to 1")
    return masses


def _pcr5(masses: np.ndarray) -> np.ndarray:
    """A conflicting product goes back to its sets in proportion to each set's own product (Smarandache & Dezert,
    cs/0408064).
    """
    if len(masses) > MOST_PCR5_SOURCES:
        raise FusionError(
            f"PCR5 has 3^s terms, so it takes {MOST_PCR5_SOURCES} sources at most and not {len(masses)}: use pcr6+"
        )
    cells = masses.reshape(len(masses), -1, 3)
    parts = np.array_split(cells, 1 + cells[0].size * 3 ** len(masses) // _MOST_TERMS, axis=1)
    shares = np.concatenate([_pcr5_shares(part) for part in parts])
    return _by_sums(masses, "dsmc") + shares.reshape(masses.shape[1:])


def _pcr5_shares(masses: np.ndarray) -> np.ndarray:
    """What conflict gives back, (cells, 3), of masses (sources, cells, 3)."""
    products = np.ones((3, masses.shape[1], 1))  # of the masses that chose each set; a column for each way to choose
    chosen = np.zeros((3, 1), bool)
    each = np.eye(3, dtype=bool)[:, :, None]
    for source in masses:
        widened = [products * np.where(set_[..., None], source.T[..., None], 1) for set_ in each]
        products = np.concatenate(widened, axis=-1)
        chosen = np.concatenate([chosen | set_ for set_ in each], axis=-1)
    conflicting = chosen[0] & chosen[1]
    products, chosen = products[..., conflicting], chosen[:, None, conflicting]
    shares = products * chosen
    scale = products.prod(axis=0) / np.maximum(shares.sum(axis=0), _LEAST_MASS)
    return (shares * scale).sum(axis=-1).T
