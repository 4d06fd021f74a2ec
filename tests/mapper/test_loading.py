"""What commands load before they do anything: nobody who asks for help waits for compilers, viewers or the bus."""

import subprocess
import sys
from pathlib import Path

import pytest
from mapper.live_site import paper_survey

from noctule import survey

COMMANDS = ("run", "fit", "calibrate", "survey", "export", "reproduce")
_LOADED = """
import sys
from noctule_mapper.cli import main
try:
    main(sys.argv[1:])
finally:
    print("loaded:", *sorted(sys.modules), file=sys.stderr)
"""

_MAPPED = """
import sys, threading
from pathlib import Path
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.nursery import Nursery
from noctule_mapper.live.service import LiveSettings, run
stop = threading.Event()
stop.set()
run(LiveSettings("attic", "mapper", Path(sys.argv[1]), [], None, LiveConfig()), stop, Nursery(print))
print("rerun" in sys.modules)
"""


def loaded_by(*arguments: object) -> set[str]:
    """The packages and modules that ``noctule-mapper`` has loaded when it is done."""
    command = [sys.executable, "-c", _LOADED, *map(str, arguments)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("loaded:")]
    return set(line.split()[1:])


@pytest.mark.parametrize("command", [(), *((name,) for name in COMMANDS)])
def test_help_loads_nothing_that_only_the_work_needs(command: tuple[str, ...]) -> None:
    heavy = {"numpy", "scipy", "cv2", "numba", "rerun", "matplotlib", "zenoh", "google", "ezdxf"}
    assert loaded_by(*command, "--help") & heavy == set()


def test_a_fit_loads_neither_compiler_nor_viewer_nor_bus_nor_scipy(tmp_path: Path) -> None:
    source = tmp_path / "survey.jsonl"
    with source.open("w") as stream:
        survey.write(paper_survey(), stream)
    loaded = loaded_by("fit", source, "--contour", tmp_path / "contour.json")
    assert "numpy" in loaded
    assert loaded & {"scipy", "numba", "llvmlite", "rerun", "matplotlib", "cv2", "zenoh", "tomlkit"} == set()
    others = ("grid.grid", "paper.walls", "placement.unknown_poses")  # for other methods and other surveys
    assert loaded & {f"noctule_mapper.{module}" for module in others} == set()


def test_a_mapper_that_nobody_watches_does_not_load_the_viewer(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", _MAPPED, tmp_path], check=True, capture_output=True, text=True)
    assert done.stdout == "False\n"
    assert (tmp_path / "attic.sqlite3").exists()
