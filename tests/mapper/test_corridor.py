"""A real robot's sonar log down a corridor: 20-45 mm of noise, clutter, a sensor that mostly hears nothing, no surveyed
truth.
"""

import numpy as np
import pytest

from mapper import corridor
from noctule_mapper.config import MapperConfig, SensorConfig
from noctule_mapper.contour.contour import Contour
from noctule_mapper.mapper import Mapper

pytestmark = pytest.mark.skipif(not corridor.FOLDER.is_dir(), reason="the corridor log is not beside the repository")
CONFIG = MapperConfig(sensor=SensorConfig(longest_range_m=5.0))


@pytest.fixture(scope="module")
def contour() -> Contour:
    mapper = Mapper(CONFIG)
    for sweep in corridor.sweeps(sonars=(0, 7)):
        mapper.register_sweep(sweep)
    return mapper.contour()


def corridor_walls(contour: Contour):
    """The wall on the left and the wall on the right that span most of 2.0 m < x < 9.5 m."""
    walls = [
        wall for wall in contour.walls if abs(wall.start[0] - wall.end[0]) > 4 and abs(np.sin(wall.theta_rad)) > 0.9
    ]
    assert len(walls) == 2
    return sorted(walls, key=lambda wall: -wall.normal[1])


def test_the_two_corridor_walls_are_parallel_and_as_far_apart_as_line_fits_say(contour):
    # Line fits to the side sonars: parallel within 0.4 degrees, about 2.12 m apart.
    left, right = corridor_walls(contour)
    assert abs(np.degrees(left.theta_rad - right.theta_rad) % 360 - 180) < 0.4
    middle_x_m = 5.75
    left_y_m, right_y_m = ((wall.rho_m - middle_x_m * wall.normal[0]) / wall.normal[1] for wall in (left, right))
    assert 2.10 < left_y_m - right_y_m < 2.14


def test_there_is_no_forest_of_invented_objects(contour):
    # 25 m of path through a corridor and a hall.
    assert len(contour.walls) <= 12
    assert contour.cylinders == ()


def test_the_spread_is_estimated_from_the_log_itself(contour):
    assert 0.015 < contour.range_sigma_m < 0.045
