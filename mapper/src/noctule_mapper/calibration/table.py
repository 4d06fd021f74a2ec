"""A calibration as a table for people to read: millimetres, each figure with its standard error."""

from noctule_mapper.calibration.calibrate import Calibration
from noctule_mapper.calibration.spread import Spread
from noctule_mapper.calibration.wall_fit import Estimate, WallFit
from noctule_mapper.paper.detectable import greatest_radius_as_printed_m, greatest_radius_m

SIGNIFICANCE = 0.01  # a probability below it is told of
_DISTANCES_M = (0.3, 0.7, 1.0)  # the paper's, Section V.C


def calibration_table(calibration: Calibration, epsilon_sigmas: float) -> str:
    """The figures, a line each, and below them what the person who made the survey should know."""
    spread = calibration.spread
    sigma_m = spread.sigma_range_m
    epsilon_m = Estimate(epsilon_sigmas * sigma_m.value, epsilon_sigmas * sigma_m.error)
    rows = [
        ("d = R2d - R2 (Eq. 1), mean", _mm(spread.mean_d_m)),
        ("d, sigma: the threshold Th", _mm(spread.sigma_d_m)),
        ("range, sigma", _mm(sigma_m)),
        (f"epsilon, {epsilon_sigmas:g} sigma", _mm(epsilon_m)),
        ("range, mean error", _mm(calibration.mean_error_m) if calibration.mean_error_m else "not known"),
        ("Gaussian? d", _verdict(spread.gaussian_d_p)),
        ("Gaussian? range", _verdict(spread.gaussian_range_p)),
        *_detectable(spread),
    ]
    width = max(len(name) for name, _ in rows)
    lines = [_head(calibration), *(f"{name.ljust(width)}  {figure}" for name, figure in rows), *_notes(calibration)]
    return "\n".join(lines)


def _head(calibration: Calibration) -> str:
    screening, spread = calibration.screening, calibration.spread
    late = "lost in the spread" if screening.late_share is None else f"{100 * screening.late_share:.1f} %"
    return (
        f"{calibration.readings} readings from {calibration.places} places; left out: {screening.late} a cycle late "
        f"(estimated share: {late}), {screening.elsewhere} from something else\n"
        f"{spread.triples} triples {1000 * spread.spacing_m:.0f} mm apart with {len(spread.deviation_m)} deviations d; "
        f"left out: {spread.triples_off_wall} triples that do not see one wall"
    )


def _detectable(spread: Spread) -> list[tuple[str, str]]:
    """The largest cylinder that the test of Eq. 2 tells from a wall, by distance; Eq. 25 as printed and corrected."""
    threshold_m = spread.sigma_d_m.value
    rows = []
    for distance_m in _DISTANCES_M:
        ours_m = float(greatest_radius_m(distance_m, spread.spacing_m, threshold_m))
        printed_m = float(greatest_radius_as_printed_m(distance_m, spread.spacing_m, threshold_m))
        rows.append(
            (f"largest cylinder told at {distance_m:.1f} m", f"{_radius(ours_m)} (as printed: {_radius(printed_m)})")
        )
    return rows


def _notes(calibration: Calibration) -> list[str]:
    notes = []
    spread = calibration.spread
    if calibration.mean_error_m is None:
        notes.append(
            "The mean error cancels in d. Measure how far the wall is from the sensor's axis at the survey's first "
            "place, and give it as --wall-distance."
        )
    if spread.placement_p < SIGNIFICANCE:
        notes.append(
            f"The triples' means of d miss 0 by {1000 * spread.placement_m:.1f} mm: places or wall are off by about "
            "that. The spread leaves it out, the mean error can't."
        )
    return notes + _growth_note(calibration.wall)


def _growth_note(wall: WallFit | None) -> list[str]:
    if wall is None or wall.growth is None or abs(wall.growth.value) < 4 * wall.growth.error + 0.001:
        return []
    way = "colder" if wall.growth.value > 0 else "warmer"
    return [
        f"Ranges grow by {100 * wall.growth.value:+.2f} % too much with the distance, as if the air were "
        f"{abs(wall.kelvin_too_warm):.1f} K {way} than the sweeps say: look to that before you trust the mean error."
    ]


def _mm(estimate: Estimate) -> str:
    return f"{1000 * estimate.value:.2f} ± {1000 * estimate.error:.2f} mm"


def _verdict(p: float) -> str:
    told = "no" if p < SIGNIFICANCE else "yes, as far as the readings tell"
    return f"{told} (Shapiro-Wilk, p = {p:.2g})"


def _radius(radius_m: float) -> str:
    return f"radius {radius_m:.2f} m" if radius_m > 0 else "none"
