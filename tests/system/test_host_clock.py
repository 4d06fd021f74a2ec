"""The clocks of a real process whose wall clock is set while it runs."""

import os
import subprocess
import sys
from pathlib import Path

from system.histories.host import WallClock

_LOOKS = """
import sys, time
from pathlib import Path
from noctule_gateway.clock.clock_watch import ClockWatch

watch = ClockWatch(Path(sys.argv[1]))
while True:
    watch.keep()
    print(watch.look().epoch, watch.sets, round(time.time()), watch.detail, flush=True)
    time.sleep(0.05)
"""


def test_a_wall_clock_that_is_set_under_a_running_program_begins_an_epoch_and_a_restart_does_not(
    tmp_path: Path,
) -> None:
    clock = WallClock(tmp_path)
    told: list[list[str]] = []

    def looks(until: str) -> str:
        """Run the program until it says ``until``; its epoch then."""
        command = [sys.executable, "-c", _LOOKS, str(tmp_path / "epoch.json")]
        environment = {**os.environ, **clock.environment}
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as running:
            assert running.stdout is not None
            try:
                for line in running.stdout:
                    told.append(line.split(" ", 3))
                    if len(told) == 5 and not told[-1][3].strip():
                        clock.set(hours=-14 * 24.0)
                    if until in line:
                        break
            finally:
                running.kill()
        return told[-1][0]

    after = looks(until="was set back by 1209600 s")
    first, *_, last = told
    assert (first[1], last[1]) == ("0", "1")
    assert first[0] != after
    assert looks(until=f"{after} 0") == after
