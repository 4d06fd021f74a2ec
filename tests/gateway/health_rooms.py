"""Sweeps of fixed units in random rooms, fast: what each pose can hear is worked out a few times, the noise each time.

The physics is that of ``noctule_reproduction.specular``, the noise that of ``mapper.room.HARD``: 3.2 mm (Liu et al.
2019, Section V.A), of the readings 4 % false, 8 % lost, 5 % a cycle of 40 kHz late.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from mapper.fixed_units import BEARINGS_RAD, FIXED, fixed_room
from mapper.room import PAPER_SIGMA_M, Room, survey_labelled

from noctule.air import speed_of_sound_m_s
from noctule.messages_pb2 import READING_STATUS_ECHO, READING_STATUS_NO_ECHO
from noctule_gateway.health.readings import Readings

CLEAR = replace(FIXED, sigma_m=0.0, late_share=0.0, false_share=0.0, lost_share=0.0)
DRAWS = 5  # of a pose: rare corners answer now and then
SWEEP_NS = 10_500_000_000  # a fine sweep takes 10.5 s (gateway/README.md)
COARSE_RAD = np.radians(np.arange(-135, 136, 22.5))


@dataclass(frozen=True)
class Noise:
    """How a sensor errs; shares are of the readings."""

    sigma_m: float = PAPER_SIGMA_M
    false: float = 0.04
    lost: float = 0.08
    late: float = 0.05


@dataclass
class Stand:
    """A pose in a room, and what it can hear there: (draws, n), NaN for nothing."""

    room: Room
    pose: np.ndarray
    bearings_rad: np.ndarray = field(default_factory=lambda: BEARINGS_RAD)
    draws: int = DRAWS

    def __post_init__(self) -> None:
        rng = np.random.default_rng(7)
        poses = np.repeat(self.pose[None], self.draws, axis=0)
        surveyed = survey_labelled(self.room, poses, rng, CLEAR, True, self.bearings_rad)
        self.clear_m = np.array([one.sweep.range_m for one in surveyed])

    def turned(self, degrees: float) -> "Stand":
        """The unit turned anticlockwise."""
        return replace(self, pose=self.pose + np.array([0, 0, math.radians(degrees)]))

    def moved(self, x_m: float, y_m: float) -> "Stand":
        """The unit moved in the site's frame."""
        return replace(self, pose=self.pose + np.array([x_m, y_m, 0]))

    def hears(self, rng: np.random.Generator, noise: Noise | None = None) -> np.ndarray:
        """Ranges of one sweep, (n,)."""
        return noisy(self.clear_m[rng.integers(len(self.clear_m))], rng, noise or Noise())


def noisy(clear_m: np.ndarray, rng: np.random.Generator, noise: Noise) -> np.ndarray:
    """The ranges (n,) as a sensor tells them. A false echo takes the place of silence too."""
    late_m = np.where(rng.random(len(clear_m)) < noise.late, 0.0043, 0.0)
    told_m = clear_m + rng.normal(0, noise.sigma_m, len(clear_m)) + late_m
    told_m = np.where(rng.random(len(clear_m)) < noise.false, rng.uniform(0.02, 4.0, len(clear_m)), told_m)
    return np.where(rng.random(len(clear_m)) < noise.lost, math.nan, told_m)


def sweep_of(
    range_m: np.ndarray,
    number: int,
    bearings_rad: np.ndarray = BEARINGS_RAD,
    fixed: bool = True,
    air_c: float | None = 20.0,
) -> Readings:
    """The sweep ``number``; those of even numbers turn forward. ``air_c`` None: nobody has measured it."""
    return Readings(
        bearing_rad=tuple(map(float, bearings_rad)),
        range_m=tuple(map(float, range_m)),
        status=tuple(READING_STATUS_NO_ECHO if math.isnan(one_m) else READING_STATUS_ECHO for one_m in range_m),
        speed_m_s=speed_of_sound_m_s(20.0 if air_c is None else air_c),
        air_measured=air_c is not None,
        forward=number % 2 == 0,
        fixed=fixed,
        start_ns=(number + 1) * SWEEP_NS,
        clock_epoch="e1",
    )


def stand_of(seed: int) -> Stand:
    """A unit somewhere in a random room of 2 to 5 m."""
    rng = np.random.default_rng(seed)
    room, poses = fixed_room(rng, 2)
    return Stand(room, poses[0])


def marks_in(stand: Stand) -> int:
    """How many reflectors the unit can tell apart."""
    return len(reflectors_of(stand))


def reflectors_of(stand: Stand) -> list[list[int]]:
    """Runs of two bearings or more that always hear one range."""
    runs: list[list[int]] = []
    for number in np.nonzero(always_heard(stand))[0]:
        beside = runs and runs[-1][-1] == number - 1
        if beside and abs(stand.clear_m[0, number] - stand.clear_m[0, number - 1]) < 0.03:
            runs[-1].append(int(number))
        else:
            runs.append([int(number)])
    return [run for run in runs if len(run) >= 2]


def always_heard(stand: Stand) -> np.ndarray:
    """Which bearings always hear one range, (n,)."""
    return np.ptp(stand.clear_m, axis=0) < 0.01  # NaN compares as False


def shifted(stand: Stand, off_deg: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Ranges of a sweep in which reading i looks off_deg[i] beside its bearing, (n,)."""
    wrong = replace(stand, bearings_rad=stand.bearings_rad + np.radians(off_deg), draws=1)
    return noisy(wrong.clear_m[0], rng, Noise())
