"""Run the demo: simulated units with their real firmware, gateway, mapper and viewer, all on this machine's loopback.

The processes stand in the Procfile beside this file. The environment may change what settings.DEFAULTS names.
"""

import os
import shlex
import signal
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from string import Template

import folder
import rooms
import settings
from supervisor import SUPERVISOR, end_with_parent, supervise
from terminal import Terminal

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
LAST_LINES_WITHIN_S = 1.0


def main() -> None:
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # under nohup it stays ignored
            signal.signal(number, lambda *_: stop.set())
    end_with_parent()
    chosen = settings.read(os.environ)
    if faults := settings.faults(chosen):
        raise SystemExit("\n".join(faults))
    data = Path(chosen["DEMO_DATA"]).absolute()
    room = chosen["ROOM"]
    try:
        marker = folder.begin(data, rooms.site_file(room, int(chosen["DEMO_UNIT_PORT"])))
    except (folder.FolderError, OSError) as error:
        raise SystemExit(str(error)) from None
    with marker:
        run(chosen | {"DEMO_DATA": str(data), "SITE": rooms.site_name(room)}, stop)


def run(chosen: Mapping[str, str], stop: threading.Event) -> None:
    """Run the processes until ``stop`` is set."""
    commands = processes(HERE / "Procfile", chosen)
    terminal = Terminal([SUPERVISOR, *commands], gone=stop.set)
    say = terminal.say
    say(SUPERVISOR, f"Starting {', '.join(commands)}; the viewer prints the address to open. Ctrl-C ends the demo.")
    os.chdir(ROOT)
    supervise(commands, environment(), stop, say)
    say(SUPERVISOR, "The demo has ended.")
    terminal.close(LAST_LINES_WITHIN_S)


def processes(procfile: Path, chosen: Mapping[str, str]) -> dict[str, list[str]]:
    """The commands of a Procfile by their names, with the settings in place of $NAME."""
    named = (line.split(":", 1) for line in procfile.read_text().splitlines())
    return {name: [Template(word).substitute(chosen) for word in shlex.split(command)] for name, command in named}


def environment() -> dict[str, str]:
    """For the processes: this Python's commands first, and each line printed at once."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return os.environ | {"PATH": path, "PYTHONUNBUFFERED": "1", "NO_COLOR": "1"}


if __name__ == "__main__":
    main()
