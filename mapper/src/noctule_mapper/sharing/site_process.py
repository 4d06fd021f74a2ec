"""One site's mapper as a process of its own, so that what breaks one map breaks no other.

The processes are forked from one that has loaded everything (multiprocessing's forkserver): a start takes no seconds
of computing, and what they do not change they have in memory once.
"""

import logging
import multiprocessing
import os
import threading
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess

from noctule import logs, systemd
from noctule.ending import Ending
from noctule_mapper.live import service
from noctule_mapper.live.process import run_process
from noctule_mapper.live.service import LiveSettings

_FIRST_REST_S, _LONGEST_REST_S = 1.0, 60.0  # before a site's mapper that has failed is started again
_STEADY_AFTER_S = 60.0
_ASK_AGAIN_S = 0.5

_log = logging.getLogger(__name__)


def forking_context() -> ForkServerContext:
    """Where the processes come from."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["noctule_mapper.sharing.preload", __name__])
    return context


class SiteProcess:
    """The mapper of one site, started and ended as its site comes and goes; step() does what is next."""

    def __init__(
        self,
        settings: LiveSettings,
        log_format: logs.LogFormat,
        context: ForkServerContext,
        other_mapper: Callable[[str], str | None],
    ) -> None:
        self.site = settings.site
        self._settings, self._log_format, self._context = settings, log_format, context
        self._other_mapper = other_mapper
        self._process: BaseProcess | None = None
        self._started_at_s = self._not_before_s = 0.0
        self._rest_s = _FIRST_REST_S
        self._waits_for: str | None = None

    @property
    def runs(self) -> bool:
        """There is a process, be it at its end."""
        return self._process is not None

    def step(self, mine: bool) -> None:
        """Start the process if the site is ``mine``, end it if it is not. Waits for nothing but a query's answer."""
        now_s = time.monotonic()
        if self._process is not None and not self._process.is_alive():
            self._note_end(self._process, mine, now_s)
        if self._process is not None and not mine:
            self.end()
        elif self._process is None and mine and now_s >= self._not_before_s and self._is_free(now_s):
            self._start(now_s)

    def end(self) -> None:
        """Tell the process to end, which it does within 5 s."""
        if self._process is not None:
            self._process.terminate()

    def wait(self) -> None:
        """Wait until the process has ended."""
        if self._process is not None:
            self._process.join()
            self._process = None

    def _is_free(self, now_s: float) -> bool:
        """No other maps the site: one that gives it away closes its store first, one that froze may still answer."""
        other = self._other_mapper(self.site)
        if other is not None:
            self._not_before_s = now_s + _ASK_AGAIN_S
            if other != self._waits_for:
                _log.info("site %s is still mapped by %r: waiting for its end", self.site, other)
        self._waits_for = other
        return other is None

    def _start(self, now_s: float) -> None:
        _log.info("maps site %s", self.site)
        process = self._context.Process(
            target=map_site, args=(self._settings, self._log_format), name=f"mapper of {self.site}"
        )
        process.start()
        self._process = process
        self._started_at_s = now_s

    def _note_end(self, ended: BaseProcess, mine: bool, now_s: float) -> None:
        self._process = None
        if not mine:
            _log.info("maps site %s no more", self.site)
            self._rest_s = _FIRST_REST_S
            return
        if now_s - self._started_at_s >= _STEADY_AFTER_S:
            self._rest_s = _FIRST_REST_S
        _log.error(
            "the mapper of site %s ended with %s; it starts again in %g s", self.site, ended.exitcode, self._rest_s
        )
        self._not_before_s = now_s + self._rest_s
        self._rest_s = min(2 * self._rest_s, _LONGEST_REST_S)


def map_site(settings: LiveSettings, log_format: logs.LogFormat) -> None:
    """What such a process does: map until it is told to end, or until the process that it belongs to is gone."""
    os.environ.pop(systemd.SOCKET_VARIABLE, None)  # the service that systemd knows is the process above
    ending = Ending()
    threading.Thread(target=_end_with_parent, args=(ending,), name="parent", daemon=True).start()
    run_process(partial(service.run, settings), log_format, ending, prefix=f"{settings.site}: ")


def _end_with_parent(ending: Ending) -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    ending.begin()
