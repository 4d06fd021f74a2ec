"""The spread of d = R2d - R2 over triples of places, what it says of a range's, and whether it is Gaussian."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from noctule_mapper.calibration.triples import deviations_m, triples
from noctule_mapper.calibration.wall_fit import OFF_WALL_M, Estimate
from noctule_mapper.calibration.wall_readings import CalibrationError, WallReadings

LEAST_DEVIATIONS = 30  # beyond one for each triple; they make sigma good to 13 %
_MOST_TESTED = 5000  # beyond, the p-value of Shapiro and Wilk's test is not to be relied on


@dataclass(frozen=True)
class Spread:
    """``deviation_m`` is d of all repeats of all triples on the wall, (n,), ``mean_d_m`` its mean.

    ``sigma_d_m`` is the spread of d about each triple's own mean, and ``sigma_range_m`` that of the ranges it comes
    from: smaller by 1.22 at equal spacing. ``placement_m`` is by how much the triples' means miss 0 beyond that spread,
    for places and wall are off by about as much; ``placement_p`` is the probability of such means if nothing were off.
    """

    triples: int
    triples_off_wall: int
    spacing_m: float  # between adjacent places of a triple, median
    deviation_m: np.ndarray
    mean_d_m: Estimate
    sigma_d_m: Estimate
    sigma_range_m: Estimate
    placement_m: float
    placement_p: float
    gaussian_d_p: float
    gaussian_range_p: float


def spread(readings: WallReadings) -> Spread:
    """The spread by triples that see one wall. Raises CalibrationError where there are too few."""
    held = [(triple, deviations_m(readings, triple)) for triple in triples(readings)]
    repeated = [(triple, d_m) for triple, d_m in held if len(d_m) >= 2]
    on_wall = [(triple, d_m) for triple, d_m in repeated if abs(d_m.mean()) <= OFF_WALL_M]
    sets_m = [d_m for _, d_m in on_wall]
    _check_enough(len(readings.x_m), sets_m)
    sigma_d_m = _about_means_m(sets_m)
    means_m = np.array([d_m.mean() for d_m in sets_m])
    placement_m, placement_p = _placement(means_m, np.array([len(d_m) for d_m in sets_m]), sigma_d_m.value)
    own_m = np.concatenate([readings.at(place) - readings.at(place).mean() for place in np.unique(readings.place)])
    return Spread(
        triples=len(on_wall),
        triples_off_wall=len(repeated) - len(on_wall),
        spacing_m=float(np.median([triple.d13_m / 2 for triple, _ in on_wall])),
        deviation_m=np.concatenate(sets_m),
        mean_d_m=Estimate(float(np.concatenate(sets_m).mean()), float(means_m.std() / math.sqrt(len(means_m)))),
        sigma_d_m=sigma_d_m,
        sigma_range_m=_about_means_m([d_m / triple.scale for triple, d_m in on_wall]),
        placement_m=placement_m,
        placement_p=placement_p,
        gaussian_d_p=gaussian_p(np.concatenate([d_m - d_m.mean() for d_m in sets_m])),
        gaussian_range_p=gaussian_p(own_m),
    )


def gaussian_p(errors_m: np.ndarray) -> float:
    """Probability of errors (n,) no more Gaussian than these if they were, by Shapiro and Wilk's test.

    Of the usual tests it finds most kinds of other errors most often; of many errors some thousands stand for all.
    """
    from scipy import stats  # takes half a second that the other commands need not wait

    every = -(-len(errors_m) // _MOST_TESTED)
    return float(stats.shapiro(errors_m[::every]).pvalue)


def _about_means_m(sets_m: list[np.ndarray]) -> Estimate:
    """Standard deviation about each set's own mean; its error holds for errors of any kurtosis."""
    off_m = np.concatenate([each - each.mean() for each in sets_m])
    freedom = len(off_m) - len(sets_m)
    variance = float((off_m**2).sum()) / freedom
    if not variance:
        return Estimate(0.0, 0.0)
    kurtosis = float((off_m**4).mean() / (off_m**2).mean() ** 2)
    return Estimate(math.sqrt(variance), math.sqrt(variance * (kurtosis - 1) / (4 * freedom)))


def _placement(means_m: np.ndarray, repeats: np.ndarray, sigma_d_m: float) -> tuple[float, float]:
    """Root mean square of the triples' means beyond what ``sigma_d_m`` explains, and the probability by Fisher's F."""
    if not sigma_d_m:
        return float(np.sqrt((means_m**2).mean())), 1.0
    ratio = float((repeats * means_m**2).mean()) / sigma_d_m**2
    beyond = float((means_m**2 - sigma_d_m**2 / repeats).mean())
    freedom = int(repeats.sum()) - len(repeats)
    return math.sqrt(max(beyond, 0.0)), float(fdtrc(len(means_m), freedom, ratio))


def _check_enough(places: int, sets_m: list[np.ndarray]) -> None:
    freedom = sum(map(len, sets_m)) - len(sets_m)
    if freedom < LEAST_DEVIATIONS:
        raise CalibrationError(
            f"{len(sets_m)} triples of collinear places with {sum(map(len, sets_m))} deviations (from {places} places) "
            f"are too few for a spread: read the wall from groups of three places on a line along it, "
            f"20 cm apart, each at least {LEAST_DEVIATIONS} times"
        )
