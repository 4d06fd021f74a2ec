"""The thread that owns the map: it puts sweeps on as they come, and fits the contour again at a bounded rate."""

import logging
import threading
from collections.abc import Callable, Sequence
from time import monotonic
from typing import Protocol

from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.fit_turn import Turn
from noctule_mapper.live.looks import STUCK_AFTER, Looks
from noctule_mapper.live.map_messages import MapState
from noctule_mapper.live.waiting import Waiting
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message, features_message, tile_message
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.window import Identity

_log = logging.getLogger(__name__)
_FIT = "fit"


class HearsTroubles(Protocol):
    """As Troubles."""

    def begin(self, kind: str, text: str, error: BaseException | None = None) -> None: ...

    def end(self, kind: str, text: str) -> None: ...


class MapWorker:
    """Sweeps in, map states out. A long fit holds up no delivery, and fits take no more than their share of time.

    A sweep that breaks the map (a bug) is set aside, and the map is made again of the others. A fit that fails is told
    and tried again with the next sweeps. What else happens ends the worker, and check() raises it.
    """

    def __init__(
        self,
        config: LiveConfig,
        site: str,
        service: str,
        show: Callable[[MapState], None],
        set_aside: Callable[[SweepReadings, Exception], None],
        troubles: HearsTroubles,
        turn: Turn,
    ) -> None:
        """``show`` is called with each new state and ``set_aside`` with each sweep that broke the map, on the worker's
        thread; a fit that fails, or whose state can't be shown, is among the ``troubles`` until one succeeds. Fits are
        done within ``turn``, and sweeps change the map when it has no pause.
        """
        self._config = config.mapper
        self._mapper = self._empty_map()
        self._pace = config.pace
        self._site, self._service = site, service
        self._show = show
        self._set_aside, self._troubles = set_aside, troubles
        self._turn = turn
        self._changed = threading.Condition()
        self._waiting = Waiting()
        self._failure: BaseException | None = None
        self._oldest_unfitted_s: float | None = None
        self._next_fit_s = monotonic()
        self._steps, self._waits = 0, True  # sweeps and fits begun; whether it has nothing to do
        self._looks = Looks()
        self._figures = {"contours": 0, "contour_failures": 0, "contour_fit_ms": 0, "contour_delay_ms": 0}
        self._thread = threading.Thread(target=self._run, name="map-worker", daemon=True)

    def start(self) -> None:
        """Begin with what has been taken so far."""
        self._thread.start()

    def take(self, left: Sequence[Identity], entered: Sequence[SweepReadings], since_s: float | None = None) -> None:
        """Have sweeps taken off the map and put on it. The first of them came at ``since_s`` (monotonic), now if left
        out. Never waits.
        """
        with self._changed:
            self._waiting.add(left, entered, monotonic() if since_s is None else since_s)
            self._changed.notify_all()

    def check(self) -> None:
        """Raise what has ended the worker, if anything has."""
        if self._failure is not None:
            raise self._failure

    def makes_progress(self) -> bool:
        """It waits, or has not been at one sweep or fit for ten minutes. Called each second."""
        return self._looks.unchanged((self._steps, self._waits)) < STUCK_AFTER or self._waits

    def counters(self) -> dict[str, int]:
        """Contours so far; how long the last one took to fit, and since its oldest new sweep came; sweeps that wait,
        and those that the grid has no room for.
        """
        return self._figures | {"sweeps_waiting": len(self._waiting), "sweeps_off_grid": self._mapper.off_grid}

    def _run(self) -> None:
        try:
            while True:
                self._apply(self._next())
                if self._oldest_unfitted_s is not None and monotonic() >= self._next_fit_s:
                    self._waits = True
                    with self._turn:
                        self._apply(self._take())  # what has come while it waited for its turn
                        self._fit_and_show(self._oldest_unfitted_s)
        except BaseException as error:  # what comes out of Zenoh may be no Exception
            self._failure = error

    def _next(self) -> Waiting:
        """All that waits; nothing when it is time for a fit."""
        self._waits = True
        until_fit_s = None if self._oldest_unfitted_s is None else max(0.0, self._next_fit_s - monotonic())
        with self._changed:
            self._changed.wait_for(lambda: self._waiting.since_s is not None, until_fit_s)
        self._turn.wait_out_pause()  # the sweeps are stored, and their cells can wait
        return self._take()

    def _take(self) -> Waiting:
        """All that waits now."""
        with self._changed:
            waiting, self._waiting = self._waiting, Waiting()
        self._step()
        return waiting

    def _step(self) -> None:
        self._steps, self._waits = self._steps + 1, False

    def _apply(self, waiting: Waiting) -> None:
        """Change the map."""
        for identity in waiting.left:
            self._take_off(identity)
        for readings in waiting.entered.values():
            self._put_on(readings)
        if self._oldest_unfitted_s is None:
            self._oldest_unfitted_s = waiting.since_s

    def _take_off(self, identity: Identity) -> None:
        self._step()
        try:
            self._mapper.remove_sweep(identity)
        except Exception:
            _log.exception("sweep %s could not be taken off the map: it is made again without it", identity)
            self._make_again([sweep for sweep in self._mapper.sweeps() if sweep.identity != identity])

    def _put_on(self, readings: SweepReadings) -> None:
        self._step()
        try:
            self._mapper.register_sweep(readings)
        except Exception as error:
            self._set_aside(readings, error)
            self._make_again([sweep for sweep in self._mapper.sweeps() if sweep.identity != readings.identity])

    def _make_again(self, sweeps: Sequence[SweepReadings]) -> None:
        """The map of ``sweeps`` from nothing, for a change that was broken off may have left anything behind."""
        left = list(sweeps)
        while (number := self._first_that_breaks(left)) is not None:
            del left[number]

    def _first_that_breaks(self, sweeps: Sequence[SweepReadings]) -> int | None:
        """Make the map of ``sweeps``; the place of the first one that breaks it, None where it has come to its end."""
        self._mapper = self._empty_map()
        for number, readings in enumerate(sweeps):
            self._step()
            try:
                self._mapper.register_sweep(readings)
            except Exception as error:
                self._set_aside(readings, error)
                return number
        return None

    def _empty_map(self) -> Mapper:
        """A map whose grid is there from the start, so that a sweep which breaks it is known by its coming."""
        mapper = Mapper(self._config)
        mapper.draw_grid()
        return mapper

    def _fit_and_show(self, oldest_s: float) -> None:
        self._step()
        began_s = monotonic()
        self._oldest_unfitted_s = None
        try:
            self._show(self._fit())
        except Exception as error:
            kind = type(error).__name__
            self._troubles.begin(_FIT, f"the contour can't be fitted ({kind}): the last one stands, see the log", error)
            self._figures["contour_failures"] += 1
        else:
            self._troubles.end(_FIT, "the contour is fitted again")
            self._figures["contours"] += 1
            self._figures["contour_delay_ms"] = round(1e3 * (monotonic() - oldest_s))
        took_s = monotonic() - began_s
        self._figures["contour_fit_ms"] = round(1e3 * took_s)
        self._next_fit_s = began_s + max(self._pace.shortest_interval_s, took_s / self._pace.most_time_share)

    def _fit(self) -> MapState:
        estimate = self._mapper.contour()
        contour = contour_message(estimate, self._site, self._service)
        points = self._mapper.feature_points()
        features = features_message(points, self._site, self._service, time_s=estimate.time_s)
        changed = self._mapper.grid.changed()
        tiles = [tile_message(tile, self._site, self._service, estimate.time_s) for tile in changed]
        return MapState(contour, features, tiles)
