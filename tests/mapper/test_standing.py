"""What stands on a relay: drawn again when the relay may have missed it, or may forget it."""

import pytest

from noctule_mapper.rerun_view.drawing import Drawing, Entries
from noctule_mapper.rerun_view.standing import REDRAWN_AFTER_BYTES, REDRAWN_AFTER_S, Standing


class Clock:
    now_s = 1_000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def standing(clock: Clock) -> Standing:
    return Standing(clock)


def nothing() -> Entries:
    return ()


def drawing(subject: str | None = None) -> Drawing:
    return Drawing(nothing, (), time_s=0.0, sweep=0, subject=subject)


def drawn(standing: Standing, subject: str | None, content_bytes: int) -> Drawing:
    made = drawing(subject)
    standing.put(made)
    standing.drawn(made, content_bytes)
    return made


def redraw_all(standing: Standing, content_bytes: int) -> list[str | None]:
    """The subjects that are due, drawn again until none is."""
    subjects = []
    while (due := standing.due()) is not None:
        subjects.append(due.subject)
        standing.drawn(due, content_bytes)
    return subjects


def test_a_drawing_is_not_due_before_much_was_drawn_after_it(standing: Standing) -> None:
    contour = drawn(standing, "contour", 1_000)
    drawn(standing, None, REDRAWN_AFTER_BYTES - 1)
    assert standing.due() is None
    drawn(standing, None, 1)
    assert standing.due() is contour
    standing.drawn(contour, 1_000)
    assert standing.due() is None


def test_a_drawing_is_due_again_when_it_has_stood_for_long_on_a_quiet_site(standing: Standing, clock: Clock) -> None:
    contour = drawn(standing, "contour", 1_000)
    clock.now_s += REDRAWN_AFTER_S - 1.0
    assert standing.due() is None
    clock.now_s += 1.0
    assert standing.due() is contour


def test_the_one_drawn_longest_ago_is_due_first_and_each_comes_once(standing: Standing, clock: Clock) -> None:
    for subject in ("contour", "tile 1", "tile 2", "contour"):
        drawn(standing, subject, 1_000)
    clock.now_s += REDRAWN_AFTER_S
    assert redraw_all(standing, 1_000) == ["tile 1", "tile 2", "contour"]


def test_a_map_larger_than_the_interval_is_not_drawn_again_without_end(standing: Standing) -> None:
    tiles = [f"tile {number}" for number in range(100)]
    for tile in tiles:
        drawn(standing, tile, REDRAWN_AFTER_BYTES // 10)  # ten times what is drawn between two redraws of a small map
    assert redraw_all(standing, REDRAWN_AFTER_BYTES // 10) == []
    drawn(standing, None, 4 * 10 * REDRAWN_AFTER_BYTES)
    assert redraw_all(standing, REDRAWN_AFTER_BYTES // 10) == tiles


def test_a_drawing_that_fails_at_each_try_does_not_keep_others_from_being_drawn_again(
    standing: Standing, clock: Clock
) -> None:
    drawn(standing, "broken", 0)
    drawn(standing, "contour", 1_000)
    clock.now_s += REDRAWN_AFTER_S
    assert redraw_all(standing, 0) == ["broken", "contour"]


def test_what_was_dropped_is_missed_until_it_is_drawn_or_replaced(standing: Standing) -> None:
    first, second = drawing("contour"), drawing("contour")
    standing.put(first)
    standing.drop(first)
    assert standing.missed() is first
    standing.put(second)
    assert standing.missed() is None
    standing.drop(second)
    standing.drawn(second, 1_000)
    assert standing.missed() is None


def test_a_new_relay_has_missed_all_but_what_waits(standing: Standing) -> None:
    contour = drawn(standing, "contour", 1_000)
    tile = drawing("tile")
    standing.put(tile)
    standing.begin([tile])
    assert standing.missed() is contour
    standing.drawn(contour, 1_000)
    assert standing.missed() is None
