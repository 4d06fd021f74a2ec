"""Contacts: which readings share a reflector, where each touched it, and of which kind it is."""

import numpy as np
import pytest
from mapper.made_echoes import made_echoes
from mapper.room import BEARINGS_RAD, HALF_BEAM_RAD, paper_path, paper_room, survey

from noctule_mapper.config import ContactConfig
from noctule_mapper.contacts.contact_book import ContactBook
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.readings.echoes import Echoes, echoes_of

CONFIG = ContactConfig()
EXACT_M = 1e-6  # a spread so small that ranges may be taken for exact


def readings(places: np.ndarray, range_m: np.ndarray, axis_rad: np.ndarray) -> list[Echoes]:
    """One exact echo from each place (n, 2)."""
    heard = made_echoes(places, range_m, axis_rad, EXACT_M)
    return [heard.take(np.array([number])) for number in range(len(heard))]


def contacts_of(parts: list[Echoes]):
    book = ContactBook(CONFIG)
    for number, part in enumerate(parts):
        book.add(("t", number), float(part.x_m[0]), float(part.y_m[0]), part)
    return book.contacts()


PATH = np.stack([np.arange(-0.4, 0.41, 0.2), np.zeros(5)], axis=1)


def test_readings_of_a_wall_touch_it_at_the_foot_of_the_perpendicular():
    normal_rad = np.radians(80)
    found = contacts_of(readings(PATH, 1.5 - PATH @ [np.cos(normal_rad), np.sin(normal_rad)], np.full(5, np.pi / 2)))
    assert list(found.kind) == [Kind.WALL] * 5
    bin_rad = 2 * (HALF_BEAM_RAD + CONFIG.beam_slack_rad) / CONFIG.direction_bins
    assert found.direction_rad == pytest.approx(np.full(5, normal_rad), abs=bin_rad / 2)


def test_readings_of_a_cylinder_know_its_curvature():
    centre, radius_m = np.array([0.0, 1.2]), 0.45
    away = centre - PATH
    found = contacts_of(readings(PATH, np.hypot(*away.T) - radius_m, np.arctan2(away[:, 1], away[:, 0])))
    assert list(found.kind) == [Kind.CYLINDER] * 5
    # 1 / (r + R) to within a curvature bin, an eighth of 1 / R.
    assert found.curvature_per_m == pytest.approx(1 / np.hypot(*away.T), abs=1 / 8 / 0.75)


def test_readings_of_a_corner_meet_in_a_point():
    away = np.array([0.1, 1.0]) - PATH
    found = contacts_of(readings(PATH, np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])))
    assert list(found.kind) == [Kind.CORNER] * 5


def test_two_readings_alone_prove_nothing():
    found = contacts_of(readings(PATH[:2], np.array([1.0, 1.0]), np.full(2, np.pi / 2)))
    assert list(found.kind) == [Kind.NONE] * 2


def test_a_reading_whose_beam_can_not_reach_the_reflector_has_no_part_in_it():
    axes = np.full(5, np.pi / 2)
    axes[2] = -np.pi / 2
    found = contacts_of(readings(PATH, np.ones(5), axes))
    assert found.kind[2] == Kind.NONE
    assert list(np.delete(found.kind, 2)) == [Kind.WALL] * 4


def test_a_sweep_that_leaves_takes_its_votes_along():
    sweeps = survey(paper_room(), paper_path()[:12], np.random.default_rng(1))
    parts = [echoes_of(sweep, number, 0.0032) for number, sweep in enumerate(sweeps)]
    whole, fewer = ContactBook(CONFIG), ContactBook(CONFIG)
    for number, (sweep, part) in enumerate(zip(sweeps, parts, strict=True)):
        for book in (whole, fewer) if number != 5 else (whole,):
            book.add(("t", number), sweep.x_m, sweep.y_m, part)
    whole.remove(("t", 5))
    assert whole.contacts().votes == pytest.approx(fewer.contacts().votes, abs=1e-9)
    assert np.array_equal(whole.contacts().kind, fewer.contacts().kind)


def test_a_sweep_is_matched_with_a_bounded_number_of_others_however_many_are_near():
    sweeps = survey(paper_room(), np.tile(paper_path()[:8], (12, 1)), np.random.default_rng(1))
    book = ContactBook(CONFIG)
    for number, sweep in enumerate(sweeps):
        change = book.add(("t", number), sweep.x_m, sweep.y_m, echoes_of(sweep, number, 0.0032))
        assert len(np.unique(change.echoes.sweep)) <= CONFIG.partners + 1
        assert len(change.echoes) <= (CONFIG.partners + 1) * len(BEARINGS_RAD)
