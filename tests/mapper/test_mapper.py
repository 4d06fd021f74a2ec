"""The mapper as its callers see it: sweeps come once, in any order, and they go again."""

import numpy as np
import pytest
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.choices import Rule
from noctule_mapper.config import MapperConfig
from noctule_mapper.mapper import Mapper

SWEEPS = survey(paper_room(), paper_path(), np.random.default_rng(11))


def mapped(sweeps, config: MapperConfig | None = None) -> Mapper:
    mapper = Mapper(config)
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    return mapper


def beliefs(mapper: Mapper) -> dict:
    return {(tile.tile_x, tile.tile_y): tile.occupied for tile in mapper.grid.tiles()}


def assert_alike(one: dict, other: dict, tolerance: float) -> None:
    assert one.keys() == other.keys()
    for key in one:
        np.testing.assert_allclose(one[key], other[key], rtol=0, atol=tolerance)


def test_a_sweep_that_comes_twice_counts_once():
    once, twice = mapped(SWEEPS[:12]), mapped([*SWEEPS[:12], *SWEEPS[3:7]])
    assert twice.contour().sweeps == 12
    assert_alike(beliefs(once), beliefs(twice), 0)


def test_the_order_in_which_sweeps_come_hardly_matters():
    forth, back = mapped(SWEEPS).contour(), mapped(SWEEPS[::-1]).contour()
    both = [sorted((wall.rho_m, wall.theta_rad) for wall in contour.walls) for contour in (forth, back)]
    assert np.array(both[0]) == pytest.approx(np.array(both[1]), abs=0.001)


def test_taking_off_a_sweep_that_is_not_there_changes_nothing():
    mapper = mapped(SWEEPS[:3])
    before = beliefs(mapper)
    mapper.remove_sweep(("nobody", 1))
    assert_alike(beliefs(mapper), before, 0)


def test_a_map_rebuilt_from_its_sweeps_is_the_same_map():
    lived = mapped(SWEEPS[:20])
    for sweep in SWEEPS[:6]:
        lived.remove_sweep(sweep.identity)
    rebuilt = mapped(SWEEPS[6:20])
    assert_alike(beliefs(lived), beliefs(rebuilt), 1e-3)


def test_the_contour_tells_the_newest_sweep_and_how_many_there_are():
    contour = mapped(SWEEPS[:5]).contour()
    assert (contour.sweeps, contour.time_s, contour.method) == (5, SWEEPS[4].time_s, "refined")


def test_feature_points_lie_on_the_reflectors_they_are_named_after():
    points = mapped(SWEEPS).feature_points()
    assert len(points.x_m) > 50
    ((x, y, radius),) = paper_room().cylinders
    on_cylinder = np.abs(np.hypot(points.x_m - x, points.y_m - y) - radius) < 0.02
    assert on_cylinder[points.kind == 2].mean() > 0.6
    assert not on_cylinder[points.kind == 1].any()


def test_a_contact_report_is_of_the_sweeps_that_are_on_the_map():
    mapper = mapped(SWEEPS[:10])
    heard = len(mapper.contact_report().echoes)
    mapper.remove_sweep(SWEEPS[4].identity)
    echoes = sum(int(np.isfinite(sweep.range_m).sum()) for sweep in SWEEPS[:10])
    gone = int(np.isfinite(SWEEPS[4].range_m).sum())
    assert (heard, len(mapper.contact_report().echoes)) == (echoes, echoes - gone)


@pytest.mark.parametrize("rule", ["pcr6", "pcr5", "pcr2", "dempster"])
def test_the_rule_by_which_cells_are_fused_can_be_chosen(rule: Rule):
    streamed, other = mapped(SWEEPS), mapped(SWEEPS, MapperConfig(rule=rule, method="eht-lsm"))
    assert beliefs(streamed).keys() == beliefs(other).keys()
    # Wherever readings differ the rules do, by more than rounding.
    assert max(np.abs(beliefs(streamed)[key] - beliefs(other)[key]).max() for key in beliefs(other)) > 0.02
    assert len(other.contour().walls) == 5
