"""When the bearings are checked and what the sweeps say of it: the pure module, by firmware/README.md."""

import pytest

SWITCH, STOP = 0, 1
NEAR_HOME, FAR = -1500, 1500
SLIPPED = 0x02
MOST_SUSPECT = 63


def after(pure_modules, events: str, home: int = SWITCH, half_step: int = NEAR_HOME) -> list[int]:
    """What is answered to the questions d and f among the events, after home was found for the first time."""
    return [int(word) for word in pure_modules.ask("check", home, half_step, f"u{events}").split()[:-1]]


@pytest.mark.parametrize(
    ("home", "half_step", "sweeps"),
    [(SWITCH, NEAR_HOME, 10), (SWITCH, FAR, 11), (STOP, NEAR_HOME, 30), (STOP, FAR, 31)],
)
def test_a_check_is_due_after_so_many_sweeps(pure_modules, home, half_step, sweeps):
    due = after(pure_modules, "d" + "sd" * sweeps, home, half_step)
    assert due == [0] * sweeps + [1]


@pytest.mark.parametrize("slip", [-30000, -8, -4, 4, 8, 30000])
def test_a_slip_flags_the_sweeps_and_makes_those_before_suspect_once_and_the_next_check_comes_soon(pure_modules, slip):
    first, second, early, soon = after(pure_modules, f"{'s' * 10} {slip} f f d s s d")
    assert (first, second) == (SLIPPED | 10 << 2, SLIPPED)
    assert (early, soon) == (0, 1)


@pytest.mark.parametrize("slip", range(-3, 4))
def test_what_a_bouncing_switch_may_differ_by_is_no_slip(pure_modules, slip):
    assert after(pure_modules, f"{'s' * 10} {slip} f s s d") == [0, 0]


def test_a_check_that_finds_no_slip_ends_the_flags(pure_modules):
    assert after(pure_modules, f"{'s' * 10} 16 f ss 0 f ss d") == [SLIPPED | 10 << 2, 0, 0]


def test_no_more_sweeps_are_suspect_than_the_flags_can_tell(pure_modules):
    assert after(pure_modules, f"{'s' * 300} 8 f") == [SLIPPED | MOST_SUSPECT << 2]


def test_a_home_that_is_found_for_the_first_time_tells_of_no_slip(pure_modules):
    assert after(pure_modules, f"{'s' * 10} u f") == [0]


@pytest.mark.parametrize("checks", ["16 0", "16 u", "16 0 0", "16 12", "u 16 0"])
def test_suspects_wait_for_the_sweep_that_tells_of_them_whatever_checks_come_before_it(pure_modules, checks):
    suspect = 0 if checks.startswith("u") else 10
    found_again = SLIPPED if checks == "16 12" else 0
    first = suspect << 2 | (SLIPPED if suspect else found_again)
    assert after(pure_modules, f"{'s' * 10} {checks} f f") == [first, found_again]


def test_suspects_of_two_checks_add_up_to_what_the_flags_can_tell(pure_modules):
    assert after(pure_modules, "sss 16 ss 16 f f") == [SLIPPED | 5 << 2, SLIPPED]
    assert after(pure_modules, f"{'s' * 40} 16 {'s' * 40} 16 f 0 f") == [SLIPPED | MOST_SUSPECT << 2, 0]
