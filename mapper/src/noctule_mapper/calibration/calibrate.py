"""A calibration from repeated readings of a wall: spread, mean error, and what was left out."""

from collections.abc import Sequence
from dataclasses import dataclass

from noctule_mapper.calibration.screening import Screening, screen
from noctule_mapper.calibration.spread import Spread, spread
from noctule_mapper.calibration.wall_fit import Estimate, WallFit, fit_wall
from noctule_mapper.calibration.wall_readings import CalibrationError, wall_readings
from noctule_mapper.readings.sweep import SweepReadings

MOST_MEAN_ERROR_M = 0.1  # no sensor has so much; the distance given is then another


@dataclass(frozen=True)
class Calibration:
    """What the readings of a wall tell of their sensor. ``mean_error_m`` is that of measured less true range, None
    where the wall's distance was not given; its standard error leaves out the tape measure's.
    """

    readings: int
    places: int
    screening: Screening
    spread: Spread
    wall: WallFit | None
    mean_error_m: Estimate | None


def calibrate(
    sweeps: Sequence[SweepReadings], wall_distance_m: float | None = None, facing_rad: float | None = None
) -> Calibration:
    """Calibrate from ``sweeps`` of one sensor in front of one wall, no mean error taken off their ranges (Section V.A).

    ``wall_distance_m`` is the measured distance of the wall from the survey's first place; without it the mean error
    stays unknown. ``facing_rad`` is the wall's direction in the site's frame, needed where sweeps look elsewhere too.
    Raises CalibrationError where there are too few repeated readings on collinear places.
    """
    raw = wall_readings(sweeps, facing_rad)
    screening = screen(raw)
    good = raw.take(screening.good)
    deviations = spread(good)
    wall = fit_wall(good)
    mean_error_m = None if wall_distance_m is None else _mean_error_m(wall, wall_distance_m)
    return Calibration(len(raw.range_m), len(raw.x_m), screening, deviations, wall, mean_error_m)


def _mean_error_m(wall: WallFit | None, wall_distance_m: float) -> Estimate:
    if wall is None:
        raise CalibrationError("the places' ranges are not those of one flat wall: survey one, or give no distance")
    error_m = wall.distance_m.value - wall_distance_m
    if abs(error_m) > MOST_MEAN_ERROR_M:
        raise CalibrationError(
            f"the readings have the wall {wall.distance_m.value:.3f} m from the survey's first place, not "
            f"{wall_distance_m:.3f} m: measure from the axis about which the sensor turns, square to the wall"
        )
    return Estimate(error_m, wall.distance_m.error)
