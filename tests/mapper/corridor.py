"""The real log that tests may find beside the repository: eight sonars on a robot that drives down a corridor.

413 rows from the Udacity RoboND occupancy-grid exercise (MIT licence): t in ms, eight ranges in mm, 5110 for no echo;
poses in mm and tenths of a degree. The sensors' offsets are unknown and taken as none; beams are 20 degrees wide.
"""

import math
from pathlib import Path

import numpy as np

from noctule_mapper.readings.sweep import SweepReadings

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "udacity_sonar_corridor"
BEARINGS_RAD = np.radians([-90.0, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 90.0])
NO_ECHO_MM = 5110
LONGEST_MM = 5000


def sweeps(sonars: tuple[int, ...] = tuple(range(8))) -> list[SweepReadings]:
    """The log as sweeps of the chosen sonars, the spread of their ranges unknown."""
    ranges_mm = np.loadtxt(FOLDER / "measurement.txt")
    poses = np.loadtxt(FOLDER / "poses.txt")
    chosen = list(sonars)
    return [
        SweepReadings(
            identity=("corridor", number),
            unit="robot",
            time_s=row[0] / 1000,
            x_m=pose[1] / 1000,
            y_m=pose[2] / 1000,
            heading_rad=math.radians(pose[3] / 10),
            sigma_position_m=0.0,
            sigma_heading_rad=0.0,
            bearing_rad=BEARINGS_RAD[chosen],
            range_m=np.where(row[1:] <= LONGEST_MM, row[1:] / 1000, np.nan)[chosen],
            no_echo=(row[1:] == NO_ECHO_MM)[chosen],
            beam_width_rad=math.radians(20),
            range_sigma_m=None,
        )
        for number, (row, pose) in enumerate(zip(ranges_mm, poses, strict=True))
    ]
