"""The paper's own chain from feature points to contour: extended Hough transform, RANSAC Hough transform, least
squares.
"""

import numpy as np
from scipy.linalg import block_diag

from noctule_mapper.config import MapperConfig
from noctule_mapper.contacts import Kind
from noctule_mapper.contour import contour_of, link_ends
from noctule_mapper.cylinders import ransac_hough
from noctule_mapper.echoes import Echoes
from noctule_mapper.estimate import Contour
from noctule_mapper.features import FeaturePoints
from noctule_mapper.joint_fit import Fit
from noctule_mapper.likelihood import evidence
from noctule_mapper.walls import extended_hough


def eht_lsm(points: FeaturePoints, echoes: Echoes, config: MapperConfig) -> Contour:
    """The contour that feature points alone give (Section IV); ``echoes``, at least one, only tell which walls can
    meet.

    Points touched as corners are left out of both transforms: the paper leaves corners open, and their echoes would
    bend walls.
    """
    sigma_m = float(np.median(echoes.sigma_m))
    flat, round_ = np.nonzero(points.kind == Kind.WALL)[0], np.nonzero(points.kind == Kind.CYLINDER)[0]
    walls = extended_hough(points.take(flat), sigma_m, config.walls)
    cylinders = ransac_hough(points.x_m[round_], points.y_m[round_], sigma_m, config.cylinders)
    objects = [*(wall.line for wall in walls), *(cylinder.circle for cylinder in cylinders)]
    covariances = [one.covariance for one in (*walls, *cylinders)]
    offsets = np.concatenate([[0], np.cumsum([len(one) for one in covariances])]).astype(int)
    data = evidence(echoes, echoes.sigma_m, config.sensor.longest_range_m, config.refinement)
    links = link_ends({number: wall.line for number, wall in enumerate(walls)}, data, config.refinement)
    readings = [len(one.members) for one in (*walls, *cylinders)]
    return contour_of(Fit(objects, np.asarray(block_diag(*covariances)), offsets), links, readings, config.refinement)
