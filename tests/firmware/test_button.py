"""What the button's contact says: presses, double presses, and bounces that say nothing."""

import random
from collections.abc import Callable

import pytest

# firmware/src/core/gesture.h: GESTURE_SAMPLE_MS
SAMPLE_MS = 10


def level(closed: bool, ms: int) -> str:
    return ("1" if closed else "0") * ms


@pytest.fixture(params=range(SAMPLE_MS))
def gestures(pure_modules, request) -> Callable[[str], list[str]]:
    """What the firmware tells of the contact's levels; its samples may fall anywhere among them."""
    return lambda levels: pure_modules.ask("gestures", request.param, levels + level(False, 1000)).split()[:-1]


def test_one_press_is_told_400_ms_after_it_began(gestures):
    (press,) = gestures(level(False, 100) + level(True, 150))
    name, ms = press.split("@")
    assert name == "press"
    # firmware/README.md: 20 ms until the press is sure, then 400 ms for a second one
    assert 100 + 20 + 400 <= int(ms) < 100 + 20 + 400 + SAMPLE_MS


def test_a_second_press_within_400_ms_makes_a_double_press(gestures):
    levels = level(True, 100) + level(False, 100) + level(True, 100)
    assert [gesture.split("@")[0] for gesture in gestures(levels)] == ["double"]


def test_a_second_press_after_400_ms_is_a_press_of_its_own(gestures):
    levels = level(True, 100) + level(False, 350) + level(True, 100)
    assert [gesture.split("@")[0] for gesture in gestures(levels)] == ["press", "press"]


def test_holding_the_button_is_one_press(gestures):
    assert len(gestures(level(True, 5000))) == 1


def test_a_bouncing_contact_is_one_press(gestures):
    chance = random.Random(1)
    bounces = "".join(level(chance.random() < 0.5, 1) for _ in range(15))
    levels = bounces + level(True, 100) + bounces + level(False, 100)
    assert [gesture.split("@")[0] for gesture in gestures(levels)] == ["press"]


def test_a_spike_shorter_than_20_ms_is_nothing(gestures):
    assert gestures(level(True, 19)) == []
