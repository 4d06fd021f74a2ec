"""Every program names the mistakes of a site file in the same lines, each of which begins with the file."""

import subprocess
import sys
from pathlib import Path

import pytest

BIN = Path(sys.executable).parent
SITE = """site = "attic"
colck = "here"
[[unit]]
name = "u1"
seriel = 7
address = "/dev/ttyUSB0"
pose = "unknown"
"""
MISTAKES = [
    "site.toml, line 2: colck is not known here: did you mean clock?",
    "site.toml, line 3: [[unit]] 'u1': serial is missing: add it (did you write it as seriel?)",
]


def stderr(folder: Path, *command: str) -> list[str]:
    """What a command that fails writes on its standard error."""
    (folder / "site.toml").write_text(SITE)
    ended = subprocess.run([BIN / command[0], *command[1:]], cwd=folder, capture_output=True, text=True, check=False)
    assert ended.returncode == 1, ended.stdout
    return ended.stderr.splitlines()


@pytest.mark.parametrize(
    "command",
    [
        "noctule units site.toml",
        "noctule-gateway update site.toml --image update.hex",
        "noctule-mapper survey --site site.toml",
    ],
)
def test_a_command_prints_them(tmp_path: Path, command: str) -> None:
    assert stderr(tmp_path, *command.split()) == MISTAKES


@pytest.mark.parametrize(
    "command", ["noctule-gateway run site.toml --data data", "noctule-viewer run --site site.toml"]
)
def test_a_service_logs_them(tmp_path: Path, command: str) -> None:
    logged = [line.partition(" ERROR ")[2].partition(": ")[2] for line in stderr(tmp_path, *command.split())]
    assert logged == MISTAKES
