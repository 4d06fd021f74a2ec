"""What the programs load before they do anything: nobody who asks for help waits for what only the work needs.

The mapper's commands, and what a fit loads, are in tests/mapper/test_loading.py.
"""

import os
import subprocess
import sys
from collections.abc import Mapping

import pytest

_HEAVY = {
    *("numpy", "scipy", "cv2", "numba", "rerun", "matplotlib", "ezdxf", "grpc", "mcap"),
    *("zenoh", "google", "prometheus_client", "cryptography", "pydantic"),
}
_BY_TYPER = {"pydantic"}  # with which Typer checks each value that was typed
_LOADED = """
import sys
from importlib import import_module
module, function = sys.argv[1].split(":")
del sys.argv[:2]
try:
    getattr(import_module(module), function)()
finally:
    print("loaded:", *sorted({name.split(".")[0] for name in sys.modules}), file=sys.stderr)
"""


_PROGRAMS = {
    "noctule": "noctule.cli:app",
    "noctule-gateway": "noctule_gateway.cli:app",
    "noctule-viewer": "noctule_viewer.cli:app",
    "noctule-deploy": "noctule_deploy.cli:main",
}


@pytest.mark.parametrize("program", _PROGRAMS)
def test_help_loads_nothing_that_only_the_work_needs(program: str) -> None:
    """Of no command either, since the program's module has loaded the modules of all."""
    said, loaded = _run(program, "--help")
    assert "Usage:" in said
    assert loaded & _HEAVY == set()


def test_neither_does_the_help_of_a_command_in_a_command() -> None:
    said, loaded = _run("noctule", "rpc", "attic", "u7", "configure", "--help")
    assert "--ramp-s" in said
    assert loaded & _HEAVY <= _BY_TYPER


@pytest.mark.parametrize("program", _PROGRAMS)
def test_neither_does_the_version(program: str) -> None:
    said, loaded = _run(program, "--version")
    assert said.startswith(f"{program} ")
    assert loaded & _HEAVY == set()


@pytest.mark.parametrize("program", _PROGRAMS)
def test_neither_does_the_completion_of_a_command(program: str) -> None:
    asked = {
        f"_{program.upper().replace('-', '_')}_COMPLETE": "complete_bash",
        "COMP_WORDS": f"{program} ",
        "COMP_CWORD": "1",
    }
    said, loaded = _run(program, environment=asked)
    assert {"noctule": "record", "noctule-deploy": "render"}.get(program, "run") in said.split()
    assert loaded & _HEAVY <= _BY_TYPER


def _run(program: str, *typed: str, environment: Mapping[str, str] | None = None) -> tuple[str, set[str]]:
    """What the program prints, and the packages that it has loaded when it is done."""
    command = [sys.executable, "-c", _LOADED, _PROGRAMS[program], program, *typed]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | (environment or {}))
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("loaded:")]
    return done.stdout, set(line.split()[1:])
