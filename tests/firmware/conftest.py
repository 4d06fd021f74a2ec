"""The firmware for its chip, its pure modules by gcc with sanitizers, and small programs on the simulated chip."""

import re
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from firmware.images import newer_version
from firmware.small_programs import PREAMBLE, Board, Compile, Run

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
    commands = [Path(__file__).with_name(name) for name in ("pure_modules.c", "pure_ring.c")]
    sources = [*commands, *(CORE / f"{name}.c" for name in PURE)]
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


@pytest.fixture
def compiled(tmp_path: Path) -> Compile:
    """Compiles a C program."""

    def compile_program(program: str) -> Path:
        source = tmp_path / "program.c"
        source.write_text(program)
        memory = ["--xram-size", "4096", "--iram-size", "256"]
        target = tmp_path / "program.ihx"
        subprocess.run(["sdcc", "-mmcs51", *memory, source, "-o", target], check=True, cwd=tmp_path)
        return target

    return compile_program


@pytest.fixture
def running(compiled: Compile, tmp_path: Path) -> Run:
    """Runs the main function that follows the preamble, with a wall 1 m in front of a unit at rest."""
    room = tmp_path / "wall.toml"
    room.write_text(
        "name = 'wall'\nair_temperature_c = 20.0\n[sensor]\n"
        "lobe = [{ range_m = 0.0, half_angle_deg = 179.0 }]\n"
        "[[wall]]\nfrom_m = [1.0, -3.0]\nto_m = [1.0, 3.0]\n[unit]\nposition_m = [0.0, 0.0]\n"
    )

    @contextmanager
    def run(main: str) -> Iterator[Board]:
        image = compiled(PREAMBLE + main)
        command = ["noctule-sim", "--exact-clocks", "--firmware", image, "--room", room, "--tcp", "127.0.0.1:0"]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        with subprocess.Popen([*command, "--speed", "10"], **pipes) as process:
            try:
                assert process.stdout is not None
                address = re.search(r"socket://([\d.]+):(\d+)", process.stdout.readline())
                assert address, process.communicate()[1]
                with socket.create_connection((address[1], int(address[2]))) as connection:
                    yield Board(process, connection)
            finally:
                process.send_signal(signal.SIGTERM)

    return run
