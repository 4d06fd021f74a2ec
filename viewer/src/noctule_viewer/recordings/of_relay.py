"""The recorder of a relay: one more Rerun viewer, which saves what it is sent. The relay gets its past back first."""

import logging
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from noctule_viewer import memory_limit
from noctule_viewer.recordings.recorder import STILL_AFTER_S, Recorder
from noctule_viewer.relay import RERUN, Relay, start

_RESTORED_SHARE = 0.5  # of the relay's memory: the other half is for what is drawn now
_RESTORE_WITHIN_S = 120.0

_log = logging.getLogger(__name__)


@contextmanager
def recording(relay: Relay, folder: Path, keep_days: int, last: Path | None, has_board: bool) -> Iterator[Recorder]:
    """Record ``relay`` in ``folder``, after it was given what ``last``, a recording, has of the hours before.

    A recorder that hangs is told by its silence where there is a board, which draws each second.
    """

    def restore() -> None:
        if last is not None:
            _restore(relay, last)

    def write(path: Path) -> subprocess.Popen[bytes]:
        return start([str(RERUN), relay.url, "--bind", "127.0.0.1", "--port", "0", "--save", str(path)])

    still_after_s = STILL_AFTER_S if has_board else None
    with Recorder(folder, keep_days, write, restore, still_after_s=still_after_s) as recorder:
        yield recorder


def _restore(relay: Relay, last: Path) -> None:
    most_bytes = round(_RESTORED_SHARE * memory_limit.in_bytes(relay.memory_limit))
    command = [sys.executable, "-m", "noctule_viewer.recordings.restore", relay.url, str(last), str(most_bytes)]
    with start(command, stderr=subprocess.PIPE) as process:
        try:
            _, told = process.communicate(timeout=_RESTORE_WITHIN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            told = b"it took too long"
    if process.returncode != 0:
        words = told.decode(errors="replace").strip().splitlines()[-1:]
        _log.warning("the hours before are not shown: %s could not be read (%s)", last.name, "".join(words))
