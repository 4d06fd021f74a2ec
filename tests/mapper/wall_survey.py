"""The paper's calibration survey as a gateway would have logged it: a wall, and a sensor that errs as told.

Liu et al. 2019, Section V.A and Fig. 13(a): 12 groups of three collinear positions 20 cm apart parallel to the wall,
the first group 30 cm from it, groups 20 cm apart, 50 readings at each position.
"""

import math
from collections.abc import Callable

import numpy as np

from noctule.messages_pb2 import Pose, Sensor, Sweep
from noctule_mapper.readings.sweep import speed_of_sound_m_s

SIGMA_M, MEAN_M = 0.0032, 0.0023  # Section V.A, as said of a range
GROUPS, REPEATS, STEP_M, FIRST_M = 12, 50, 0.2, 0.3
FACING_RAD = 0.7  # of the wall in the site's frame
CELSIUS = 17.0
WALL_M = 5.0  # from the site's origin

Errors = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]


def gaussian(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """The paper's noise, mean and all."""
    return rng.normal(MEAN_M, SIGMA_M, shape)


def uniform(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Noise of the same mean and sigma that is not Gaussian."""
    return rng.uniform(MEAN_M - math.sqrt(3) * SIGMA_M, MEAN_M + math.sqrt(3) * SIGMA_M, shape)


def places() -> tuple[np.ndarray, np.ndarray]:
    """The places, (36, 2), group by group, and their true distances from the wall, (36,)."""
    normal = np.array([math.cos(FACING_RAD), math.sin(FACING_RAD)])
    along = np.array([-normal[1], normal[0]])
    away_m = np.repeat(FIRST_M + STEP_M * np.arange(GROUPS), 3)
    return (WALL_M - away_m)[:, None] * normal + np.tile([-STEP_M, 0.0, STEP_M], GROUPS)[:, None] * along, away_m


def ranges_m(seed: int, errors: Errors = gaussian) -> np.ndarray:
    """What the sensor says at each place, (36, 50)."""
    away_m = places()[1]
    return away_m[:, None] + errors(np.random.default_rng(seed), (len(away_m), REPEATS))


def sweeps(ranges_m: np.ndarray, readings_per_sweep: int = 1, unit: str = "u1") -> list[Sweep]:
    """The survey, place by place, repeats of ``readings_per_sweep`` readings of one bearing; its sensor tells of a
    calibration that must not count.
    """
    made = []
    for (x_m, y_m), of_place in zip(places()[0], ranges_m, strict=True):
        for of_sweep in of_place.reshape(-1, readings_per_sweep):
            sweep = Sweep(
                site="bench",
                unit=unit,
                boot=1,
                sequence=len(made),
                air_temperature_c=CELSIUS,
                pose=Pose(x_m=x_m, y_m=y_m, heading_rad=FACING_RAD - 0.5),
                sensor=Sensor(range_bias_m=0.1, range_sigma_m=0.5),
            )
            sweep.start.seconds = 1_767_225_600 + 3 * len(made)
            for range_m in of_sweep:
                sweep.readings.add(bearing_rad=0.5, time_of_flight_s=2 * range_m / speed_of_sound_m_s(CELSIUS))
            made.append(sweep)
    return made
