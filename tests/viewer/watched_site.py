"""A site with a relay and a mapper that draws on it: the paper's room, heard by as many units as are wanted."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mapper.live_site import SITE, LiveSite, live_site, paper_survey
from mapper.room import paper_room
from system.processes import wait_until
from viewer.browser import Screen
from viewer.relay_rig import start_relay
from viewer.room_in_picture import shown_share

from noctule.messages_pb2 import Sweep
from noctule_viewer.relay import Relay

ALL_OF_IT = 0.8  # of the walls' length: labels and units cover some of it; the room upside down has 0.3
EPOCH = "watched"  # of all clocks


@dataclass(frozen=True)
class WatchedSite:
    """A site that somebody watches."""

    live: LiveSite
    relay: Relay

    def start_relay(self) -> None:
        """Start the relay again, at its old address."""
        start_relay(self.live.running, *_of_the_site(self.live), again=self.relay)

    def sweep_as(self, units: int) -> None:
        """Have the paper's room swept by units u1, u2 ..., each a part of it, now."""
        self.live.play(survey_by(units))
        wait_until(lambda: (contour := self.live.client.contour()) is not None and len(contour.walls) == 5, "no room")

    def shows_room(self, shown: Screen) -> bool:
        """Whether the page shows all walls of the room now. The units go on meanwhile."""
        self.live.running.check()
        self.live.play([])  # their statuses
        return shown_share(shown.picture(), paper_room()) > ALL_OF_IT


def survey_by(units: int) -> list[Sweep]:
    """A survey of the paper's room, made just now; unit u1 makes the first sweeps, u2 those after them, and so on."""
    survey = paper_survey()
    for number, sweep in enumerate(survey):
        sweep.unit = f"u{number * units // len(survey) + 1}"
        sweep.clock_epoch = EPOCH
        sweep.start.FromNanoseconds(time.time_ns())
    return survey


@contextmanager
def watched_site(folder: Path) -> Iterator[WatchedSite]:
    """A site that nothing was heard of yet, with relay and mapper; nothing of it is left at the end."""
    with live_site(folder) as live:
        relay = start_relay(live.running, *_of_the_site(live))
        live.start_mapper(rerun=relay.url)
        yield WatchedSite(live, relay)


def _of_the_site(live: LiveSite) -> tuple[str, ...]:
    return "--site", SITE, "--connect", live.endpoint
