"""Which of the repeated readings are good: not a cycle of the sound late, and not from something else than the wall."""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.calibration.wall_readings import WallReadings

CYCLE_M = 0.0043  # 25 us of a 40 kHz ping, there and back: by so much a range is longer whose first cycle was missed
_ANYWHERE = 1 / 4.0  # density of a range that means nothing, 1/m
_LIKELIHOOD_RATIO = 9.0  # twice its logarithm: three sigmas for one more parameter
_MOST_LATE = 0.2  # a larger share is another noise, not a fault of this one
_TELLING_SIGMAS = 3.0  # a cycle must be so many of a range's, else good readings would be left out as late
_LEAST_SIGMA_M = 1e-6
_STEPS = 500


@dataclass(frozen=True)
class Screening:
    """``good`` is bool (n,); ``late`` and ``elsewhere`` are the counts of the others. ``late_share`` is the mixture's
    estimate; None where a cycle is lost in the spread: late readings then stay and widen it.
    """

    good: np.ndarray
    late_share: float | None
    late: int
    elsewhere: int


def screen(readings: WallReadings) -> Screening:
    """Each reading as the likeliest of three kinds: its place's range with a Gaussian error, the same a cycle late, or
    anything. Late ones are believed in only where they explain the readings much better.
    """
    plain, with_late = _mixture(readings, late=0.0), _mixture(readings, late=0.02)
    gain = 2 * (with_late.log_likelihood - plain.log_likelihood)
    shown = gain > _LIKELIHOOD_RATIO and with_late.shares[1] <= _MOST_LATE
    mixture = with_late if shown and with_late.sigma_m * _TELLING_SIGMAS <= CYCLE_M else plain
    late_share = float(mixture.shares[1]) if mixture.sigma_m * _TELLING_SIGMAS <= CYCLE_M else None
    kind = mixture.kinds.argmax(axis=1)
    return Screening(kind == 0, late_share, int((kind == 1).sum()), int((kind == 2).sum()))


@dataclass(frozen=True)
class _Mixture:
    kinds: np.ndarray  # (n, 3) probabilities: good, late, anything
    shares: np.ndarray  # (3,)
    sigma_m: float
    log_likelihood: float


def _mixture(readings: WallReadings, late: float) -> _Mixture:
    """Expectation-maximisation over each place's range, the common sigma and the shares, from the medians on."""
    place, range_m = readings.place, readings.range_m
    true_m = np.array([np.median(readings.at(number)) for number in range(len(readings.x_m))])
    sigma_m = max(1.4826 * float(np.median(np.abs(range_m - true_m[place]))), _LEAST_SIGMA_M)
    shares = np.array([0.98 - late, late, 0.02])
    before = -np.inf
    for _ in range(_STEPS):
        off_m = range_m - true_m[place]
        errors_m = np.stack([off_m, off_m - CYCLE_M], axis=1)
        density = np.exp(-0.5 * (errors_m / sigma_m) ** 2) / (sigma_m * np.sqrt(2 * np.pi))
        joint = np.column_stack([density, np.full(len(off_m), _ANYWHERE)]) * shares
        total = joint.sum(axis=1)
        kinds = joint / total[:, None]
        log_likelihood = float(np.log(total).sum())
        if log_likelihood - before < 1e-6:
            break
        before = log_likelihood
        shares = kinds.mean(axis=0)
        weight = kinds[:, 0] + kinds[:, 1]
        moved = np.bincount(place, kinds[:, 0] * range_m + kinds[:, 1] * (range_m - CYCLE_M))
        true_m = moved / np.maximum(np.bincount(place, weight), 1e-12)
        spread = float((kinds[:, :2] * errors_m**2).sum() / max(weight.sum(), 1e-12))
        sigma_m = max(np.sqrt(spread), _LEAST_SIGMA_M)
    return _Mixture(kinds, shares, float(sigma_m), log_likelihood)
