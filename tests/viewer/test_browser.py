"""The page as people see it, in headless Chromium: the room, the present, and what is not well."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mapper.live_site import SITE
from playwright.sync_api import Browser
from system.processes import wait_until
from viewer.browser import Screen, chromium, screen
from viewer.second_hand import age_s, second_hand
from viewer.watched_site import WatchedSite, survey_by, watched_site

HEADING_ROWS = 60  # of the picture, with the line on top
IN_THE_CYLINDER_M = (1.384, 0.480)  # of the paper's room
FRESH_S = 10  # what a page may lag behind, on a machine that does much else
SWEEP_EACH_S = 16.0  # of a unit of the fleet, as the bench has it


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as made:
        yield made


@pytest.fixture
def site(tmp_path: Path) -> Iterator[WatchedSite]:
    with watched_site(tmp_path) as made:
        yield made


def heading_ends_px(shown: Screen) -> int:
    """The last column of the line on top that has light letters."""
    columns = np.nonzero((shown.picture()[:HEADING_ROWS] > 200).all(axis=-1).any(axis=0))[0]
    return int(columns.max(initial=0))


def is_fresh(shown: Screen) -> bool:
    """What the page shows was drawn a few seconds ago."""
    age = age_s(shown.picture(), time.time())
    return age is not None and age <= FRESH_S


def test_the_page_shows_the_room_as_units_come_and_says_when_mapper_or_relay_are_gone(
    site: WatchedSite, browser: Browser
) -> None:
    running, bar = site.live.running, "#noctule-stale"
    site.sweep_as(1)
    with screen(browser) as shown:
        shown.open(site.relay.page)
        wait_until(lambda: site.shows_room(shown), "the room of one unit is not shown", every_s=1.0)
        with second_hand(site.relay.url, SITE, IN_THE_CYLINDER_M):
            wait_until(lambda: is_fresh(shown), "the page does not show the present")
        site.sweep_as(3)
        wait_until(lambda: site.shows_room(shown), "the room of three units is not shown", every_s=1.0)
        while_well_px = heading_ends_px(shown)
        running.kill("mapper")
        wait_until(lambda: heading_ends_px(shown) > 1.2 * while_well_px, "the mapper is not missed", every_s=1.0)
        assert shown.complaints() == []
        running.kill("viewer")
        wait_until(lambda: shown.page.locator(bar).is_visible(), "the relay is not missed", every_s=1.0)
        with shown.page.expect_event("load"):
            site.start_relay()
        site.live.start_mapper(rerun=site.relay.url)
        wait_until(lambda: site.shows_room(shown), "the room is not shown after the relay's restart", every_s=1.0)
        assert not shown.page.locator(bar).is_visible()


@pytest.mark.soak
def test_the_page_of_twenty_units_keeps_up_with_them(site: WatchedSite, browser: Browser) -> None:
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
            for _ in range(3):
                wait_until(lambda: is_fresh(shown), "the page does not show the present")
                time.sleep(5.0)  # a page that falls behind needs a while to
            wait_until(lambda: site.shows_room(shown), "the room of twenty units is not shown", every_s=1.0)
            assert shown.complaints() == []
    finally:
        ended.set()
        units.join()
