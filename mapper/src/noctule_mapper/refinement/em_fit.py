"""The fit by expectation and maximisation: every echo is shared among those who may have made it, and all objects move.

In turn each claim's share is worked out from what its range is worth, and the objects take a step with these shares for
weights. No echo is lost to a hard decision, nor does a far one pull; what the labels leave open is taken off the
information (Louis 1982, Eq. 3.1, claim by claim).

Poses that nobody knows exactly are unknowns of the same steps. The first step takes what they have wrong for the error
of each range, or most echoes would be no object's, and so it moves the poses only part of the way. The next steps allow
for less and less, about half as much each time where poses err by up to 3 cm (graduated non-convexity, Blake and
Zisserman 1987). With nothing allowed from the second step on, many echoes would be lost, and with them what draws the
poses to where they belong.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.corners import Fit, Link
from noctule_mapper.contour.reflectors import Reflector, Spot
from noctule_mapper.readings.evidence import Evidence, direction_weight
from noctule_mapper.refinement.association import Claims, explain
from noctule_mapper.refinement.joint_fit import (
    Normal,
    Shared,
    linearise,
    moved,
    offsets_of,
    placing_nothing,
    rows_of,
    shared_by,
    solve,
)
from noctule_mapper.refinement.pose_errors import Errors, errors_of, held_by, with_sensors_left


@dataclass(frozen=True)
class Settled:
    """The fit, the share of each claim in its echo (claims,), the spread of each range that it went by (n,), what the
    echoes share as fitted, and the normal equations behind the covariance with the errors of the poses.
    """

    fit: Fit
    share: np.ndarray
    range_sigma_m: np.ndarray
    shared: Shared
    normal: Normal
    errors: Errors


@dataclass(frozen=True)
class _Score:
    """Of residuals (claims,): gains in nats, residuals less their late cycles on average, the variance about that."""

    gain: np.ndarray
    mean_m: np.ndarray
    variance_m2: np.ndarray


def settle(
    objects: Sequence[Reflector],
    links: Sequence[Link],
    claims: Claims,
    data: Evidence,
    config: RefinementConfig,
    iterations: int,
    estimate_sigma: bool = False,
    wary: bool = False,
) -> Settled:
    """Fit ``objects`` and, through their walls, ``links`` to the echoes that they claim, in so many ``iterations`` and
    those that uncertain poses need besides.

    With ``estimate_sigma`` the spread of sensors that nobody has calibrated is fitted as well. A ``wary`` fit lets what
    is often misunderstood tell little: points nothing of where fine sweeps were made, directions that are far off
    hardly anything.
    """
    shared, parameters = shared_by(data), int(offsets_of(objects)[-1])
    objects, echo = list(objects), claims.echo
    is_point = np.array([isinstance(one, Spot) for one in objects] + [False] * len(links), bool)[claims.maker]
    unplacing = is_point & data.echoes.is_fine[echo] & wary
    late_share, leverage = config.beam.late_share, 0.0
    for part in _allowed(data, iterations):
        linear = linearise(objects, links, claims.maker, echo, data.echoes)
        rows = placing_nothing(rows_of(linear, echo, data.echoes, shared, parameters), unplacing)
        residual = rows.residual_m
        sigma_m = np.hypot(data.range_sigma_m, part * data.echoes.shared_sigma_m)[echo]
        sigma_rad = np.hypot(data.direction_sigma_rad, part * data.echoes.sigma_heading_rad)[echo]
        anywhere_nats = data.lone_nats[echo] - np.log(data.span_m)
        score = _score(residual, sigma_m, late_share, leverage, anywhere_nats, config)
        share = explain(replace(claims, predicted_m=linear.predicted_m), score.gain, data, config).share
        turns = share / data.direction_sigma_rad[echo] ** 2
        if wary:
            turns = turns * direction_weight(rows.turn_rad / sigma_rad)
        normal = solve(rows, score.mean_m, share / sigma_m**2, turns, echo, shared, parameters)
        objects, shared = moved(objects, normal.step), replace(shared, shift=normal.shift, error=normal.error)
        leverage = min(normal.freedom / max(float(share.sum()), 1.0), _MOST_LEVERAGE)
        late_share = _late_share(residual, sigma_m, share, leverage, config)
        if estimate_sigma:
            data = _respread(data, echo, share, score, normal.freedom)
    unsure = (1 - share) * score.mean_m**2 + score.variance_m2
    information = share / sigma_m**2 * np.clip(1 - unsure / sigma_m**2, 0, 1)
    normal = solve(rows, score.mean_m, information, turns, echo, shared, parameters)
    errors, covariance = errors_of(normal, data.stands, parameters), with_sensors_left(normal, shared, parameters)
    fit = Fit(objects, covariance, held_by(normal, data.stands, parameters), offsets_of(objects))
    return Settled(fit, share, data.range_sigma_m, shared, normal, errors)


def _allowed(data: Evidence, iterations: int) -> list[float]:
    """What part of the errors that echoes share each step allows for: all, and at last nothing. Where poses may move
    steps between allow for less and less, down to about what a range errs by.
    """
    fine, between = data.echoes.is_fine, 0
    times = float((data.echoes.shared_sigma_m / data.range_sigma_m)[fine].max(initial=1.0))
    if len(data.stands.open):
        between = min(int(np.ceil(np.log2(times))), _MOST_BETWEEN)
    return [times ** (-step / (between + 1)) for step in range(between + 1)] + [0.0] * (iterations - 1)


_MOST_BETWEEN = 3  # each about halves what is allowed, from 3 cm to the 2 mm of a plateau's range


def _score(
    residual_m: np.ndarray,
    sigma_m: np.ndarray,
    late_share: float,
    leverage: float,
    anywhere_nats: np.ndarray,
    config: RefinementConfig,
) -> _Score:
    """Residuals under a Gaussian of which ``late_share`` is a cycle late, beside ``anywhere_nats``, the log-likelihood
    of a range from anywhere.
    """
    early, late = _early_and_late(residual_m, sigma_m, leverage, config)
    both = np.logaddexp(early + np.log1p(-late_share), late + np.log(late_share))
    is_late = np.exp(late + np.log(late_share) - both)
    gain = both - np.log(sigma_m * np.sqrt(2 * np.pi)) - anywhere_nats
    return _Score(gain, residual_m - is_late * config.beam.late_m, is_late * (1 - is_late) * config.beam.late_m**2)


def _early_and_late(
    residual_m: np.ndarray, sigma_m: np.ndarray, leverage: float, config: RefinementConfig
) -> tuple[np.ndarray, np.ndarray]:
    """Log-likelihoods, but for a constant, of residuals in time and of residuals a cycle late.

    An echo pulls the fit after it: of a cycle's lateness only 1 - ``leverage`` is left in its residual, and as much of
    the residual's variance. Were that left out, most late echoes would pass for early ones, and walls lie too far out.
    """
    early = -0.5 * (residual_m / sigma_m) ** 2
    return early, early + config.beam.late_m * (residual_m - 0.5 * (1 - leverage) * config.beam.late_m) / sigma_m**2


_MOST_LEVERAGE = 0.9  # few echoes determine everything: none can be told from a late one


def _late_share(
    residual_m: np.ndarray, sigma_m: np.ndarray, share: np.ndarray, leverage: float, config: RefinementConfig
) -> float:
    """What share of the echoes is a cycle late: the mean over a few shares, by how likely each makes the residuals."""
    early, late = _early_and_late(residual_m, sigma_m, leverage, config)
    shares = config.beam.late_share * 2.0 ** np.arange(-2, 3)
    likelihood = np.array([share @ np.logaddexp(early + np.log1p(-s), late + np.log(s)) for s in shares])
    weight = np.exp(likelihood - likelihood.max())
    return float(shares @ weight / weight.sum())


def _respread(data: Evidence, echo: np.ndarray, share: np.ndarray, score: _Score, freedom: float) -> Evidence:
    """The evidence with the spread of the uncalibrated ranges that the residuals show, ``freedom`` of them used up; as
    it was where the objects explain not one of these ranges.
    """
    open_ = ~data.echoes.calibrated[echo]
    explained = float(share[open_].sum())
    if explained < 1:
        return data
    count = float(share.sum())
    square = (share * (score.mean_m**2 + score.variance_m2) / data.range_sigma_m[echo] ** 2)[open_].sum()
    left = max(explained * (1 - freedom / max(count, 1.0)), 1.0)
    spread_m = np.maximum(np.sqrt(square / left) * data.range_sigma_m, _LEAST_SPREAD_M)
    return replace(data, range_sigma_m=np.where(data.echoes.calibrated, data.range_sigma_m, spread_m))


_LEAST_SPREAD_M = 1e-4  # ranges that agree exactly are rounded ones; a spread of nought would make them certain
