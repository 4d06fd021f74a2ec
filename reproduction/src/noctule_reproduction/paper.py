"""What Liu et al. 2019 print: their room, their noise, and the columns of their Tables I-III, in their centimetres.

The columns HT, RHT and EHT + LSM were measured on a real rig. What is printed wrong is kept so, and told in ``SLIPS``.
"""

from typing import Literal

Column = Literal["true", "hough", "eht-lsm"]  # real data; HT and RHT; EHT and LSM

# Table I: theta (rad) and rho (cm) of the walls 1-5.
LINES: dict[Column, tuple[tuple[float, float], ...]] = {
    "true": ((1.3248, 162.658), (2.9226, -229.996), (1.724, -102.9515), (1.3515, -75.2727), (2.9221, 100.5188)),
    "hough": ((1.3265, 164.3347), (2.9322, -230.9292), (1.7104, -97.3285), (1.3614, -73.8178), (2.8972, 99.5121)),
    "eht-lsm": ((1.3211, 164.2017), (2.9474, -231.4263), (1.7206, -99.952), (1.3536, -73.5764), (2.8997, 99.9550)),
}

# Table II: x and y (cm) of the corners A-E; wall 1 runs from A to B, wall 2 from B to C, and so on.
CORNER_NAMES = "ABCDE"
CORNERS: dict[Column, tuple[tuple[float, float], ...]] = {
    "true": ((-62.1, 183.3), (258.5, 102.8), (220.0, -70.2), (71.7, -93.1), (-114.5, -51.6)),
    "hough": ((-56.8, 183.527), (258.394, 104.941), (221.823, -67.11), (-67.11, -89.202), (-115.266, -50.966)),
    "eht-lsm": ((-57.525, 184.127), (256.335, 104.087), (222.586, -67.486), (69.248, -90.632), (-115.265, -49.906)),
}
CORNER_ERRORS_CM: dict[Column, tuple[float, ...]] = {
    "hough": (5.305, 2.143, 3.588, 8.079, 0.994),
    "eht-lsm": (4.65, 2.519, 3.749, 3.479, 1.859),
}
MEAN_CORNER_ERROR_CM: dict[Column, float] = {"hough": 4.002, "eht-lsm": 3.251}

# Table III: x, y and radius (cm) of the cylinder F.
CYLINDER: dict[Column, tuple[float, float, float]] = {
    "true": (138.4, 48.0, 44.8),
    "hough": (139.9, 50.8, 47.8),
    "eht-lsm": (139.6, 49.3, 46.3),
}
CENTRE_ERRORS_CM: dict[Column, float] = {"hough": 3.17, "eht-lsm": 1.853}
RADIUS_ERRORS_CM: dict[Column, float] = {"hough": 3.0, "eht-lsm": 1.5}

# Section V: what the calibration found, and the cylinders that Fig. 14 shows.
MEAN_CM, SIGMA_CM = 0.23, 0.32
TESTED_RADII_CM = (6.77, 11.37, 15.37, 19.90)
TESTED_DISTANCE_CM = 30.0
STEP_CM = 20.0

SLIPS = (
    "Table II, HT, corner D: x is printed as -67.11, the y of the row above. The lines of Table I cross at 64.64, and "
    "that gives the printed error of 8.079 to within the rounding. Figure 18 shows it there.",
    "Table II, HT, average error: the five errors printed have the mean 4.022, as the text says (4.02); the table "
    "prints 4.002.",
    "Table III, EHT and LSM: the printed centre errs by 1.77, the table prints 1.853.",
    "Fig. 3 (b): at 15 degrees a beam of 22.5 degrees has ended (Eq. 5 gives 0 from 11.25 degrees on).",
)
HOUGH_CORNER_D_CM = (64.64, -89.20)  # where Table I's HT lines 3 and 4 cross
