"""Lines and circles in feature points, beside scikit-image's and OpenCV's, on the same points with the same errors.

The points are those of walks through the paper's room (Tables I-III), so the truth is known: five walls, one cylinder.
Others get the points that touched walls, or the cylinder; where they want a picture, one of 1 cm a pixel. They are told
how many lines and circles there are; ours finds that out.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from bench.stopwatch import seconds
from mapper.room import paper_path, paper_room, survey
from skimage.measure import CircleModel, LineModelND, ransac
from skimage.transform import hough_circle, hough_circle_peaks, hough_line, hough_line_peaks

from noctule_mapper.config import MapperConfig
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.mapper import Mapper
from noctule_mapper.paper.cylinders import ransac_hough
from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.paper.hough import hough_cylinders, hough_walls
from noctule_mapper.paper.walls import extended_hough

CONFIG = MapperConfig()
SEEDS = range(401, 411)
PIXEL_M, CORNER_M = 0.01, np.array([-1.5, -1.5])
PICTURE = (420, 460)
THETA_BIN_RAD, RHO_BIN_M = CONFIG.walls.theta_bin_rad, CONFIG.walls.rho_bin_m
RING_M = 0.016  # five of the paper's sigma, as our own deviation test has it
FOUND_WITHIN_RAD, FOUND_WITHIN_M = np.radians(5.0), 0.10
Lines = list[tuple[float, float]]
Circles = list[tuple[float, float, float]]


@dataclass(frozen=True)
class Points:
    """One walk's feature points and the places they were heard from."""

    walls: FeaturePoints
    cylinder: FeaturePoints
    places_m: np.ndarray


def walk(seed: int) -> Points:
    """The feature points of a survey."""
    mapper = Mapper(CONFIG)
    sweeps = survey(paper_room(), paper_path(), np.random.default_rng(seed))
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    points = mapper.feature_points()
    places_m = np.array([(sweep.x_m, sweep.y_m) for sweep in sweeps])
    return Points(points.take(points.kind == Kind.WALL), points.take(points.kind == Kind.CYLINDER), places_m)


def _xy(points: FeaturePoints) -> np.ndarray:
    return np.stack([points.x_m, points.y_m], axis=1)


def _picture(points: FeaturePoints) -> np.ndarray:
    pixels = np.floor((_xy(points) - CORNER_M) / PIXEL_M).astype(int)
    picture = np.zeros(PICTURE, np.uint8)
    picture[pixels[:, 1], pixels[:, 0]] = 255
    return picture


def _lines_eht(points: Points) -> Lines:
    return [(wall.line.theta_rad, wall.line.rho_m) for wall in extended_hough(points.walls, CONFIG.walls)]


def _lines_hough(points: Points) -> Lines:
    return [(wall.line.theta_rad, wall.line.rho_m) for wall in hough_walls(points.walls, CONFIG.hough)]


def _lines_skimage_hough(points: Points) -> Lines:
    thetas = np.arange(-np.pi / 2, np.pi / 2, THETA_BIN_RAD)
    space, angles, distances = hough_line(_picture(points.walls), theta=thetas)
    peaks = hough_line_peaks(space, angles, distances, min_distance=15, min_angle=8, threshold=0, num_peaks=5)
    normals = np.stack([np.cos(peaks[1]), np.sin(peaks[1])], axis=1)
    return list(zip(peaks[1], peaks[2] * PIXEL_M + normals @ (CORNER_M + PIXEL_M / 2), strict=True))


def _lines_skimage_ransac(points: Points) -> Lines:
    left, found = _xy(points.walls), []
    while len(found) < 5 and len(left) >= 3:
        model, inside = ransac(left, LineModelND, 2, RING_M, max_trials=400, rng=len(found))
        if model is None:
            break
        theta = np.arctan2(model.direction[0], -model.direction[1])
        found.append((float(theta), float(model.origin @ (np.cos(theta), np.sin(theta)))))
        left = left[np.logical_not(inside)]
    return found


def _lines_opencv(points: Points) -> Lines:
    places = _xy(points.walls).astype(np.float32)[:, None, :]
    peaks = cv2.HoughLinesPointSet(places, 5, 1, -4.0, 4.0, RHO_BIN_M, 0.0, np.pi, THETA_BIN_RAD)
    return [(float(theta), float(rho)) for _, rho, theta in peaks.reshape(-1, 3)]


def _circles_ours(points: Points) -> Circles:
    found = ransac_hough(points.cylinder, points.places_m, CONFIG.cylinders)
    return [(one.circle.x_m, one.circle.y_m, one.circle.radius_m) for one in found]


def _circles_hough(points: Points) -> Circles:
    found = hough_cylinders(points.cylinder, CONFIG.hough)
    return [(one.circle.x_m, one.circle.y_m, one.circle.radius_m) for one in found]


def _circles_skimage_hough(points: Points) -> Circles:
    radii = np.arange(2, 101)
    space = hough_circle(_picture(points.cylinder), radii, normalize=False)
    _, x, y, radius = hough_circle_peaks(space, radii, total_num_peaks=1, normalize=False)
    return [(*(CORNER_M + PIXEL_M * (np.array([x[0], y[0]]) + 0.5)), PIXEL_M * radius[0])]


def _circles_skimage_ransac(points: Points) -> Circles:
    model, _ = ransac(_xy(points.cylinder), CircleModel, 3, RING_M, max_trials=400, rng=1)
    return [] if model is None else [(*model.center, model.radius)]


def _circles_opencv(points: Points) -> Circles:
    found = cv2.HoughCircles(_picture(points.cylinder), cv2.HOUGH_GRADIENT, 1, 100, None, 100, 3, 2, 100)
    if found is None:
        return []
    x, y, radius = found[0, 0].tolist()
    return [(*(CORNER_M + PIXEL_M * (np.array([x, y]) + 0.5)), PIXEL_M * radius)]


def _line_errors(found: Lines) -> list[float]:
    """For each wall of the room the nearest line's distance from the wall's middle, as far as one is near."""
    room = paper_room()
    errors = []
    for start, end in zip(room.vertices, room.ends, strict=True):
        middle, normal = (start + end) / 2, np.arctan2(*(end - start)) * -1
        off = [
            abs(middle @ (np.cos(theta), np.sin(theta)) - rho)
            for theta, rho in found
            if abs((theta - normal + np.pi / 2) % np.pi - np.pi / 2) < FOUND_WITHIN_RAD
        ]
        errors += [min(off)] if off and min(off) < FOUND_WITHIN_M else []
    return errors


def _circle_errors(found: Circles) -> list[float]:
    """The distance of the nearest centre from the cylinder's, as far as one is near."""
    x_m, y_m, _ = paper_room().cylinders[0]
    off = [float(np.hypot(x - x_m, y - y_m)) for x, y, _ in found]
    return [min(off)] if off and min(off) < FOUND_WITHIN_M else []


def _row(name: str, find: Callable[[Points], list], errors: Callable[[list], list[float]], walks: list[Points]) -> str:
    found = [find(points) for points in walks]
    near = [error for one in found for error in errors(one)]
    took_s = np.mean([seconds(lambda points=points: find(points), 0.05) for points in walks[:3]])
    error = f"{100 * np.mean(near):5.2f} cm" if near else "        "
    counts = f"{len(near) / len(walks):.1f} true of {np.mean([len(one) for one in found]):.1f} found"
    return f"{1e3 * took_s:12.2f} ms  {error}  {counts:24} {name}"


def table() -> list[str]:
    """Time, mean error of what is found within 10 cm and 5 degrees, and how much that is, line by line."""
    walks = [walk(seed) for seed in SEEDS]
    lines = {
        "lines: our extended Hough and least squares": _lines_eht,
        "lines: our Hough": _lines_hough,
        "lines: scikit-image, hough_line": _lines_skimage_hough,
        "lines: scikit-image, ransac": _lines_skimage_ransac,
        "lines: OpenCV, HoughLinesPointSet": _lines_opencv,
    }
    circles = {
        "circles: our RANSAC Hough and least squares": _circles_ours,
        "circles: our Hough": _circles_hough,
        "circles: scikit-image, hough_circle": _circles_skimage_hough,
        "circles: scikit-image, ransac": _circles_skimage_ransac,
        "circles: OpenCV, HoughCircles": _circles_opencv,
    }
    return [
        *(_row(name, find, _line_errors, walks) for name, find in lines.items()),
        *(_row(name, find, _circle_errors, walks) for name, find in circles.items()),
    ]
