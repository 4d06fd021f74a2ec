"""The fit by expectation and maximisation on one wall: late echoes, shares and spread, as they come out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mapper.small_scene import MOST_GAIN_NATS, SIGMA_M, claims_of, evidence_of

from noctule_mapper.config import BeamConfig, RefinementConfig
from noctule_mapper.contour.reflectors import Line
from noctule_mapper.readings.evidence import direction_weight
from noctule_mapper.readings.stands import stands_of
from noctule_mapper.refinement.em_fit import Settled, settle
from noctule_mapper.refinement.joint_fit import linearise, placing_nothing, rows_of, shared_by

# None is late: what is left to find are the wall and the spread.
IN_TIME = RefinementConfig(beam=BeamConfig(late_share=1e-12))
ALONG_M = np.linspace(-1, 1, 20)
STEPS = 8


def fitted(off_m: np.ndarray, config: RefinementConfig, calibrated: bool = True) -> Settled:
    """The wall x = 2, started 2 mm off, from 20 places on the y axis whose ranges are ``off_m`` (20,) too long."""
    data = evidence_of(
        [(0.0, float(y), 0.0, 2.0 + float(off)) for y, off in zip(ALONG_M, off_m, strict=True)], calibrated=calibrated
    )
    start = Line(0.001, 2.002, -1.0, 1.0)
    claims = claims_of([0] * len(ALONG_M), data, 2.0)
    return settle([start], [], claims, data, config, STEPS, estimate_sigma=not calibrated)


def test_echoes_a_cycle_late_do_not_move_the_wall() -> None:
    # Two of twenty are 4.3 mm long at a spread of 0.5 mm: the mean is 0.43 mm too long, the wall is not.
    config = RefinementConfig()
    off_m = np.zeros(20)
    off_m[[4, 15]] = config.beam.late_m
    data = evidence_of([(0.0, float(y), 0.0, 2.0 + float(off)) for y, off in zip(ALONG_M, off_m, strict=True)])
    sharp = data.respread(0.0005 / SIGMA_M)
    claims = claims_of([0] * len(ALONG_M), sharp, 2.0)
    found = settle([Line(0.0, 2.0005, -1.0, 1.0)], [], claims, sharp, config, STEPS)
    (wall,) = found.fit.objects
    assert isinstance(wall, Line)
    assert wall.rho_m == pytest.approx(2.0, abs=5e-5)
    assert found.share.min() > 0.99  # late echoes are the wall's all the same


def test_an_echo_from_elsewhere_has_no_share_and_the_others_have_what_their_ranges_are_worth() -> None:
    off_m = np.zeros(20)
    off_m[7] = -0.5
    found = fitted(off_m, IN_TIME)
    (wall,) = found.fit.objects
    assert wall.parameters == pytest.approx([0.0, 2.0], abs=1e-6)
    likelihood = 0.96 * 0.95 * math.exp(MOST_GAIN_NATS)  # of 1 - false_share, the chance of an answer, the range
    assert np.delete(found.share, 7) == pytest.approx(np.full(19, likelihood / (1 + likelihood)), abs=1e-6)
    assert found.share[7] == pytest.approx(0.0, abs=1e-12)


def test_the_covariance_is_that_of_a_straight_line_through_the_echoes() -> None:
    # Independent ranges R = rho - y sin(theta): var rho = sigma^2 / n, var theta = sigma^2 / sum y^2, about y = 0.
    covariance = fitted(np.zeros(20), IN_TIME).fit.covariance_of(0)
    expected = SIGMA_M**2 * np.diag([1 / (ALONG_M**2).sum(), 1 / 20])
    assert covariance == pytest.approx(expected, rel=0.005, abs=1e-10)  # shares of 0.998 leave so much open


def test_an_unknown_spread_is_that_of_the_residuals_with_two_of_them_used_up() -> None:
    # +5 -5 -5 +5 mm and so on move neither the wall's place nor its direction: sigma^2 = 20 (5 mm)^2 / (20 - 2).
    off_m = 0.005 * np.tile([1.0, -1.0, -1.0, 1.0], 5)
    found = fitted(off_m, IN_TIME, calibrated=False)
    assert found.range_sigma_m == pytest.approx(np.full(20, 0.005 * math.sqrt(20 / 18)), rel=0.01)


def test_a_calibrated_spread_stays() -> None:
    off_m = 0.005 * np.tile([1.0, -1.0, -1.0, 1.0], 5)
    assert fitted(off_m, IN_TIME).range_sigma_m.tolist() == [SIGMA_M] * 20


def test_echoes_that_place_nothing_move_objects_and_no_place() -> None:
    data = evidence_of([(0.0, y, 0.0, 2.0) for y in (-0.5, 0.0, 0.5)])
    wall, claims = Line(0.0, 2.0, -1.0, 1.0), claims_of([0] * 3, data, 2.0)
    linear = linearise([wall], [], claims.maker, claims.echo, data.echoes)
    rows = rows_of(linear, claims.echo, data.echoes, shared_by(data), 2)
    freed = placing_nothing(rows, np.array([True, False, True]))
    assert rows.by_place[:, 0] == pytest.approx([-1.0, -1.0, -1.0])  # a step towards the wall shortens the range
    assert freed.by_place[:, 0] == pytest.approx([0.0, -1.0, 0.0])
    assert not freed.turn_by_place[[0, 2]].any()
    assert np.array_equal(freed.turn_by_place[1], rows.turn_by_place[1])
    assert np.array_equal(freed.residual_m, rows.residual_m)


def test_a_direction_that_is_far_off_tells_a_ninth_of_one_that_is_as_exact_as_stated() -> None:
    # At 0 sigmas 0.85 sharp ones stand against 0.15 / 3 blunt ones, at 8 none against all: 17 / 18 + 1 / 18 / 9.
    assert direction_weight(np.array([0.0, 8.0])) == pytest.approx([0.95062, 1 / 9], abs=1e-5)


# Four walls as (theta, rho), and three units among them; their poses are stated up to 5.1 cm and 3.4 degrees wrong.
WALLS = ((0.0, 4.0), (math.pi / 2, 3.0), (math.pi, 0.0), (-math.pi / 2, 0.0))
UNITS = np.array([(0.4, 0.6, 0.5), (3.5, 0.8, 2.6), (2.9, 2.5, -2.2)])
ERRORS = np.array([(0.03, -0.04, 0.05), (-0.05, 0.01, -0.06), (0.02, 0.04, 0.03)])
TAPE_M, TAPE_RAD = 0.03, math.radians(3.0)


def test_poses_by_tape_measure_lose_no_echo_and_are_found() -> None:
    """Ranges and directions are without noise. A range is known to 3 mm, but lies up to 5 cm off the stated pose's."""
    stated = UNITS + ERRORS
    unit, wall = (grid.ravel() for grid in np.meshgrid(range(len(UNITS)), range(len(WALLS)), indexing="ij"))
    theta_rad, rho_m = np.array(WALLS)[wall].T
    x_m, y_m, _ = UNITS[unit].T
    range_m = rho_m - x_m * np.cos(theta_rad) - y_m * np.sin(theta_rad)
    axis_rad = theta_rad + ERRORS[unit, 2]
    heard = [tuple(map(float, one)) for one in np.column_stack([stated[unit, :2], axis_rad, range_m])]
    data = evidence_of(heard, sigma_position_m=TAPE_M)  # pyright: ignore[reportArgumentType]
    one = np.ones(len(unit))
    echoes = replace(
        data.echoes,
        step_rad=np.radians(4.5) * one,
        unit=unit,
        heading_rad=stated[unit, 2],
        sigma_heading_rad=TAPE_RAD * one,
    )
    stands, stand = stands_of(echoes)
    data = replace(data, echoes=echoes, stands=stands, stand=stand, direction_sigma_rad=np.radians(1.3) * one)
    started = [Line(theta, rho, -9.0, 9.0) for theta, rho in WALLS]
    found = settle(started, [], claims_of(list(wall), data, 2.0), data, IN_TIME, iterations=2)
    assert found.share.min() > 0.99
    turns_rad = found.shared.shift[:, 2] + stands.now[:, 2] - UNITS[stands.unit, 2]
    # All of them and the walls may be turned together. Four directions, each known to 1.3 degrees, leave to what was
    # stated, to 3 degrees, 1 / (1 + 4 (3 / 1.3)^2) of its say: 4.5 % of the 6.3 degrees between the units.
    assert np.ptp(turns_rad) < 0.05 * np.ptp(ERRORS[:, 2])
