"""The paper's R2d test, Eq. 1-2 of Liu et al. 2019, and what it makes of walls and of the paper's four cylinders."""

import numpy as np
import pytest
from mapper.made_echoes import made_echoes
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.config import ContactConfig, MapperConfig
from noctule_mapper.contacts.r2d import R2dTest, r2d_test
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.mapper import Mapper
from noctule_mapper.paper.detectable import deviation_m
from noctule_mapper.readings.collinear import deviation_sigma_m, reference_range_m
from noctule_mapper.readings.echoes import Echoes

SIGMA_M = 0.0032  # Section V.A
STEP_M = 0.2  # l_step, Section V.A-C
PAPER_RADII_M = [0.0677, 0.1137, 0.1537, 0.1990]  # Section V.B, at 30 cm


def in_a_row(x_m: np.ndarray, range_m: np.ndarray) -> Echoes:
    """Echoes from places on the x axis, heard straight ahead."""
    places = np.stack([x_m, 0 * x_m], axis=1)
    return made_echoes(places, range_m, np.full(len(x_m), np.pi / 2), SIGMA_M)


def judged(heard: Echoes, config: ContactConfig | None = None) -> R2dTest:
    return r2d_test(heard, heard, config or ContactConfig())


def before_a_cylinder(radius_m: float, errors_m: np.ndarray) -> Echoes:
    """Three positions a step apart, the middle one 30 cm before the cylinder."""
    x_m = np.array([-STEP_M, 0, STEP_M])
    return in_a_row(x_m, np.hypot(x_m, 0.3 + radius_m) - radius_m + errors_m)


def test_a_wall_gives_collinear_positions_a_linear_range():
    # Eq. 1 with its bracket where it belongs, on the line y = 2 - x / 2 seen from x = 0, 0.2, 0.6.
    x_m = np.array([0, 0.2, 0.6])
    to_wall = (2 - x_m / 2) / np.hypot(1, 0.5)
    assert reference_range_m(to_wall[0], to_wall[2], 0.2, 0.6) == pytest.approx(to_wall[1], abs=1e-12)
    found = judged(in_a_row(x_m, to_wall))
    assert list(found.kind) == [Kind.NONE, Kind.WALL, Kind.NONE]
    assert (found.d12_m[1], found.d13_m[1]) == pytest.approx((0.2, 0.6))
    assert found.deviation_m[1] == pytest.approx(0, abs=1e-12)


def test_the_threshold_is_the_sigma_of_the_deviation():
    # Independent ranges at equal spacing: sqrt(1/4 + 1 + 1/4) of a range's sigma.
    assert deviation_sigma_m((SIGMA_M, SIGMA_M, SIGMA_M), STEP_M, 2 * STEP_M) == pytest.approx(np.sqrt(1.5) * SIGMA_M)
    errors_m = np.random.default_rng(41).normal(0, SIGMA_M, (2000, 3))
    drawn = reference_range_m(errors_m[:, 0], errors_m[:, 2], STEP_M, 2 * STEP_M) - errors_m[:, 1]
    found = judged(before_a_cylinder(0.1, np.zeros(3)))
    assert found.threshold_m[1] == pytest.approx(drawn.std(), rel=0.05)
    assert judged(before_a_cylinder(0.1, np.zeros(3)), ContactConfig(r2d_threshold_m=0.0032)).threshold_m[1] == 0.0032


@pytest.mark.parametrize("radius_m", PAPER_RADII_M)
def test_the_papers_four_cylinders_are_recognised_at_30_cm_without_and_with_noise(radius_m):
    # Section V.B, Fig. 14, with Th = sigma. d is 3.9 to 5.1 cm, at least nine of its own sigma: every one.
    exact = judged(before_a_cylinder(radius_m, np.zeros(3)), ContactConfig(r2d_threshold_m=SIGMA_M))
    assert exact.kind[1] == Kind.CYLINDER
    assert exact.deviation_m[1] == pytest.approx(deviation_m(radius_m, 0.3, STEP_M))
    rng = np.random.default_rng(42)
    noisy = [judged(before_a_cylinder(radius_m, rng.normal(0, SIGMA_M, 3))).kind[1] for _ in range(200)]
    assert noisy == [Kind.CYLINDER] * 200


def test_of_a_walls_readings_two_in_three_are_recognised_where_th_is_sigma():
    # |d| < sigma has probability 68.3 % (Section V.B's Th), |d| < 3 sigma 99.7 % (Section V.C's); d of 2000 triples.
    rng = np.random.default_rng(43)
    x_m = np.arange(6001) * STEP_M
    heard = in_a_row(x_m, 1 + rng.normal(0, SIGMA_M, len(x_m)))
    found = judged(heard).take(slice(1, -1))
    assert np.mean(found.kind == Kind.WALL) == pytest.approx(0.683, abs=0.03)
    three = judged(heard, ContactConfig(r2d_sigmas=3.0)).take(slice(1, -1))
    assert np.mean(three.kind == Kind.WALL) == pytest.approx(0.997, abs=0.004)


def test_positions_off_the_line_of_their_neighbours_are_not_judged():
    heard = in_a_row(np.array([-0.2, 0, 0.2]), np.ones(3))
    bent = Echoes(**{**vars(heard), "y_m": np.array([0, 0.01, 0])})
    assert list(judged(bent).kind) == [Kind.NONE] * 3


def test_the_nearest_positions_on_either_side_are_taken():
    found = judged(in_a_row(np.array([-0.5, -0.2, 0, 0.3, 0.6]), np.ones(5)))
    assert (found.first[2], found.third[2]) in ((1, 3), (3, 1))
    assert found.d13_m[2] == pytest.approx(0.5)


def test_a_mapper_reports_both_verdicts_on_each_reading_of_a_survey():
    mapper = Mapper()
    for sweep in survey(paper_room(), paper_path(), np.random.default_rng(44)):
        mapper.register_sweep(sweep)
    report = mapper.contact_report()
    lines = report.csv().splitlines()
    assert len(lines) == 1 + len(report.echoes)
    assert lines[0].startswith("sweep,x_m,y_m,axis_rad,range_m")
    both = (report.circles.kind == Kind.WALL) & (report.r2d.kind != Kind.NONE)
    assert both.sum() > 30
    # On walls by the tangent circle d is Gaussian with the sigma that Th says: two thirds are walls by R2d.
    assert 0.5 < np.mean(report.r2d.kind[both] == Kind.WALL) < 0.85


def test_the_r2d_test_can_be_the_classifier():
    sweeps = survey(paper_room(), paper_path(), np.random.default_rng(45))
    mapper = Mapper(MapperConfig(contacts=ContactConfig(classifier="r2d")))
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    report = mapper.contact_report()
    judged = (report.r2d.kind != Kind.NONE) & (report.circles.kind != Kind.NONE)
    assert np.array_equal(report.touched.kind, np.where(judged, report.r2d.kind, Kind.NONE))
    assert set(mapper.feature_points().kind) <= {Kind.WALL, Kind.CYLINDER}  # the paper leaves corners open
