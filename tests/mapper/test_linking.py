"""Which walls meet: a link costs more for a plateau that, as a wall, would part its corner from both walls' feet. A
wall that meets others at both ends reaches to them.
"""

from dataclasses import replace

import numpy as np
import pytest
from mapper.fixed_units import FIXED, survey_fixed
from mapper.judged_room import run
from mapper.room import Physics, Room
from mapper.test_plateaus import heard

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.corners import parting
from noctule_mapper.contour.reflectors import Crossing, Line
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.readings.plateaus import plateaus
from noctule_mapper.refinement.association import Scene

CONFIG = RefinementConfig()
ROOM = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
# Seen of the south wall is its first metre, of the east one its last: their corner at (4, 0) is three metres from both.
CORNER = Crossing(Line(-np.pi / 2, 0.0, 0.0, 1.0), Line(0.0, 4.0, 2.5, 3.0))


def one_plateau(direction_rad: float, range_m: float) -> Evidence:
    """What a unit at (1, 2.5) knows of one reflector."""
    clean = Physics(sigma_m=0.0032, lobe=FIXED.lobe)
    swept = survey_fixed(ROOM, np.array([(1.0, 2.5, -np.pi / 2)]), np.random.default_rng(1), clean)
    data = heard(swept)
    flat = plateaus(data, CONFIG).take(np.array([0]))
    echoes = replace(flat.echoes, axis_rad=np.array([direction_rad]), range_m=np.array([range_m]))
    return replace(flat, echoes=echoes, looks=data.looks)


@pytest.mark.parametrize(
    ("direction_deg", "range_m", "parts"),
    [
        # In that direction the corner is 3.9 m away; its walls' last feet, (1, 0) and (4, 2.5), are 1.8 and 2.1 m.
        (-45.0, 2.2, True),
        # Nearer than one of these feet.
        (-45.0, 2.0, False),
        # Farther than the corner.
        (-45.0, 3.95, False),
        # Between the place and the foot of the south wall, at (1, 0): it is not beyond what was seen.
        (-90.0, 1.0, False),
        # Away from the corner.
        (135.0, 0.3, False),
    ],
)
def test_a_plateau_parts_a_corner_from_its_walls_where_its_line_cuts_it_off(
    direction_deg: float, range_m: float, parts: bool
) -> None:
    data = one_plateau(np.radians(direction_deg), range_m)
    assert parting(CORNER, data, CONFIG).tolist() == [parts]


def test_echoes_that_only_their_beams_direct_part_nothing() -> None:
    data = replace(one_plateau(-np.pi / 4, 2.2), direction_sigma_rad=np.array([np.inf]))
    assert not parting(CORNER, data, CONFIG).any()


def test_a_corner_is_worth_less_by_what_it_cuts_off_and_nobody_explains() -> None:
    scene = Scene(one_plateau(-np.pi / 4, 2.2), CONFIG)
    assert scene.support(CORNER, np.array([0.0])) == pytest.approx(0.0)  # another object explains it
    assert scene.support(CORNER, np.array([0.5])) == pytest.approx(-0.5 * CONFIG.linking.cut_off_nats)


def test_a_wall_is_as_long_as_its_corners_are_apart() -> None:
    """Its corners, 1.1 m apart, were heard, and 0.2 m of the wall between them, from few places."""
    assert run(20_348, "random", "refined", True).verdict.missed == ()
