"""Units of one room take turns: the real firmware, the gateway's links, clocks and timetable, in the simulator's room.

The units' oscillators are off by up to 1.5 %, and someone walks through. The simulator says how often a unit has taken
another's sound for its own echo.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest
from system.rooms_of_turns import OSCILLATORS, room_file, site_of
from system.turns_room import turns_room

from noctule.site import Site
from noctule_gateway.clock.regression import TICK_S
from noctule_gateway.turns.site_turns import site_turns
from noctule_gateway.turns.timetable import Crowd, Turn
from noctule_gateway.unit.plans import expected_plan

SETTLED_S = 60.0  # homing, and until the clocks are known
MINUTE_S = 60.0


def turns_of(site: Site) -> dict[str, Turn | Crowd]:
    return site_turns(site, {unit.name: expected_plan(unit) for unit in site.units})


@dataclass(frozen=True)
class Found:
    """``sweep_s`` has how long each sweep took, from its beginning to the next one's."""

    sweep_s: list[float]
    false_echoes: int


def measured(folder: Path, units: int, by_turns: bool, duration_s: float) -> Found:
    """What the units of a room make in so long, once they have settled."""
    site = site_of(folder, units)
    with turns_room(room_file(folder, units), site, turns_of(site) if by_turns else {}) as room:
        room.run(SETTLED_S)
        assert all(server.in_turn == by_turns for server in room.servers)
        settled = [len(server.sweeps) for server in room.servers]
        echoes = room.echoes_of_others
        room.run(duration_s)
        assert all(server.in_turn == by_turns for server in room.servers)
    sweep_s = [
        (later.start - sweep.start) * TICK_S / (1 + error)
        for server, first, error in zip(room.servers, settled, OSCILLATORS, strict=False)
        for sweep, later in pairwise(server.sweeps[first:])
    ]
    return Found(sweep_s, room.echoes_of_others - echoes)


@pytest.fixture(scope="module")
def alone_s(tmp_path_factory: pytest.TempPathFactory) -> float:
    """What the shortest sweep takes of a unit that has the room to itself."""
    return min(measured(tmp_path_factory.mktemp("alone"), 1, by_turns=False, duration_s=3 * MINUTE_S).sweep_s)


# No sweep may take more than 1.3 times longer than alone for two units, 2 for four.
@pytest.mark.parametrize(("units", "most"), [(2, 1.3), (4, 2.0)])
def test_by_turns_no_unit_hears_another_and_no_sweep_takes_much_longer_than_alone(tmp_path, alone_s, units, most):
    found = measured(tmp_path, units, by_turns=True, duration_s=3 * MINUTE_S)
    assert found.false_echoes == 0
    assert len(found.sweep_s) > 12 * units
    assert max(found.sweep_s) <= most * alone_s


def test_without_turns_they_do(tmp_path):
    assert measured(tmp_path, 4, by_turns=False, duration_s=MINUTE_S).false_echoes > 0


def test_a_unit_that_starts_again_has_its_turns_again(tmp_path):
    site = site_of(tmp_path, 2)
    with turns_room(room_file(tmp_path, 2), site, turns_of(site)) as room:
        room.run(SETTLED_S)
        room.inject("reset_pin", unit=1)
        room.run(2.0)
        assert [server.in_turn for server in room.servers] == [False, True]
        room.run(SETTLED_S)
        assert all(server.in_turn for server in room.servers)
        before = room.echoes_of_others
        room.run(MINUTE_S)
        assert room.echoes_of_others == before


@pytest.mark.soak
def test_four_units_in_one_room_hear_none_of_the_others_in_an_hour(tmp_path):
    found = measured(tmp_path, 4, by_turns=True, duration_s=60 * MINUTE_S)
    assert found.false_echoes == 0
    assert len(found.sweep_s) > 1100
