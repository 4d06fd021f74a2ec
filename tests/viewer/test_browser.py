"""The page as people see it, in headless Chromium: the room, the present, and what is not well."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from mapper.live_site import SITE
from playwright.sync_api import Browser
from viewer.browser import Screen, chromium, screen
from viewer.room_in_picture import says_all_is_well
from viewer.second_hand import age_s, second_hand
from viewer.sick_units import has_words_of_trouble, heard, shows_spots
from viewer.watched_site import WatchedSite, survey_by, watched_site

from noctule.messages_pb2 import UnitStatus

pytestmark = pytest.mark.timeout(1800)  # longer than its waits together, which say what they waited for

IN_THE_CYLINDER_M = (1.384, 0.480)  # of the paper's room
FRESH_S = 45  # what a page may lag behind on a machine that does much else
BETWEEN_S = 10.0  # two pictures of a page that may be frozen: its colours seem fresh again after 56 s
REDRAWN_S = 2.0  # a frozen page's bar seems drawn at the same time, to the second
SWEEP_EACH_S = 16.0  # of a unit of the fleet, as the bench has it


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as made:
        yield made


@pytest.fixture
def site(tmp_path: Path) -> Iterator[WatchedSite]:
    with watched_site(tmp_path) as made:
        yield made


def says_that_all_is_well(site: WatchedSite, shown: Screen) -> bool:
    """The page says so; its units are heard."""
    site.live.play([])  # the units' statuses: they too would be missed
    return says_all_is_well(shown.picture())


def of_another_gateway(site: WatchedSite) -> list[UnitStatus]:
    """The units' statuses by a second gateway: of the two the worse one counts, whatever the first goes on to say."""
    statuses = site.live.client.unit_statuses()
    for status in statuses:
        status.gateway = "second"
    return statuses


def is_fresh(shown: Screen) -> bool:
    """What the page shows was drawn a few seconds ago, and what it shows a while later was drawn after that."""
    first_s = drawn_s(shown)
    if first_s is None:
        return False
    shown.page.wait_for_timeout(1e3 * BETWEEN_S)
    second_s = drawn_s(shown)
    return second_s is not None and second_s > first_s + REDRAWN_S


def knows_its_age(shown: Screen) -> bool:
    """Nothing is old, and the page has been open for longer than it waits to be told by Rerun's viewer."""
    return shown.page.evaluate("performance.now()") > 45_000 and not shown.page.locator("#noctule-stale").is_visible()


def drawn_s(shown: Screen) -> float | None:
    """When what the page shows was drawn, by the clock; None if that is longer ago than FRESH_S."""
    picture = shown.picture()
    taken_s = time.time()  # afterwards: on a busy machine a picture takes seconds, and shows what was drawn meanwhile
    age = age_s(picture, taken_s)
    return None if age is None or age > FRESH_S else taken_s - age


def test_the_page_shows_the_room_as_units_come_and_says_when_the_mapper_is_gone(
    site: WatchedSite, browser: Browser
) -> None:
    site.sweep_as(1)
    with screen(browser) as shown:
        shown.open(site.relay.page)
        shown.wait_for(lambda: site.shows_room(shown), "the room of one unit is not shown")
        with second_hand(site.relay.url, SITE, IN_THE_CYLINDER_M):
            shown.wait_for(lambda: is_fresh(shown), "the page does not show the present")
        shown.wait_for(lambda: knows_its_age(shown), "the page does not know how old what it shows is")
        assert shown.page.evaluate("window.noctuleHeap?.buffer.byteLength ?? 0") > 100e6, (
            "the page does not know how large it is"
        )
        site.sweep_as(3)
        shown.wait_for(lambda: site.shows_room(shown), "the room of three units is not shown")
        shown.wait_for(lambda: says_that_all_is_well(site, shown), "the page does not say that all is well")
        site.live.running.kill("mapper")
        shown.wait_for(lambda: not says_that_all_is_well(site, shown), "the mapper is not missed")
        shown.wait_for(shown.page.locator("#noctule-alarm").is_visible, "the page has no red stripe")
        assert shown.complaints() == []


@pytest.mark.soak
def test_the_page_says_when_the_relay_is_gone_and_shows_the_room_once_it_is_back(
    site: WatchedSite, browser: Browser
) -> None:
    site.sweep_as(3)
    with screen(browser) as shown:
        bar = shown.page.locator("#noctule-stale")
        shown.open(site.relay.page)
        shown.wait_for(lambda: site.shows_room(shown), "the room is not shown")
        site.live.running.kill("viewer")
        shown.wait_for(bar.is_visible, "the relay is not missed")
        with shown.page.expect_event("load"):
            site.start_relay()
        shown.wait_for(lambda: site.shows_room(shown), "the room is not shown after the relay's restart")
        shown.wait_for(lambda: not bar.is_visible(), "the page still says that the relay is gone")


@pytest.mark.soak
def test_the_page_of_twenty_units_keeps_up_with_them_and_shows_which_are_not_well(
    site: WatchedSite, browser: Browser
) -> None:
    site.sweep_as(20)
    ended = threading.Event()

    def go_on() -> None:
        while not ended.is_set():
            for sweep in survey_by(20):
                site.live.play([sweep])
                if ended.wait(SWEEP_EACH_S / 20):
                    return

    units = threading.Thread(target=go_on)
    units.start()
    try:
        with second_hand(site.relay.url, SITE, IN_THE_CYLINDER_M), screen(browser) as shown:
            shown.open(site.relay.page)
            for _ in range(2):  # a page that falls behind needs a while to
                shown.wait_for(lambda: is_fresh(shown), "the page does not show the present")
            shown.wait_for(lambda: site.shows_room(shown), "the room of twenty units is not shown")
            assert not shows_spots(picture := shown.picture()) and not has_words_of_trouble(picture)
            with heard(site.live.endpoint, of_another_gateway(site)):
                shown.wait_for(shown.page.locator("#noctule-alarm").is_visible, "the page has no red stripe")
                shown.wait_for(lambda: shows_spots(shown.picture()), "u7 has no orange spot, or u14 no red one")
                shown.wait_for(lambda: has_words_of_trouble(shown.picture()), "the table does not say what is wrong")
            assert shown.complaints() == []
    finally:
        ended.set()
        units.join()
