"""The exit status of every program: 1 where the work failed, 2 where the command line itself makes no sense.

The convention is in sdk/README.md, "Exit status".
"""

import subprocess
import sys
from pathlib import Path

import pytest

BIN = Path(sys.executable).parent
PROGRAMS = ("noctule", "noctule-gateway", "noctule-mapper", "noctule-viewer", "noctule-deploy", "noctule-sim")
NOBODY = "--connect tcp/127.0.0.1:1"

FAILS = (  # each command line makes sense; what it names is not there
    f"noctule units attic.toml {NOBODY}",
    f"noctule units attic {NOBODY}",
    f"noctule record attic no-folder/attic.jsonl {NOBODY}",
    f"noctule replay no-file.jsonl --site attic {NOBODY}",
    f"noctule log attic u7 {NOBODY}",
    f"noctule unit-report attic u7 {NOBODY}",
    f"noctule schema noctule.v1.Sweep {NOBODY}",
    f"noctule update no-file.hex --site attic {NOBODY}",
    f"noctule rpc attic u7 status {NOBODY}",
    f"noctule rpc attic u7 update --image no-file.hex {NOBODY}",
    f"noctule doctor attic.toml {NOBODY}",
    "noctule import no-file.csv --angle 1 --range 2",
    "noctule-gateway run attic.toml --data data",
    "noctule-gateway update attic.toml --image no-file.hex",
    "noctule-gateway check no-folder",
    "noctule-gateway repair no-folder",
    "noctule-gateway backup no-folder copy",
    "noctule-mapper fit no-file.jsonl",
    "noctule-mapper fit no-file.jsonl --contour no-folder/contour.json",
    "noctule-mapper export no-file.jsonl attic.dxf",
    "noctule-mapper calibrate no-file.jsonl",
    "noctule-mapper survey --site attic.toml",
    "noctule-mapper run --site attic --data data --config no-file.toml",
    "noctule-mapper check no-folder",
    "noctule-mapper backup no-folder copy",
    "noctule-viewer run --site attic.toml",
    "noctule-viewer run --site attic --floor-plan no-file.dxf",
    "noctule-viewer open no-file.rrd",
    "noctule-viewer days no-folder",
    "noctule-deploy render",
    "noctule-deploy check",
    "noctule-deploy status",
    "noctule-deploy renew gateway.attic",
    "noctule-deploy firmware-sign no-file.hex --key no-file.pem",
    "noctule-sim",
    "noctule-sim --room no-file.toml",
    "noctule-sim --faults no-file.toml",
)
MAKES_NO_SENSE = (  # whatever is there
    "noctule frobnicate",
    "noctule units 'the attic'",
    "noctule units attic --connect router-1",
    "noctule units attic --watch",
    "noctule watch",
    "noctule record attic attic.txt",
    "noctule replay attic.jsonl --site attic --speed lots",
    "noctule replay attic.jsonl --site attic --listen 7447",
    "noctule log attic u7 --from x",
    "noctule rpc attic u7 frobnicate",
    "noctule rpc attic u7 update",
    "noctule import radar.csv --angle 1 --range 2 --pose here",
    "noctule import radar.csv --angle 1 --range 2 --x 3",
    "noctule update update.hex --site attic --max-failed 2",
    "noctule-gateway run attic.toml",
    "noctule-gateway run attic.toml --data data --listen tcp/127.0.0.1",
    "noctule-gateway run attic.toml --data data --metrics here",
    "noctule-gateway run attic.toml --data data --keep-mb 0",
    "noctule-gateway router --listen tcp/127.0.0.1:99999",
    "noctule-mapper run --site attic --data data --rerun relay",
    "noctule-mapper run --site attic --data data --connect router-1",
    "noctule-mapper share --site 'the attic' --data data",
    "noctule-mapper fit attic.jsonl --method best",
    "noctule-mapper export attic.jsonl attic.png",
    "noctule-mapper survey",
    "noctule-viewer run --port 99999",
    "noctule-viewer run --memory-limit lots",
    "noctule-viewer run --memory-limit 1MB",
    "noctule-viewer run --floor-plan attic.dxf",
    "noctule-viewer run --site attic --floor-plan attic.dxf --floor-plan-at here",
    "noctule-viewer run --site attic --floor-plan-at 0,0,90",
    "noctule-viewer open --day 2026-11-28",
    "noctule-viewer open --url http://127.0.0.1",
    "noctule-deploy renew",
    "noctule-sim --units none",
    "noctule-sim --speed 0",
    "noctule-sim --tcp here",
    "noctule-sim --routine x",
    *(f"{program} --frobnicate" for program in PROGRAMS),
    *(program for program in PROGRAMS if program != "noctule-sim"),  # which asks for a command
)


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("empty")


@pytest.mark.parametrize("line", FAILS)
def test_what_is_not_there_is_a_failure_in_words(line: str, empty: Path) -> None:
    status, said = _typed(line, empty)
    assert status == 1, said
    assert said and "Traceback" not in said and "Errno" not in said, said


@pytest.mark.parametrize("line", MAKES_NO_SENSE)
def test_what_makes_no_sense_is_a_mistake_of_the_command_line(line: str, empty: Path) -> None:
    status, said = _typed(line, empty)
    assert status == 2, said
    assert said and "Traceback" not in said, said


def _typed(line: str, folder: Path) -> tuple[int, str]:
    """Exit status of a command line, and all that it printed."""
    done = subprocess.run(
        ["sh", "-c", f"exec {BIN}/{line}"],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=240,
        check=False,
    )
    return done.returncode, done.stdout
