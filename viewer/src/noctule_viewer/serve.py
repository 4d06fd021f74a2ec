"""What runs around a relay: the board of the sites it watches, and the recorder of what it shows."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from noctule import rerun_paths
from noctule.ending import Ending
from noctule.messages_pb2 import ServiceStatus
from noctule_viewer.board.site_plan import SitePlan
from noctule_viewer.board.site_state import SiteState
from noctule_viewer.presence import Presence
from noctule_viewer.recordings.of_relay import recording
from noctule_viewer.recordings.recorder import Recorder, folder_of_recordings
from noctule_viewer.relay import Relay

if TYPE_CHECKING:
    from noctule_viewer.board.board import Board


@dataclass(frozen=True)
class Watched:
    """Sites and the way to them."""

    plans: Sequence[SitePlan]
    connect: Sequence[str]
    tls_folder: Path | None


@dataclass(frozen=True)
class Recorded:
    """Where to record, and how many days of it to keep."""

    folder: Path
    keep_days: int


def serve(
    relay: Relay,
    announce: Callable[[], None],
    watched: Watched | None,
    recorded: Recorded | None,
    metrics: str | None,
    ending: Ending,
) -> int:
    """Run the relay with all that belongs to it, ``announce()`` once it answers. Returns the relay's exit status.

    Raises NoctuleError where something can't be had.
    """
    sites = [(plan, SiteState()) for plan in watched.plans] if watched else []
    recording_id = sites[0][0].site if len(sites) == 1 else rerun_paths.ALL_SITES
    recorders: list[Recorder] = []
    boards: list[Board] = []
    with ExitStack() as around:
        last = around.enter_context(folder_of_recordings(recorded.folder)) if recorded else None
        presences = [
            around.enter_context(Presence(plan.site, state, watched.connect, watched.tls_folder, recording_id))
            for plan, state in sites
            if watched
        ]

        @contextmanager
        def shown() -> Iterator[None]:
            announce()
            with ExitStack() as beside:
                if sites:
                    from noctule_viewer.board.board import Board  # Rerun's SDK takes a second to import

                    boards.append(beside.enter_context(Board(relay.url, sites, recording_id)))
                if recorded:
                    recorders.append(
                        beside.enter_context(recording(relay, recorded.folder, recorded.keep_days, last, bool(sites)))
                    )
                yield

        def show(status: ServiceStatus) -> None:
            troubles = [status.detail, *(recorder.trouble for recorder in recorders)]
            status.detail = "; ".join(filter(None, troubles))
            for presence in presences:
                presence.put(status)

        return relay.run(
            shown,
            metrics,
            ending,
            show,
            lambda: [each for board in boards for each in board.troubles()],
            lambda: max((board.drawn_s for board in boards if board.drawn_s is not None), default=None),
        )
