"""Which mappers are ready to map a site: each knows all of them, and no two of one name."""

import threading
from contextlib import ExitStack, closing

import pytest
from system.processes import free_ports, wait_until

from noctule import bus, keys
from noctule_mapper.sharing.errors import SharingError
from noctule_mapper.sharing.offers import GONE_AFTER_S, SETTLED_AFTER_S, Offers
from noctule_mapper.sharing.unshared import UnsharedSites

SITES = ["attic", "hall"]


def test_each_knows_who_is_ready_to_map_a_site_until_that_one_is_gone(sessions) -> None:
    with closing(Offers(sessions[0], "m1", SITES, threading.Event())) as first:
        assert first.members("hall") == {"m1"}
        with closing(Offers(sessions[1], "m2", ["hall"], threading.Event())) as second:
            wait_until(lambda: first.members("hall") == {"m1", "m2"}, "the second is not seen")
            wait_until(lambda: second.members("hall") == {"m1", "m2"}, "the first is not seen")
            assert first.members("attic") == {"m1"}
        wait_until(lambda: first.members("hall") == {"m1"}, "the second has not gone")


class Clock:
    """A clock that stands still between the settings of ``s``."""

    def __init__(self) -> None:
        self.s = 0.0

    def __call__(self) -> float:
        return self.s


def test_sites_of_a_mapper_that_goes_are_taken_at_once_and_those_of_one_that_comes_wait_for_others(sessions) -> None:
    clock = Clock()
    with closing(Offers(sessions[0], "m1", SITES, threading.Event(), now=clock)) as first:
        clock.s = 100.0
        with closing(Offers(sessions[1], "m2", SITES, threading.Event())):
            wait_until(lambda: all(first.members(site) == {"m1", "m2"} for site in SITES), "m2 is not seen")
            clock.s += 0.9 * SETTLED_AFTER_S
            assert not first.are_settled()
            clock.s += 0.2 * SETTLED_AFTER_S
            assert first.are_settled()
            clock.s = 200.0
        wait_until(lambda: all(first.members(site) == {"m1"} for site in SITES), "m2 has not gone")
        assert not first.are_settled()
        clock.s += 1.01 * GONE_AFTER_S
        assert first.are_settled()
        assert not first.are_quiet()
        clock.s += SETTLED_AFTER_S
        assert first.are_quiet()


def test_a_mapper_that_has_lost_its_router_does_not_take_all_sites_for_its_own() -> None:
    clock = Clock()
    (port,) = free_ports(1)
    address = f"tcp/127.0.0.1:{port}"
    with ExitStack() as open_:
        with bus.open_session(listen=[address]) as router:
            session = open_.enter_context(bus.open_session(connect=[address]))
            offers = open_.enter_context(closing(Offers(session, "m1", SITES, threading.Event(), now=clock)))
            with closing(Offers(router, "m2", SITES, threading.Event())):
                wait_until(lambda: offers.members("hall") == {"m1", "m2"}, "m2 is not seen")
                clock.s += 10.0
                assert offers.are_settled()
                router.close()
        wait_until(lambda: not list(session.info.transports()), "the connection is still there")
        clock.s += 10.0
        assert not offers.are_settled()


def test_a_mapper_beyond_the_most_of_a_site_is_logged_and_counted_as_soon_as_there_is_room(sessions, caplog) -> None:
    caplog.set_level("INFO")
    with closing(Offers(sessions[0], "m1", ["hall"], threading.Event())) as first:
        strangers = [sessions[1].liveliness().declare_token(keys.offer("hall", f"x{n}")) for n in range(255)]
        wait_until(lambda: len(first.members("hall")) == 256, "the made-up names are not counted")
        assert first.let_in() == ""
        strangers.append(sessions[1].liveliness().declare_token(keys.offer("hall", "m0")))
        wait_until(lambda: "'m0' is not counted" in first.let_in(), "m0 is left out in silence")
        with closing(Offers(sessions[1], "m2", ["hall"], threading.Event())):
            strangers.pop().undeclare()
            wait_until(lambda: "'m2'" in first.let_in(), "m0 is named though it is gone, or m2 is not")
            assert first.let_in() == (
                "more than 256 mappers offer to map site hall, and 'm2' is not counted: "
                "somebody makes up names, which certificates prevent"
            )
            assert "m2" not in first.members("hall")
            strangers.pop().undeclare()
            wait_until(lambda: first.let_in() == "", "m2 is left out though there is room")
            assert "m2" in first.members("hall")
            assert len(first.members("hall")) == 256
        said = [each.getMessage() for each in caplog.records if each.name.endswith("offers")]
        assert len(said) == 3
        assert said[2] == "all mappers are counted again"
        for stranger in strangers:
            stranger.undeclare()


def test_sites_that_another_mapper_was_not_given_are_named(sessions) -> None:
    with (
        closing(Offers(sessions[0], "m1", SITES, threading.Event())) as first,
        closing(Offers(sessions[1], "m2", ["hall", "cellar"], threading.Event())) as second,
    ):
        wait_until(lambda: first.unshared() == {"m2": ["attic"]}, "m1 does not see what m2 lacks")
        wait_until(lambda: second.unshared() == {"m1": ["cellar"]}, "m2 does not see what m1 lacks")


def test_a_site_that_a_mapper_lacks_is_logged_once_and_stands_in_the_status_until_all_share_it(caplog) -> None:
    caplog.set_level("INFO")
    told = UnsharedSites()
    for _ in range(2):
        told.note({"m2": ["attic"], "m3": ["attic", "hall"]})
    detail = (
        "mapper 'm2' does not share attic; mapper 'm3' does not share attic, hall: "
        "give every mapper the same --site options"
    )
    assert (told.detail, told.sites) == (detail, 2)
    assert caplog.messages == [detail]
    told.note({})
    assert (told.detail, told.sites) == ("", 0)
    assert caplog.messages[1:] == ["every mapper shares every site again"]


def test_a_second_mapper_of_one_name_is_refused_by_name_and_site(sessions) -> None:
    with (
        closing(Offers(sessions[0], "m1", SITES, threading.Event())),
        pytest.raises(SharingError, match="another mapper named 'm1' shares site 'attic': stop it"),
    ):
        Offers(sessions[1], "m1", SITES, threading.Event(), ghost_goes_within_s=0.0)


def test_a_name_whose_mapper_was_cut_off_is_free_once_its_token_has_gone(sessions) -> None:
    ghost = Offers(sessions[0], "m1", SITES, threading.Event())
    vanishing = threading.Timer(0.7, ghost.close)
    vanishing.start()
    with closing(Offers(sessions[1], "m1", SITES, threading.Event(), ghost_goes_within_s=20.0)) as heir:
        assert heir.members("attic") == {"m1"}
    vanishing.join()
