"""The method ``eht-lsm``, the paper's own from feature points to contour (Liu et al. 2019, Section IV.B-D): extended
Hough transform, RANSAC Hough transform, least squares.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.contour.contour import Contour
from noctule_mapper.contour.corners import Fit, contour_of, link_ends
from noctule_mapper.contour.likelihood import gains
from noctule_mapper.contour.reflectors import Crossing
from noctule_mapper.paper.cylinders import FittedCylinder, ransac_hough
from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.paper.walls import FittedWall, extended_hough
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import evidence


def eht_lsm(points: FeaturePoints, echoes: Echoes, config: MapperConfig) -> Contour:
    """The contour that feature points alone give; ``echoes``, at least one, tell from where they were heard and which
    walls can meet.

    Points touched as corners are left out of both transforms: the paper leaves corners open, and their echoes would
    bend walls.
    """
    places_m = np.unique(np.stack([echoes.x_m, echoes.y_m], axis=1), axis=0)
    walls = extended_hough(points.take(points.kind == Kind.WALL), config.walls)
    cylinders = ransac_hough(points.take(points.kind == Kind.CYLINDER), places_m, config.cylinders)
    return contour_from(walls, cylinders, echoes, config)


def contour_from(
    walls: Sequence[FittedWall],
    cylinders: Sequence[FittedCylinder],
    echoes: Echoes,
    config: MapperConfig,
    bin_m: float = 0.0,
) -> Contour:
    """Walls linked to corners, and cylinders, each with the covariance that it brings.

    Corners are where walls cross (Section VI), in favour of crossings that explain echoes of no wall or cylinder;
    those miss an object by ``bin_m`` more than the echoes' own errors.
    """
    from scipy.linalg import block_diag  # takes a while to load, and the default method does without

    objects = [*(wall.line for wall in walls), *(cylinder.circle for cylinder in cylinders)]
    covariances = [one.covariance for one in (*walls, *cylinders)]
    offsets = np.concatenate([[0], np.cumsum([len(one) for one in covariances])]).astype(int)
    data = evidence(echoes, np.hypot(echoes.sigma_m, bin_m), config.sensor.longest_range_m, config.refinement)
    left = ~np.any([gains(one, data, config.refinement) > 0 for one in objects], axis=0)

    def support(corner: Crossing) -> float:
        """What a corner explains of the echoes that walls and cylinders leave, in nats."""
        return float(gains(corner, data, config.refinement)[left].sum())

    links = link_ends({number: wall.line for number, wall in enumerate(walls)}, data, config.refinement, support)
    readings = [len(one.members) for one in (*walls, *cylinders)]
    covariance = np.asarray(block_diag(*covariances))
    fit = Fit(objects, covariance, covariance, offsets)  # poses are taken as they are stated
    contour = contour_of(fit, links, readings, config.refinement)
    return replace(contour, range_sigma_m=float(np.median(echoes.sigma_m)))
