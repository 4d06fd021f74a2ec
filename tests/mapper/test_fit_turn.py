"""Turns at fitting, taken by processes as the mappers of several sites are."""

import subprocess
import sys
import threading
from pathlib import Path
from time import monotonic

from system.processes import PATIENCE_S

from noctule_mapper.live import fit_turn
from noctule_mapper.live.fit_turn import FitTurn

HOLD = """
import sys
from pathlib import Path
from noctule_mapper.live.fit_turn import FitTurn
with FitTurn(Path(sys.argv[1])):
    print("has it", flush=True)
    sys.stdin.read()
"""


def test_a_fit_waits_for_its_turn_and_gets_that_of_a_mapper_that_was_killed(tmp_path: Path) -> None:
    path, entered = tmp_path / "fit-turn-0", threading.Event()

    def fit() -> None:
        with FitTurn(path):
            entered.set()

    command = [sys.executable, "-c", HOLD, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "has it\n"
        fitting = threading.Thread(target=fit)
        fitting.start()
        assert not entered.wait(0.2)
        holder.kill()
    assert entered.wait(PATIENCE_S)
    fitting.join()


def test_no_fit_begins_in_a_pause_which_ends_by_itself_and_is_none_after_the_host_was_started_again(
    tmp_path: Path,
) -> None:
    began_s = monotonic()
    fit_turn.pause(tmp_path, 0.3)
    with FitTurn(tmp_path / "fit-turn-0"):
        assert monotonic() - began_s >= 0.3
    fit_turn.pause(tmp_path, 1e5)
    with FitTurn(tmp_path / "fit-turn-0"):
        assert monotonic() - began_s < 60.0
