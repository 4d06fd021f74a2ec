"""The joint fit against a least-squares fit in which every unknown stands by itself, the places' errors too."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mapper.small_scene import SIGMA_M, claims_of, evidence_of
from scipy.optimize import least_squares

from noctule_mapper.config import BeamConfig, RefinementConfig
from noctule_mapper.contour.corners import Link
from noctule_mapper.contour.reflectors import Circle, Crossing, Line, Reflector, Spot
from noctule_mapper.readings.stands import stands_of
from noctule_mapper.refinement.em_fit import Settled, settle
from noctule_mapper.refinement.joint_fit import linearise, offsets_of, rows_of, shared_by

SIGMA_PLACE_M = 0.005
SIGMA_FACE_M, FACE_M, STATED_FACE_M = 0.02, 0.035, 0.01
SPAN_M = 1e12  # an echo from anywhere is so unlikely that no share is lost to it
PLACES_M = np.array([(0.0, 0.0), (0.5, -0.4), (-0.3, 0.6), (0.8, 0.5), (0.2, -0.7)])
# Walls that turn by 70 degrees, their corner, and a cylinder: theta, rho; theta, rho; x, y, radius.
TRUTH = np.array([0.1, 2.0, 0.1 + math.radians(70), 1.8, -1.2, -0.9, 0.25])
WALL, OTHER_WALL, CYLINDER, CORNER = range(4)
LINKS = [Link(WALL, OTHER_WALL)]
IN_TIME = RefinementConfig(beam=BeamConfig(late_share=1e-12))


def objects_of(parameters: np.ndarray) -> list[Reflector]:
    theta_1, rho_1, theta_2, rho_2, x_m, y_m, radius_m = map(float, parameters)
    return [Line(theta_1, rho_1, -9.0, 9.0), Line(theta_2, rho_2, -9.0, 9.0), Circle(x_m, y_m, radius_m)]


def corner_of(parameters: np.ndarray) -> np.ndarray:
    """Where n . c = rho for both walls, (2,)."""
    normals = np.stack([np.cos(parameters[[0, 2]]), np.sin(parameters[[0, 2]])], axis=1)
    return np.linalg.solve(normals, parameters[[1, 3]])


def ranges_m(parameters: np.ndarray, places_m: np.ndarray) -> np.ndarray:
    """Of each place (n, 2) to the makers in their order, (n, 4), as the head of the module reflectors has them."""
    walls = [
        parameters[at + 1] - places_m @ np.array([math.cos(parameters[at]), math.sin(parameters[at])]) for at in (0, 2)
    ]
    to_cylinder = np.hypot(*(parameters[4:6] - places_m).T) - parameters[6]
    return np.stack([*walls, to_cylinder, np.hypot(*(corner_of(parameters) - places_m).T)], axis=1)


def directions_rad(places_m: np.ndarray) -> np.ndarray:
    """The true ones, (n, 4)."""
    round_ = [np.arctan2(*(point - places_m).T[::-1]) for point in (TRUTH[4:6], corner_of(TRUTH))]
    walls = [np.full(len(places_m), TRUTH[at]) for at in (0, 2)]
    return np.stack([*walls, *round_], axis=1)


def measured_m(rng: np.random.Generator, sigma_place_m: float) -> np.ndarray:
    """Ranges (places, 4) heard from places that are not where they are stated."""
    really_m = PLACES_M + rng.normal(0, sigma_place_m, PLACES_M.shape)
    return ranges_m(TRUTH, really_m) + rng.normal(0, SIGMA_M, (len(PLACES_M), 4))


def joint(measured: np.ndarray, sigma_place_m: float) -> Settled:
    heard = [
        (float(place[0]), float(place[1]), float(direction), float(range_m))
        for place, directions, ranges in zip(PLACES_M, directions_rad(PLACES_M), measured, strict=True)
        for direction, range_m in zip(directions, ranges, strict=True)
    ]
    data = evidence_of(heard, sigma_position_m=sigma_place_m, span_m=SPAN_M)
    makers = [WALL, OTHER_WALL, CYLINDER, CORNER] * len(PLACES_M)
    claims = claims_of(makers, data, 2.0)
    return settle(objects_of(TRUTH), LINKS, claims, data, IN_TIME, iterations=10)


def by_all_unknowns(measured: np.ndarray, sigma_place_m: float) -> tuple[np.ndarray, np.ndarray]:
    """The objects' parameters (7,) and their covariance: least squares over them and two errors of each place."""

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        errors_m = unknowns[7:].reshape(-1, 2)
        off = (measured - ranges_m(unknowns[:7], PLACES_M + errors_m)).ravel() / SIGMA_M
        return np.concatenate([off, errors_m.ravel() / sigma_place_m])

    start = np.concatenate([TRUTH, np.zeros(2 * len(PLACES_M))])
    found = least_squares(residuals, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return found.x[:7], np.linalg.inv(found.jac.T @ found.jac)[:7, :7]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("sigma_place_m", [SIGMA_PLACE_M, 1e-5])
def test_the_joint_fit_is_the_least_squares_fit_with_the_places_as_unknowns(seed: int, sigma_place_m: float) -> None:
    measured = measured_m(np.random.default_rng(seed), sigma_place_m)
    settled = joint(measured, sigma_place_m)
    parameters, covariance = by_all_unknowns(measured, sigma_place_m)
    found = np.concatenate([one.parameters for one in settled.fit.objects])
    sigma = np.sqrt(np.diag(covariance))
    # The fit is linear in the places: at 1 m, 5 mm aside makes a range 0.01 mm longer.
    assert (found - parameters) / sigma == pytest.approx(np.zeros(7), abs=0.06)
    scaled = settled.fit.covariance / np.outer(sigma, sigma)
    assert scaled == pytest.approx(covariance / np.outer(sigma, sigma), abs=0.06)


def test_an_error_of_the_places_does_not_average_away_with_more_echoes_from_there() -> None:
    measured = measured_m(np.random.default_rng(1), 1e-5)
    sure, unsure = (joint(measured, sigma_m).fit.covariance_of(WALL) for sigma_m in (1e-5, SIGMA_PLACE_M))
    # Of one range the variance is sigma^2, or sigma^2 + s^2: 3.8 times as much.
    assert unsure[1, 1] > 2.5 * sure[1, 1]


@pytest.mark.parametrize("turn_deg", [70, 120], ids=["obtuse corner", "acute corner"])
def test_what_a_place_does_to_ranges_is_their_slope_by_it(turn_deg: float) -> None:
    """An acute corner's range is shorter than its distance, d sin(a), and so is what a step of the place makes of it:
    or else such a corner would say where the room as a whole lies.
    """
    walls = [Line(0.1, 2.0, -9.0, 9.0), Line(0.1 + math.radians(turn_deg), 1.8, -9.0, 9.0)]
    objects = [*walls, Circle(-1.2, -0.9, 0.25), Spot(0.9, -1.1)]
    maker, corner = np.arange(5), Crossing(*walls)
    data = evidence_of([(0.2, -0.1, 0.0, 1.0)] * 5, sigma_position_m=SIGMA_PLACE_M)
    linear = linearise(objects, LINKS, maker, maker, data.echoes)
    rows = rows_of(linear, maker, data.echoes, shared_by(data), int(offsets_of(objects)[-1]))
    for axis in range(2):
        step_m = 1e-6 * np.eye(2)[axis]
        there, back = (evidence_of([(0.2 + dx, -0.1 + dy, 0.0, 1.0)]).echoes for dx, dy in (step_m, -step_m))
        slopes = [float(one.ranges(there)[0] - one.ranges(back)[0]) / 2e-6 for one in (*objects, corner)]
        assert rows.by_place[:, axis] == pytest.approx(slopes, abs=1e-6)


def test_a_face_off_the_axis_is_an_unknown_of_the_fit_known_as_well_as_by_all_unknowns() -> None:
    """Each echo is heard 15 degrees off its beam's axis, to the left and to the right in turns."""
    rng = np.random.default_rng(5)
    places = np.repeat(PLACES_M, 4, axis=0)
    makers = np.tile([WALL, OTHER_WALL, CYLINDER, CORNER], len(PLACES_M))
    axis_rad = directions_rad(PLACES_M).ravel() + np.radians(15) * np.where(np.arange(len(makers)) % 3, 1, -1)
    along = np.stack([np.cos(axis_rad), np.sin(axis_rad)], axis=1)

    def from_axis_m(parameters: np.ndarray, face_m: float) -> np.ndarray:
        from_face = ranges_m(parameters, places + face_m * along)[np.arange(len(makers)), makers]
        return from_face + STATED_FACE_M

    measured = from_axis_m(TRUTH, FACE_M) + rng.normal(0, SIGMA_M, len(makers))
    heard = [tuple(map(float, row)) for row in np.column_stack([places, axis_rad, measured])]
    data = evidence_of(heard, span_m=SPAN_M)  # pyright: ignore[reportArgumentType]
    one = np.ones(len(makers))
    echoes = replace(data.echoes, face_offset_m=STATED_FACE_M * one, sigma_face_m=SIGMA_FACE_M * one)
    data = replace(data, echoes=echoes, stands=stands_of(echoes)[0])
    settled = settle(objects_of(TRUTH), LINKS, claims_of(list(makers), data, 2.0), data, IN_TIME, iterations=10)

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        off = (measured - from_axis_m(unknowns[:7], unknowns[7])) / SIGMA_M
        return np.append(off, (unknowns[7] - STATED_FACE_M) / SIGMA_FACE_M)

    told = least_squares(residuals, np.append(TRUTH, STATED_FACE_M), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    covariance = np.linalg.inv(told.jac.T @ told.jac)
    sigma = np.sqrt(np.diag(covariance))
    found = np.concatenate(
        [*(each.parameters for each in settled.fit.objects), STATED_FACE_M + settled.shared.error[0, 2:]]
    )
    # The fit is linear in the face: 2.5 cm farther, seen 15 degrees aside at 1 m, make a range 0.02 mm longer.
    assert (found - told.x) / sigma == pytest.approx(np.zeros(8), abs=0.06)
    scale = np.outer(sigma, sigma)
    assert settled.fit.covariance / scale[:7, :7] == pytest.approx(covariance[:7, :7] / scale[:7, :7], abs=0.06)
    assert sigma[7] < 0.7 * SIGMA_FACE_M  # the corner tells: it lies root 2 times as far off as its walls


def test_air_that_nobody_has_measured_makes_all_units_wrong_alike() -> None:
    """Two units before one wall, 1 m and 2 m away: their mean knows the air no better than one of them does."""
    heard = [(0.0, 0.0, 0.0, 2.0), (0.0, 1.0, 0.0, 2.0)]
    data = evidence_of(heard, span_m=SPAN_M)
    echoes = replace(data.echoes, unit=np.array([0, 1]), sigma_scale=np.full(2, 0.0088))
    data = replace(data, echoes=echoes, stands=stands_of(echoes)[0])
    fit = settle([Line(0.0, 2.0, -9.0, 9.0)], [], claims_of([0, 0], data, 2.0), data, IN_TIME, iterations=5).fit
    # Of 2 m 0.88 %, 17.6 mm; were the units' air not the same, it would be 12.4 mm.
    assert np.sqrt(fit.covariance[1, 1] - fit.covariance[0, 1] ** 2 / fit.covariance[0, 0]) > 0.016
