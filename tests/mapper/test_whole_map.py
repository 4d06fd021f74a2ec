"""Which walls of few echoes stand, in a scene of five echoes that can be worked out by hand."""

import math
from collections.abc import Sequence

import numpy as np
from mapper.small_scene import MOST_GAIN_NATS, evidence_of

from noctule_mapper.config import MapperConfig, for_rare_stops
from noctule_mapper.contour.reflectors import Line, Reflector
from noctule_mapper.refinement.association import Scene
from noctule_mapper.refinement.candidates import line_candidates
from noctule_mapper.refinement.state import State
from noctule_mapper.refinement.whole_map import sure_map

CONFIG = for_rare_stops(MapperConfig())
TURNED_RAD = math.radians(3.0)
# The wall x = 2 was heard from (0, 0) and (0, 0.4). The line turned by 3 degrees shares the second of these echoes and
# has one from (0, -0.4) instead of the first.
WALL = Line(0.0, 2.0, 0.0, 0.4)
RIVAL = (TURNED_RAD, 2.0 + 0.4 * math.sin(TURNED_RAD))
OF_WALL, OF_BOTH = (0.0, 0.0, 0.0, 2.0), (0.0, 0.4, 0.0, 2.0)
OF_RIVAL = (0.0, -0.4, TURNED_RAD, RIVAL[1] + 0.4 * math.sin(TURNED_RAD))
# A wall in line with the first, three metres away.
BESIDE = Line(0.0, 2.0, 3.0, 3.4)
OF_BESIDE = (0.5, 3.0, 0.0, 1.5), (0.5, 3.4, 0.0, 1.5)


def left(walls: Sequence[Line], heard: Sequence[tuple[float, float, float, float]]) -> list[Reflector]:
    """Which of the walls stand where the rival may take their place, nothing fitted or linked."""
    data = evidence_of(heard)
    scene = Scene(data, CONFIG.refinement)

    def fitted(objects: Sequence[Reflector]) -> State:
        explained = scene.explain(scene.claims(objects, [])).unexplained < 0.5
        return State(list(objects), [], explained, scene.worth_of(objects, []), scene, 0.0, 0.0)

    library = [line_candidates(np.array([RIVAL]), data, CONFIG)]
    return sure_map(fitted(walls), library, scene, fitted, lambda _: [], CONFIG).objects


def test_a_wall_stands_that_no_other_map_does_without() -> None:
    assert 2 * MOST_GAIN_NATS - CONFIG.refinement.prices.wall_nats > 2 * CONFIG.refinement.rare_stops.sure_nats
    assert left([WALL], [OF_WALL, OF_BOTH]) == [WALL]


def test_a_wall_is_left_out_whose_rival_explains_as_many_echoes() -> None:
    assert left([WALL], [OF_WALL, OF_BOTH, OF_RIVAL]) == []


def test_a_wall_in_line_with_a_doubtful_one_does_not_make_it_sure() -> None:
    assert left([WALL, BESIDE], [OF_WALL, OF_BOTH, OF_RIVAL, *OF_BESIDE]) == [BESIDE]
