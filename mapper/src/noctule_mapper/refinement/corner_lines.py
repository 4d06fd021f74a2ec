"""Lines through what was heard of a known wall's corner: where the feet of a wall lie close together, its own echoes
tell its direction poorly, and its corner, a metre away, tells it well.
"""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.reflectors import Line
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes


def corner_lines(walls: Sequence[Line], free: np.ndarray, echoes: Echoes, config: RefinementConfig) -> np.ndarray:
    """Lines (theta, rho), (m, 2), that touch the arc of one of the ``free`` echoes, bool (n,), and meet one of the
    ``walls`` where another free echo may have heard their corner: beyond what has been seen of the wall.
    """
    heard = echoes.take(np.nonzero(free)[0])
    found = [_lines_from(_corners_on(wall, heard, config), heard, config) for wall in walls]
    return np.concatenate(found) if found else np.zeros((0, 2))


def _corners_on(wall: Line, heard: Echoes, config: RefinementConfig) -> np.ndarray:
    """Points of the wall's line on the arcs ``heard``, (m, 2): R = |c - p|, corners up to a right angle apart."""
    off_m, along_m = wall.ranges(heard), wall.along(heard)
    reach_m = np.sqrt(np.maximum(heard.range_m**2 - off_m**2, 0))
    points = []
    for side in (-1, 1):
        at_m = along_m + side * reach_m
        x_m, y_m = (at_m[:, None] * wall.tangent + wall.rho_m * wall.normal).T
        direction_rad = np.arctan2(y_m - heard.y_m, x_m - heard.x_m)
        beyond = (at_m < wall.low_m + config.linking.overshoot_m) | (at_m > wall.high_m - config.linking.overshoot_m)
        good = (heard.range_m > np.abs(off_m)) & beyond & _in_beam(direction_rad, heard, config)
        points.append(np.stack([x_m, y_m], axis=1)[good])
    return np.concatenate(points)


def _lines_from(corners: np.ndarray, heard: Echoes, config: RefinementConfig) -> np.ndarray:
    """Tangents from the ``corners`` (k, 2) to the arcs ``heard``, (m, 2) as (theta, rho), those inside the beams."""
    to_x, to_y = corners[:, :1] - heard.x_m, corners[:, 1:] - heard.y_m
    share = heard.range_m / np.maximum(np.hypot(to_x, to_y), 1e-9)
    turn_rad = np.arccos(np.minimum(share, 1))
    lines = []
    for side in (-1, 1):
        theta_rad = np.arctan2(to_y, to_x) + side * turn_rad
        corner, echo = np.nonzero((share < 1) & _in_beam(theta_rad, heard, config))
        theta_rad = wrapped(theta_rad[corner, echo])
        foot = heard.take(echo)
        rho_m = foot.x_m * np.cos(theta_rad) + foot.y_m * np.sin(theta_rad) + foot.range_m
        lines.append(np.stack([theta_rad, rho_m], axis=1))
    return np.concatenate(lines)


def _in_beam(direction_rad: np.ndarray, heard: Echoes, config: RefinementConfig) -> np.ndarray:
    widest_rad = heard.half_beam_rad + config.beam.slack_rad + 2 * heard.sigma_heading_rad
    return np.abs(wrapped(direction_rad - heard.axis_rad)) <= widest_rad
