"""One site's mapper as a process of its own, so that what breaks one map breaks no other.

The processes are forked from one that has loaded everything (multiprocessing's forkserver): a start takes no seconds
of computing, and what they do not change they have in memory once.
"""

import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from multiprocessing import forkserver
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess

from noctule import logs, systemd
from noctule_mapper.live import service
from noctule_mapper.live.map_process import run_map
from noctule_mapper.live.nursery import Nursery
from noctule_mapper.live.process import run_process
from noctule_mapper.live.rest import Rest
from noctule_mapper.live.service import LiveSettings
from noctule_mapper.sharing.heartbeat import Heartbeat

_ASK_AGAIN_S = 0.5
SILENCE = ""  # in place of a mapper's name: nobody has said in time whether one maps the site
SILENT_S = 3.0
HANGS_AFTER_S = 30.0  # without progress, while this process ran
STARTS_WITHIN_S = 300.0  # in the same way: a large store is checked and read

_log = logging.getLogger(__name__)


def forking_context() -> ForkServerContext:
    """Where the processes come from. It loads what they need from now on, and not when a site is to be taken over."""
    context = multiprocessing.get_context("forkserver")
    # A process loads the main module again (spawn.prepare): what that imports is there already.
    context.set_forkserver_preload([__name__, "noctule_mapper.cli", "noctule_mapper.sharing.preload"])
    forkserver.ensure_running()
    return context


class SiteProcess:
    """The mapper of one site, started and ended as its site comes and goes; step() does what is next."""

    def __init__(
        self,
        settings: LiveSettings,
        log_format: logs.LogFormat,
        context: ForkServerContext,
        hangs_after_s: float = HANGS_AFTER_S,
        starts_within_s: float = STARTS_WITHIN_S,
        *,
        last_contour: Callable[[str], bytes] = lambda _site: b"",
    ) -> None:
        """``last_contour`` gives the last contour of a site, as in LiveSettings."""
        self.site = settings.site
        self.failed = 0  # how often it ended though nobody wanted that
        self.restarts = False  # whether the next start is one after such an end, and not a takeover
        self._settings, self._log_format, self._context = settings, log_format, context
        self._last_contour = last_contour
        self._hangs_after_s, self._starts_within_s = hangs_after_s, starts_within_s
        self._heartbeat = Heartbeat()
        self._process: BaseProcess | None = None
        self._is_killed = False  # and may be at its end for a while, on a busy machine
        self._started_at_s = self._not_before_s = 0.0
        self._rest = Rest()
        self._waits_for: str | None = None
        self._silent_since_s: float | None = None

    @property
    def pid(self) -> int | None:
        """The process, be it at its end; None where there is none."""
        return None if self._process is None else self._process.pid

    def is_due(self, mine: bool, now_s: float) -> bool:
        """The process would be started, if no other maps the site."""
        return mine and self._process is None and now_s >= self._not_before_s

    def step(self, mine: bool, other: str | None, now_s: float) -> None:
        """Start the process if the site is ``mine`` and no ``other`` maps it, end it if it is not mine. Never waits."""
        self.restarts = self.restarts and mine
        if self._process is not None and not self._process.is_alive():
            self._note_end(self._process, mine, now_s)
        if self._process is not None:
            silent_s = self._heartbeat.silent_s(now_s)
            most_s = self._hangs_after_s if self._heartbeat.is_ready else self._starts_within_s
            if silent_s >= most_s and not self._is_killed:
                _log.error("the mapper of site %s has made no progress for %.0f s: it is killed", self.site, silent_s)
                self._process.kill()
                self._is_killed = True
            elif not mine:
                self.end()
        elif self.is_due(mine, now_s) and self._is_free(other, now_s):
            self._start(now_s)

    def end(self) -> None:
        """Tell the process to end, which it does within 5 s."""
        if self._process is not None:
            self._process.terminate()

    def wait(self, until_s: float) -> None:
        """Wait until the process has ended, and kill it at ``until_s`` (monotonic): what it has stored is whole."""
        if self._process is not None:
            self._process.join(max(0.0, until_s - time.monotonic()))
            if self._process.is_alive():
                _log.error("the mapper of site %s does not end: it is killed; nothing stored is lost", self.site)
                self._process.kill()
                self._process.join()
            self._process = None
        self._heartbeat.close()

    def _is_free(self, other: str | None, now_s: float) -> bool:
        """No other maps the site: one that gives it away closes its store first, one that froze may still answer.

        SILENCE counts as nobody after SILENT_S, because it may be that of any program of the site.
        """
        if other != SILENCE:
            self._silent_since_s = None
        else:
            self._silent_since_s = now_s if self._silent_since_s is None else self._silent_since_s
            if now_s - self._silent_since_s >= SILENT_S:
                _log.warning("nobody has said within %g s whether site %s is mapped: it is now", SILENT_S, self.site)
                self._silent_since_s = None
                return True
        if other is not None:
            self._not_before_s = now_s + _ASK_AGAIN_S
            if other != self._waits_for:
                told = "its statuses are not answered in time" if other == SILENCE else f"{other!r} still maps it"
                _log.info("site %s waits: %s", self.site, told)
        self._waits_for = other
        return other is None

    def _start(self, now_s: float) -> None:
        _log.info("maps site %s", self.site)
        self._heartbeat.begin(now_s)
        settings = replace(self._settings, last_contour=self._last_contour(self.site))
        process = self._context.Process(
            target=map_site,
            args=(settings, self._log_format, self._heartbeat.address),
            name=f"mapper of {self.site}",
        )
        process.start()
        self._process, self._is_killed, self.restarts = process, False, False
        self._started_at_s = now_s

    def _note_end(self, ended: BaseProcess, mine: bool, now_s: float) -> None:
        self._process = None
        if not mine:
            _log.info("maps site %s no more", self.site)
            self._rest.forget()
            return
        self.failed, self.restarts = self.failed + 1, True
        rest_s = self._rest.after(now_s - self._started_at_s)
        _log.error("the mapper of site %s ended with %s; it starts again in %g s", self.site, ended.exitcode, rest_s)
        self._not_before_s = now_s + rest_s


def map_site(settings: LiveSettings, log_format: logs.LogFormat, heartbeat: str) -> None:
    """What such a process does: map until SIGTERM, or until the process that it belongs to is gone.

    ``heartbeat`` is the address at which that process listens, in systemd's place.
    """
    os.environ[systemd.SOCKET_VARIABLE] = heartbeat
    prefix = f"{settings.site}: "
    nursery = Nursery(run_map, log_format, prefix)
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()
    run_process(partial(service.run, settings, nursery=nursery), log_format, prefix=prefix)


def _end_with_parent() -> None:
    """When the parent is killed, end at once: others wait for the site, and what is stored is whole."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGKILL)
