"""Parts of a site: what lies far apart is fitted apart, and stays as it is while nothing of it changes."""

from dataclasses import replace

import numpy as np
from mapper.fixed_units import fixed_room, survey_fixed
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.config import PartConfig
from noctule_mapper.contour.contour import Contour
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.parts import parts_of
from noctule_mapper.readings.sweep import SweepReadings

CONFIG = PartConfig()


def room_at(x_m: float, name: str, seed: int = 11) -> list[SweepReadings]:
    """The paper's survey, its room ``x_m`` further along."""
    swept = survey(paper_room(), paper_path(), np.random.default_rng(seed))
    return [replace(one, identity=(name, one.identity[1]), x_m=one.x_m + x_m) for one in swept]


def contour_of(sweeps: list[SweepReadings]) -> Contour:
    mapper = Mapper()
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    return mapper.contour()


def at(x_m: float, y_m: float = 0.0, bearings: int = 13) -> SweepReadings:
    """A sweep from a place, its ranges of no interest."""
    bearing_rad = np.linspace(-2.3, 2.3, bearings)
    alike = room_at(0.0, "log")[0]
    return replace(
        alike, x_m=x_m, y_m=y_m, bearing_rad=bearing_rad, range_m=bearing_rad * 0 + 1.0, no_echo=bearing_rad > 9
    )


def sizes(sweeps: list[SweepReadings]) -> list[int]:
    return [len(part) for part in parts_of(sweeps, CONFIG)]


def test_a_path_is_one_part_and_rooms_five_metres_apart_are_two() -> None:
    near, far = room_at(0.0, "near"), room_at(5.0, "far")
    assert sizes(near) == [len(near)]
    mixed = [one for pair in zip(near, far, strict=True) for one in pair]
    assert [[one.identity[0] for one in part] for part in parts_of(mixed, CONFIG)] == [
        ["near"] * len(near),
        ["far"] * len(far),
    ]


def test_stops_are_together_however_rare_and_a_second_row_of_them_apart() -> None:
    assert sizes([at(1.5 * step) for step in range(5)]) == [5]
    assert sizes([at(1.5 * step) for step in range(5)] + [at(1.5 * step, 9.0) for step in range(4)]) == [5, 4]


def test_fine_sweeps_are_together_as_far_as_one_wall_answers_both() -> None:
    assert sizes([at(0.0, bearings=61), at(7.0, bearings=61)]) == [2]
    assert sizes([at(0.0, bearings=61), at(9.0, bearings=61)]) == [1, 1]


def test_no_sweeps_and_one_sweep_have_their_parts() -> None:
    assert sizes([]) == []
    assert sizes([at(0.0)]) == [1]


def test_two_rooms_are_mapped_as_each_by_itself() -> None:
    near, far = room_at(0.0, "near"), room_at(5.0, "far", seed=12)
    both, alone = contour_of(near + far), [contour_of(near), contour_of(far)]
    assert both.sweeps == len(near) + len(far)
    assert repr(both.walls) == repr(alone[0].walls + alone[1].walls)
    assert repr(both.cylinders) == repr(alone[0].cylinders + alone[1].cylinders)
    first = len(alone[0].walls)
    assert [corner.walls for corner in both.corners] == [corner.walls for corner in alone[0].corners] + [
        (a + first, b + first) for a, b in (corner.walls for corner in alone[1].corners)
    ]


def test_only_the_room_of_a_new_sweep_is_fitted_again() -> None:
    mapper = Mapper()
    for sweep in room_at(0.0, "near") + room_at(5.0, "far"):
        mapper.register_sweep(sweep)
    before = mapper.contour()
    mapper.register_sweep(room_at(5.0, "new", seed=13)[0])
    after = mapper.contour()
    # The walls of the part that stayed are the very objects of the contour before.
    kept = [wall for wall in after.walls if any(wall is old for old in before.walls)]
    assert len(kept) == len(before.walls) // 2


def test_the_order_of_parts_is_that_of_their_first_sweeps() -> None:
    rng = np.random.default_rng(4)
    room, poses = fixed_room(rng, 3)
    swept = [one.sweep for one in survey_fixed(room, poses, rng)]
    far = [replace(one, x_m=one.x_m + 100.0, identity=("far", one.identity[1])) for one in swept]
    assert [part[0].x_m > 50 for part in parts_of(far + swept, CONFIG)] == [True, False]
