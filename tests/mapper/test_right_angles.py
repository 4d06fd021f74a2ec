"""Right angles: what a frame makes of one place's plateaus, by numbers that can be checked by hand."""

import numpy as np
import pytest

from noctule_mapper.refinement.frame_fit import fit_frame
from noctule_mapper.refinement.right_angles import Heard, claimed, frames, weights

SIGMA_M, SIGMA_RAD = 0.0016, np.radians(1.3)
FRAME_NATS = 4.0


def heard(*plateaus: tuple[float, float], known: int = 0, sigma_rad: float = SIGMA_RAD) -> Heard:
    """Plateaus by their directions in degrees and their ranges in metres, the first ``known`` of them known walls."""
    direction_deg, range_m = np.array(plateaus).T
    return Heard(
        direction_rad=np.radians(direction_deg),
        direction_sigma_rad=np.full(len(plateaus), sigma_rad),
        range_m=range_m,
        range_sigma_m=np.full(len(plateaus), SIGMA_M),
        known=np.arange(len(plateaus)) < known,
        span_m=4.0,
    )


def chances(plateaus: Heard) -> tuple[np.ndarray, np.ndarray]:
    """Of each plateau to be a wall, and a corner, of a frame."""
    found = frames(plateaus, lambda _: 0.0)
    wall, corner = claimed(found, weights(found, FRAME_NATS), len(plateaus.range_m))
    return wall, corner


# 1.5 m and 2 m at right angles: the corner is 2.5 m away, 53.13 degrees from the nearer wall. The third wall is across
# from the first, and its corner with the second as far away.
ROOM = ((20.0, 1.5), (110.0, 2.0), (20 + 53.1301, 2.5), (200.0, 1.5), (200 - 53.1301, 2.5))


def test_three_walls_and_the_corners_between_them_are_a_frame() -> None:
    found = frames(heard(*ROOM), lambda _: 0.0)
    best = max(found, key=lambda frame: frame.nats)
    assert best.walls == (0, 1, 3, -1)
    assert best.corners == (2, 4, -1, -1)
    fitted = fit_frame(best, heard(*ROOM))
    assert np.degrees(fitted.turn_rad) == pytest.approx(20, abs=1e-3)
    assert fitted.distance_m[:3] == pytest.approx([1.5, 2.0, 1.5], abs=1e-5)
    # Five directions of 1.3 degrees share one turn.
    assert np.degrees(np.sqrt(fitted.covariance[0, 0])) == pytest.approx(1.3 / np.sqrt(5), rel=0.02)
    wall, corner = chances(heard(*ROOM))
    assert wall[[0, 1, 3]].min() > 0.999
    assert corner[[2, 4]].min() > 0.999


def test_a_corner_a_centimetre_off_is_none() -> None:
    # 2.52 m in place of 2.5: eight standard deviations of the root of both squares.
    wall, _ = chances(heard((20.0, 1.5), (110.0, 2.0), (73.13, 2.52)))
    assert wall.max() < 0.5


def test_directions_that_agree_only_by_their_errors_prove_little() -> None:
    wall, _ = chances(heard((20.0, 1.5), (110.0, 2.0)))
    assert wall.max() < 0.5


def test_a_known_wall_and_the_corner_beside_it_make_a_wall_of_a_plateau() -> None:
    wall, corner = chances(heard((20.0, 1.5), (110.0, 2.0), (73.13, 2.5), known=1))
    assert wall[1] > 0.9
    assert corner[2] > 0.9


def test_known_walls_alone_are_no_evidence() -> None:
    assert not frames(heard((20.0, 1.5), (110.0, 2.0), known=2), lambda _: 0.0)


def test_what_speaks_against_a_frame_lowers_its_chance() -> None:
    found = frames(heard(*ROOM), lambda _: 30.0)
    assert weights(found, FRAME_NATS).sum() < 0.01


@pytest.mark.parametrize("seed", range(5))
def test_plateaus_from_anywhere_are_hardly_ever_a_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sure = 0
    for _ in range(40):
        sure += (chances(heard(*zip(rng.uniform(-180, 180, 7), rng.uniform(0.2, 4, 7), strict=True)))[0] > 0.995).any()
    assert sure == 0


def test_the_fit_s_covariance_is_that_of_its_errors() -> None:
    rng, squares = np.random.default_rng(7), []
    best = max(frames(heard(*ROOM), lambda _: 0.0), key=lambda frame: frame.nats)
    for _ in range(300):
        noisy = [(d + rng.normal(0, np.degrees(SIGMA_RAD)), r + rng.normal(0, SIGMA_M)) for d, r in ROOM]
        fitted = fit_frame(best, heard(*noisy))
        error = np.array([fitted.turn_rad - np.radians(20), *(fitted.distance_m[:3] - [1.5, 2.0, 1.5])])
        squares.append(error @ np.linalg.solve(fitted.covariance[:4, :4], error))
    # Chi-square of 4 degrees of freedom: the mean of 300 is 4 +- 0.16; bluntness costs a few per cent.
    assert np.mean(squares) == pytest.approx(4, abs=0.7)
