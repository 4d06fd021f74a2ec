"""The states of a link: the table of transitions, and a link that is driven through each of them."""

from collections import Counter
from itertools import pairwise

import pytest
from gateway.link_rig import PLAN, SERIAL, SWEEPING, Rig, of_type
from gateway.model_unit import ModelUnit

from noctule_gateway.link.enquiries import QUICK_CLOCKS
from noctule_gateway.link.events import Identified, SweepRead
from noctule_gateway.link.link import LOADER_RETRY_S
from noctule_gateway.link.states import IDENTIFIED, TIME_IS_KNOWN, TRANSITIONS, Cause, LinkState, TransitionError, after
from noctule_gateway.wire import frames

GREETING, IN_LOADER, SYNCING, SETTING_UP, SERVING = LinkState
EVERY_PAIR = [(state, cause) for state in LinkState for cause in Cause]


class StateRig(Rig):
    """Notes each state that the link comes to, the frames that the unit has heard in it and the sweeps taken in it."""

    def __init__(self, unit: ModelUnit) -> None:
        super().__init__(unit, SWEEPING)
        self.states = [self.link.state]
        self.took_sweeps: set[LinkState] = set()
        self.heard: Counter[tuple[LinkState, type[frames.Frame]]] = Counter()

    def until(self, state: LinkState, within_s: float = 10.0) -> None:
        """Let time pass until the link is in ``state``."""
        end_s = self.now_s + within_s
        while self.link.state is not state:
            assert self.now_s < end_s, f"{self.link.state} and not {state} after {within_s} s"
            self.step()

    def step(self) -> None:
        """Let the shortest time pass."""
        before, heard = self.link.state, len(self.unit.heard)
        if of_type(self.run(0.001), SweepRead):
            self.took_sweeps.add(before)
        asked = (frame.order if isinstance(frame, frames.For) else frame for frame in self.unit.heard[heard:])
        self.heard.update((before, type(frame)) for frame in asked)
        self.note()

    def note(self) -> None:
        """Note the state, if it is another than before."""
        if self.link.state is not self.states[-1]:
            self.states.append(self.link.state)

    def begin_again_until(self, state: LinkState) -> None:
        """Cut the line and reset the unit, and let time pass until the link is in ``state``."""
        self.cut_line()
        self.unit.in_loader = frames.Stay.ASKED if state is IN_LOADER else None
        self.unit.reset(self.now_s)
        self.until(state)

    def cut_line(self) -> None:
        """Cut the line and open it again."""
        self.link.connected(self.now_s)
        self.note()

    def reset_unit(self) -> None:
        """Reset the unit, and wait until the link has met its next boot."""
        self.unit.in_loader = None
        self.unit.reset(self.now_s)
        self.unit.say_hello()
        met = len(of_type(self.events, Identified))
        while len(of_type(self.events, Identified)) == met:
            self.step()

    def enter_loader(self) -> None:
        """Have the unit's loader speak."""
        self.unit.in_loader = frames.Stay.ASKED
        self.unit.say_loader()
        self.until(IN_LOADER)


@pytest.mark.parametrize(("state", "cause"), EVERY_PAIR)
def test_the_table_says_what_follows_and_what_it_does_not_name_is_an_error(state: LinkState, cause: Cause) -> None:
    if cause in TRANSITIONS[state]:
        assert after(state, cause) is TRANSITIONS[state][cause]
    else:
        with pytest.raises(TransitionError, match=f"{state.name} can't take {cause.name}"):
            after(state, cause)


def test_only_a_greeted_unit_is_identified_and_only_an_identified_one_gets_its_time_known() -> None:
    arrows = [(state, cause, following) for state, row in TRANSITIONS.items() for cause, following in row.items()]
    identifies = {cause for state, cause, following in arrows if following in IDENTIFIED and state not in IDENTIFIED}
    assert identifies == {Cause.HELLO}
    before = {state for state, _, following in arrows if following in TIME_IS_KNOWN and state not in TIME_IS_KNOWN}
    assert before == {SYNCING}


@pytest.mark.parametrize("state", LinkState)
def test_whatever_a_link_does_it_greets_again_when_the_unit_is_lost_and_stops_when_its_loader_speaks(
    state: LinkState,
) -> None:
    assert (after(state, Cause.LOST), after(state, Cause.LOADER)) == (GREETING, IN_LOADER)
    assert (after(state, Cause.DISTURBED) in IDENTIFIED) == (state in IDENTIFIED)


def test_a_link_goes_through_every_state_and_asks_in_each_what_the_state_says() -> None:
    unit = ModelUnit(SERIAL)
    unit.in_loader = frames.Stay.ASKED
    rig = StateRig(unit)
    rig.until(IN_LOADER)
    unit.in_loader = None
    unit.make_sweep(rig.now_s)  # a unit sends it as soon as it is greeted, and again half a second later
    rig.until(SERVING, LOADER_RETRY_S + 10.0)
    while not rig.took_sweeps:
        rig.step()
    assert rig.took_sweeps == {SERVING}
    assert rig.states == [GREETING, IN_LOADER, SYNCING, SETTING_UP, SERVING]
    assert {kind for state, kind in rig.heard if state in (GREETING, IN_LOADER)} == {frames.AskHello}
    assert {kind for state, kind in rig.heard if state is SYNCING} == {frames.AskClock}
    assert rig.heard[SYNCING, frames.AskClock] == QUICK_CLOCKS
    assert {frames.AskStatus, frames.Configure, frames.Start} <= {
        kind for state, kind in rig.heard if state is SETTING_UP
    }
    assert unit.carried_out == [PLAN, frames.Start(0, 250)]


def test_every_change_of_state_that_the_table_names_is_made_by_a_link() -> None:
    rig = StateRig(ModelUnit(SERIAL))
    for state in LinkState:
        for happens in (rig.cut_line, rig.reset_unit, rig.enter_loader):
            rig.begin_again_until(state)
            happens()
    rig.begin_again_until(SERVING)
    rig.link.set_up_again()
    rig.note()
    rig.until(SERVING)
    assert rig.states[-3:] == [SERVING, SETTING_UP, SERVING]
    named = {(state, following) for state, row in TRANSITIONS.items() for following in row.values()}
    assert set(pairwise(rig.states)) == {(state, following) for state, following in named if state is not following}
