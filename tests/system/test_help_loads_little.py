"""What the programs load before they do anything: nobody who asks for help waits for what only the work needs.

The mapper's commands, and what a fit loads, are in tests/mapper/test_loading.py.
"""

import subprocess
import sys

import pytest

_HEAVY = {"numpy", "scipy", "cv2", "numba", "rerun", "matplotlib", "ezdxf", "grpc", "mcap"}
_LOADED = """
import sys
from importlib import import_module
module, function = sys.argv.pop(1).split(":")
try:
    getattr(import_module(module), function)()
finally:
    print("loaded:", *sorted({name.split(".")[0] for name in sys.modules}), file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("program", "command"),
    [
        ("noctule.cli:app", ()),
        ("noctule.cli:app", ("record",)),
        ("noctule.cli:app", ("rpc", "attic", "u7", "start")),
        ("noctule_gateway.cli:app", ("run",)),
        ("noctule_viewer.cli:app", ("run",)),
        ("noctule_deploy.cli:main", ("render",)),
    ],
)
def test_help_loads_nothing_that_only_the_work_needs(program: str, command: tuple[str, ...]) -> None:
    typed = [sys.executable, "-c", _LOADED, program, *command, "--help"]
    done = subprocess.run(typed, check=True, capture_output=True, text=True)
    assert "Usage:" in done.stdout
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("loaded:")]
    assert set(line.split()[1:]) & _HEAVY == set()
