"""The contact book: a place has one vote whatever it repeats, and what has left the book has left no trace."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mapper.room import paper_room, sweep_at

from noctule_mapper.config import ContactConfig
from noctule_mapper.contacts.contact_book import ContactBook
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.readings.echoes import echoes_of
from noctule_mapper.readings.sweep import SweepReadings

CONFIG = ContactConfig()
PLACES = np.array([(x, y, 0.0) for x in (-0.1, 0.2, 0.5) for y in (-0.4, -0.1, 0.2)])
POSE_NOISE_M = 0.004
# Along the lowest wall of the paper's room, 1 m from it; A and B have nobody else to vote for them.
A, B, C = np.array([(-0.4, 0.4, 0.0), (0.0, 0.4, 0.0), (0.4, 0.4, 0.0)])


def sweep(number: int, pose: np.ndarray, noise_m: float = 0.0) -> SweepReadings:
    """The sweep ``number`` at ``pose`` in the paper's room; its noise depends on its number alone."""
    rng = np.random.default_rng(number)
    told = pose + rng.normal(0, 1, 3) * [noise_m, noise_m, 0]
    return replace(sweep_at(paper_room(), pose, number, rng), x_m=told[0], y_m=told[1])


def put(book: ContactBook, *sweeps: SweepReadings) -> None:
    for one in sweeps:
        book.add(one.identity, one.x_m, one.y_m, echoes_of(one, one.identity[1], 0.003))


def book_of(*sweeps: SweepReadings) -> ContactBook:
    book = ContactBook(CONFIG)
    put(book, *sweeps)
    return book


def votes(book: ContactBook) -> np.ndarray:
    return np.concatenate([page.votes for page in book._pages.values()])


def most_connections(book: ContactBook) -> int:
    return max(max(len(page.voters), len(page.hearers)) for page in book._pages.values())


def contacts_of(book: ContactBook, one: SweepReadings):
    return book.contacts().take(book.echoes().sweep == one.identity[1])


@given(st.lists(st.tuples(st.sampled_from(["comes", "goes", "changes"]), st.integers(0, 63)), min_size=10, max_size=60))
@settings(max_examples=40, derandomize=True)
def test_after_any_comings_and_goings_the_votes_are_those_of_a_book_of_what_is_left(
    steps: list[tuple[str, int]],
) -> None:
    lived, held = ContactBook(CONFIG), []
    for number, (what, which) in enumerate(steps):
        if what == "goes" and held:
            lived.remove(held.pop(which % len(held)).identity)
        elif what == "changes" and held:
            old = held[which % len(held)]
            kept = np.random.default_rng(number).random(len(old.range_m)) < 0.7
            new = replace(old, range_m=np.where(kept, old.range_m, np.nan))
            held[which % len(held)] = new
            lived.exchange(new.identity, echoes_of(new, new.identity[1], 0.003))
        else:
            held.append(sweep(number, PLACES[which % len(PLACES)], POSE_NOISE_M))
            put(lived, held[-1])
    if held:
        rebuilt = book_of(*held)
        np.testing.assert_allclose(votes(lived), votes(rebuilt), rtol=0, atol=1e-9)
        np.testing.assert_array_equal(lived.echoes().range_m, rebuilt.echoes().range_m)
    else:
        assert len(lived.contacts().kind) == len(lived.echoes()) == 0


def test_a_place_that_repeats_itself_is_one_witness() -> None:
    here = sweep(0, A)
    once = book_of(here, sweep(1, B))
    often = book_of(here, *(sweep(number, B, POSE_NOISE_M) for number in range(1, 20)))
    assert contacts_of(often, here).votes.max() < CONFIG.least_votes
    assert set(contacts_of(often, here).kind) == set(contacts_of(once, here).kind) == {Kind.NONE}
    put(often, sweep(20, C))
    assert Kind.WALL in contacts_of(often, here).kind


def test_a_place_votes_as_its_newest_sweep_does() -> None:
    here, newest = sweep(0, A), sweep(2, B)
    replaced, alone = book_of(here, sweep(1, B), newest), book_of(here, newest)
    assert contacts_of(replaced, here).votes == pytest.approx(contacts_of(alone, here).votes, abs=1e-9)


def test_when_the_newest_sweep_of_a_place_goes_the_one_before_it_votes_again() -> None:
    here, older, newest = sweep(0, A), sweep(1, B), sweep(2, B)
    book = book_of(here, older, newest)
    book.remove(newest.identity)
    assert contacts_of(book, here).votes == pytest.approx(contacts_of(book_of(here, older), here).votes, abs=1e-9)


def test_a_change_tells_of_every_contact_that_it_has_moved_and_of_no_other() -> None:
    book = book_of(sweep(0, A), sweep(1, B))
    before = book.contacts()
    newest = sweep(2, C)
    change = book.add(newest.identity, newest.x_m, newest.y_m, echoes_of(newest, 2, 0.003))
    after = book.contacts()
    known = len(before.kind)
    moved = (after.kind[:known] != before.kind) | (after.direction_rad[:known] != before.direction_rad)
    told = change.echoes.sweep < 2
    assert sorted(change.after.direction_rad[told]) == sorted(after.direction_rad[:known][moved])
    assert sorted(change.before.direction_rad[told]) == sorted(before.direction_rad[moved])


def test_units_that_stand_side_by_side_for_long_know_no_more_of_each_other_than_at_first() -> None:
    """One of them hardly ever sweeps, so its page stays while the others' come and go."""
    book, held = book_of(sweep(0, A)), []
    connections = []
    for number in range(1, 300):
        held.append(sweep(number, (B, C)[number % 2], POSE_NOISE_M))
        put(book, held[-1])
        if len(held) > 4:  # two of each
            book.remove(held.pop(0).identity)
        connections.append(most_connections(book))
    assert max(connections[:20]) == max(connections) <= 4


def test_rounds_of_a_close_path_add_nothing_to_the_book() -> None:
    places = np.array([(x, y, 0.0) for x in np.arange(-0.4, 0.5, 0.12) for y in np.arange(-0.4, 0.5, 0.12)])
    book, rounds = ContactBook(CONFIG), []
    for first in range(0, 4 * len(places), len(places)):
        for step, pose in enumerate(places):
            if first:
                book.remove(("room", first + step - len(places)))
            put(book, sweep(first + step, pose, POSE_NOISE_M))
        rounds.append((most_connections(book), len(book._pages), len(book._places.about(0.0, 0.0))))
    connections, pages, about = np.array(rounds).T
    assert connections.max() <= 4 * CONFIG.partners
    assert set(pages) == {len(places)}
    assert about.max() <= len(places)
