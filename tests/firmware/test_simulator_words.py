"""What noctule-sim tells its operator."""

import contextlib
import os
import pty
import re
import socket
import subprocess
import zlib
from pathlib import Path
from xml.etree import ElementTree

import pytest
from firmware.small_rooms import (
    FACING,
    room_of,
)
from firmware.stepped_unit import IMAGE
from system.processes import ROOT

from noctule.site import load

pytestmark = pytest.mark.usefixtures("firmware")


def test_a_run_begins_with_what_runs(tmp_path):
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nat_s = 1\nkind = "motor_stuck"\n')
    command = ["noctule-sim", "--firmware", str(IMAGE), "--tcp", "127.0.0.1:0", "--seed", "5", "--speed", "max"]
    ended = subprocess.run(
        [*command, "--duration", "0.1", "--faults", str(faults)], capture_output=True, text=True, check=True
    )
    image = b"".join(bytes.fromhex(line[9:-2]) for line in IMAGE.read_text().split() if line[7:9] == "00")
    assert re.search(r"unit 1: socket://127\.0\.0\.1:\d+, ", ended.stdout)
    assert f"{len(image)} bytes, CRC-32 {zlib.crc32(image):08X}" in ended.stdout
    assert "room paper: 5 walls, 1 cylinder, air at 21.0 degrees C" in ended.stdout
    assert "seed 5, as fast as it can for 0.1 s, 1 fault" in ended.stdout
    assert ended.stderr == ""


def test_a_room_is_drawn_without_a_firmware(tmp_path):
    drawing = tmp_path / "room.svg"
    room = room_of(tmp_path, FACING.replace("to_m = [3.0, 3.0]", "to_m = [3.0, 3.0]\nabsorption = 0.7"))
    subprocess.run(["noctule-sim", "--room", room, "--svg", drawing], check=True, cwd=tmp_path)
    words = " ".join(ElementTree.parse(drawing).getroot().itertext())
    assert all(word in words for word in ("room", "unit 1", "unit 2", "absorber", "70 %", "1 m"))


def test_a_site_file_has_the_rooms_units_and_no_other_is_overwritten(tmp_path):
    file = tmp_path / "lounge.toml"
    command = ["noctule-sim", "--room", "lounge", "--tcp", "127.0.0.1:7101", "--speed", "12", "--site", file]
    crowded = subprocess.run([*command, "--units", "3"], capture_output=True, text=True)
    assert (crowded.returncode, "has places for 2 units" in crowded.stderr) == (1, True), crowded.stderr
    subprocess.run(command, check=True)
    made, of_the_demo = load(file), load(ROOT / "deploy/demo/sites/lounge.toml")
    assert (made.name, made.clock, made.units) == (of_the_demo.name, of_the_demo.clock, of_the_demo.units)
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert again.returncode == 1 and "File exists" in again.stderr


def test_a_port_that_is_taken_is_named_with_what_to_do():
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        command = ["noctule-sim", "--firmware", IMAGE, "--tcp", f"127.0.0.1:{port}", "--duration", "0.1"]
        ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 1
    assert f"port {port} is taken, where unit 1 would listen" in ended.stderr
    assert "end the program that listens there, or give another port" in ended.stderr


def read_to_the_end(terminal: int) -> bytes:
    """All that was written to a terminal whose other end is closed: it comes in pieces, and then an error."""
    told = b""
    with contextlib.suppress(OSError):
        while piece := os.read(terminal, 65536):
            told += piece
    return told


def test_a_shell_completes_the_command_line():
    typed = "noctule-sim --fi"
    script = f"""
source <(noctule-sim --completion bash)
COMP_WORDS=({typed}) COMP_CWORD=1 COMP_LINE='{typed}'
_noctule__sim {typed} noctule-sim
echo "${{COMPREPLY[*]}}"
"""
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["--firmware"]


@pytest.mark.parametrize("option", [["--completion", "bash"], ["--registers"]], ids=lambda option: option[0])
def test_what_is_printed_to_a_full_disk_ends_without_a_panic(option):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(["noctule-sim", *option], stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_terminal_is_told_how_far_the_run_has_got():
    leader, follower = pty.openpty()
    command = ["noctule-sim", "--firmware", str(IMAGE), "--tcp", "127.0.0.1:0", "--duration", "1.5"]
    try:
        subprocess.run(command, stdout=subprocess.PIPE, stderr=follower, check=True, timeout=120)
        os.close(follower)
        told = read_to_the_end(leader).decode()
    finally:
        os.close(leader)
    assert re.search(r"\r\x1b\[K\d\.\d s simulated, \d\.\d times real time, \d+ frames", told)
    assert told.endswith("\r\x1b[K")


def test_a_room_with_places_for_two_has_two_units_unless_told_otherwise():
    command = ["noctule-sim", "--firmware", str(IMAGE), "--room", "lounge", "--tcp", "127.0.0.1:0", "--duration", "0.1"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    clocks = re.findall(r"unit (\d): socket:.*sharing the room, clock ([+-]\d\.\d\d) %", told)
    assert [number for number, _ in clocks] == ["1", "2"]
    # README, The world: each its own, by the seed, within 1.5 %
    assert len({fast for _, fast in clocks}) == 2 and all(abs(float(fast)) <= 1.5 for _, fast in clocks)
    exact = subprocess.run([*command, "--exact-clocks"], capture_output=True, text=True, check=True).stdout
    assert "clock" not in exact
    told = subprocess.run([*command, "--units", "1"], capture_output=True, text=True, check=True).stdout
    assert re.findall(r"unit (\d): socket:", told) == ["1"]
