"""Every program says which version it is, and completes its commands in a shell."""

import re
import subprocess

import pytest

PROGRAMS = ["noctule", "noctule-gateway", "noctule-mapper", "noctule-viewer", "noctule-deploy"]


def said(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_says_its_version(program: str) -> None:
    assert re.fullmatch(rf"{program} \d+\.\d+\.\d+\n", said(program, "--version"))


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_offers_to_complete_its_commands(program: str) -> None:
    assert "--install-completion" in said(program, "--help")
