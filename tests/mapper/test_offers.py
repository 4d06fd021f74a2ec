"""Which mappers are ready to map a site: each knows all of them, and no two of one name."""

import threading
from contextlib import closing

import pytest
from system.processes import wait_until

from noctule_mapper.sharing.errors import SharingError
from noctule_mapper.sharing.offers import Offers

SITES = ["attic", "hall"]


def test_each_knows_who_is_ready_to_map_a_site_until_that_one_is_gone(sessions) -> None:
    with closing(Offers(sessions[0], "m1", SITES, threading.Event())) as first:
        assert first.members("hall") == {"m1"}
        with closing(Offers(sessions[1], "m2", ["hall"], threading.Event())) as second:
            wait_until(lambda: first.members("hall") == {"m1", "m2"}, "the second is not seen", 10)
            wait_until(lambda: second.members("hall") == {"m1", "m2"}, "the first is not seen", 10)
            assert first.members("attic") == {"m1"}
            wait_until(first.are_settled, "they don't settle", 10)
        wait_until(lambda: first.members("hall") == {"m1"}, "the second has not gone", 10)
        assert not first.are_settled()


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
