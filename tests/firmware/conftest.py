"""The firmware's pure modules, built by gcc with sanitizers and run as a child process."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from firmware.images import newer_version

from noctule_gateway.update.admission import Admission
from noctule_gateway.update.image import Image

FIRMWARE = Path(__file__).parents[2] / "firmware"
CORE = FIRMWARE / "src" / "core"
PURE = [
    "backlash",
    "bearing",
    "calibration",
    "check",
    "cobs",
    "crc",
    "gesture",
    "incoming",
    "little_endian",
    "median",
    "plan",
    "ramp",
    "request",
    "ring",
    "turns",
    "wire_layout",
]


class PureModules:
    """Asks pure_modules.c, one line for one answer."""

    def __init__(self, process: subprocess.Popen[str]):
        self._process = process

    def ask(self, command: str, *arguments: object) -> str:
        """The answer's line, without its end; fails with the sanitizer's report when the child dies."""
        assert self._process.stdin is not None and self._process.stdout is not None
        assert self._process.stderr is not None
        self._process.stdin.write(" ".join([command, *map(str, arguments)]) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer, self._process.stderr.read()
        return answer.strip()


@pytest.fixture(scope="session")
def firmware() -> Path:
    """The image of the unit's firmware, built."""
    subprocess.run(["make", "-C", FIRMWARE], check=True, capture_output=True)
    return FIRMWARE / "build" / "noctule.ihx"


@pytest.fixture(scope="session")
def pure_modules(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PureModules]:
    program = tmp_path_factory.mktemp("firmware") / "pure_modules"
    sources = [Path(__file__).with_name("pure_modules.c"), *(CORE / f"{name}.c" for name in PURE)]
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-g"]
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    subprocess.run(["gcc", *flags, *sanitizers, f"-I{CORE}", *sources, "-o", program], check=True)
    with subprocess.Popen(
        [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        yield PureModules(process)
        assert process.stdin is not None
        process.stdin.close()
        try:
            assert process.wait(timeout=120) == 0
        finally:
            process.kill()  # or leaving this block would wait for it without end


@pytest.fixture(scope="session")
def new_image(tmp_path_factory: pytest.TempPathFactory) -> Image:
    """The update to version 0.9.0."""
    return Admission(takes_unsigned=True).load(newer_version(tmp_path_factory.mktemp("new")))
