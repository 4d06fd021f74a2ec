"""The scanner unit's firmware in the simulator: what a gateway would see at the end of the cable."""

import re
import select
import signal
import socket
import struct
import subprocess
import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
import serial
from cobs import cobs
from system.processes import PATIENCE_S

FIRMWARE = Path(__file__).parents[2] / "firmware"

# firmware/README.md, "Frames"
HELLO, STATUS, SINGLE, ACK = 0x01, 0x02, 0x07, 0x12
HELLO_ANSWER, STATUS_ANSWER, SWEEP = 0x81, 0x82, 0x91
NO_ECHO = 0xFFFFFF
TICKS_PER_SECOND = 4_000_000

# 4 m by 3 m without noise; the unit looks along x.
BOX = """
name = "box"
air_temperature_c = 20.0
[sensor]
lobe = [{ range_m = 0.0, half_angle_deg = 11.25 }]
[[wall]]
from_m = [0.0, 0.0]
to_m = [4.0, 0.0]
[[wall]]
from_m = [4.0, 0.0]
to_m = [4.0, 3.0]
[[wall]]
from_m = [4.0, 3.0]
to_m = [0.0, 3.0]
[[wall]]
from_m = [0.0, 3.0]
to_m = [0.0, 0.0]
[unit]
position_m = [1.5, 1.2]
"""
SPEED_OF_SOUND = 331.3 + 0.606 * 20.0  # m/s

Read = Callable[[], bytes]


class Cable:
    """Frames to and from a unit."""

    def __init__(self, write: Callable[[bytes], object], read: Read):
        self._write = write
        self._read = read
        self._line = bytearray()

    def tell(self, kind: int, payload: bytes) -> None:
        body = bytes([kind]) + payload
        self._write(cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + b"\0")

    def hear(self, *kinds: int) -> tuple[int, bytes]:
        """The next frame of one of these types, its CRC checked."""
        while True:
            while b"\0" not in self._line:
                part = self._read()
                assert part, f"nothing came for {PATIENCE_S:g} s"
                self._line += part
            line, _, self._line = self._line.partition(b"\0")
            if not line:
                continue
            frame = cobs.decode(bytes(line))
            assert zlib.crc32(frame[:-4]) == int.from_bytes(frame[-4:], "little")
            if frame[0] in kinds:
                return frame[0], frame[1:-4]

    def ask_hello(self) -> tuple[int, int]:
        """The unit's serial number and boot number; a unit that is still starting says them by itself."""
        self.tell(HELLO, bytes([77, 3]))
        _, payload = self.hear(HELLO_ANSWER)
        number, _, boot = struct.unpack_from("<I3sH", payload, 2)
        return number, boot


@contextmanager
def simulator(image: Path, *options: str) -> Iterator[list[str]]:
    """A running simulator; gives the addresses of its units."""
    units = int(options[options.index("--units") + 1]) if "--units" in options else 1
    command = ["noctule-sim", "--exact-clocks", "--firmware", str(image), *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            lines = [process.stdout.readline() for _ in range(units)]
            assert all(lines), process.communicate()[1]
            yield [line.split()[2].rstrip(",") for line in lines]
        finally:
            process.send_signal(signal.SIGTERM)
            words = process.communicate(timeout=120)
    assert process.returncode == 0, words


@contextmanager
def tcp_cable(address: str) -> Iterator[Cable]:
    place = re.fullmatch(r"socket://([\d.]+):(\d+)", address)
    assert place
    with socket.create_connection((place[1], int(place[2]))) as connection:

        def read() -> bytes:
            readable, _, _ = select.select([connection], [], [], PATIENCE_S)
            return connection.recv(4096) if readable else b""

        yield Cable(connection.sendall, read)


@contextmanager
def pty_cable(device: str) -> Iterator[Cable]:
    with serial.Serial(device, 115200, timeout=120) as port:
        yield Cable(port.write, lambda: port.read(1))


Open = Callable[..., AbstractContextManager[Cable]]


@pytest.fixture(scope="session")
def image() -> Path:
    made = subprocess.run(["make", "-C", FIRMWARE], capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return FIRMWARE / "build" / "noctule.ihx"


@pytest.fixture
def box(tmp_path: Path) -> Path:
    room = tmp_path / "box.toml"
    room.write_text(BOX)
    return room


@pytest.fixture
def connected(image: Path) -> Open:
    """A simulator with one unit and the cable to it."""

    @contextmanager
    def connect(*options: str) -> Iterator[Cable]:
        with simulator(image, "--tcp", "127.0.0.1:0", *options) as addresses, tcp_cable(addresses[0]) as cable:
            yield cable

    return connect


def sweeps_of(cable: Cable, count: int) -> list[tuple[int, dict[float, int]]]:
    """Waypoint and echoes by bearing in degrees of the next ``count`` sweeps, which are acknowledged.

    One whose acknowledgement came late, from a busy host, is sent again.
    """
    payloads: dict[bytes, bytes] = {}
    while len(payloads) < count:
        _, payload = cable.hear(SWEEP)
        cable.tell(ACK, payload[:14])
        payloads[payload[:14]] = payload
    return list(map(decoded, payloads.values()))


def decoded(payload: bytes) -> tuple[int, dict[float, int]]:
    waypoint, _, _, count = struct.unpack_from("<HhBB", payload, 20)
    readings = [payload[26 + 8 * index : 34 + 8 * index] for index in range(count)]
    assert len(payload) == 26 + 8 * count
    echoes = {}
    for reading in readings:
        bearing = int.from_bytes(reading[:2], "little", signed=True)
        echoes[round(bearing * 360 / 65536 * 2) / 2] = int.from_bytes(reading[5:], "little")
    return waypoint, echoes


def test_hello_is_answered_over_tcp_with_the_serial_number(connected: Open):
    with connected("--speed", "10") as cable:
        assert cable.ask_hello()[0] == 1


def test_each_unit_has_its_own_port_and_serial_number(image: Path):
    with simulator(image, "--tcp", "127.0.0.1:0", "--units", "3", "--speed", "5") as addresses:
        for number, address in enumerate(addresses, start=1):
            with tcp_cable(address) as cable:
                assert cable.ask_hello()[0] == number


def test_hello_is_answered_over_a_pty_that_is_gone_afterwards(image: Path, tmp_path: Path):
    with simulator(image, "--pty", str(tmp_path), "--speed", "5") as addresses:
        assert addresses == [str(tmp_path / "unit-1")]
        with pty_cable(addresses[0]) as cable:
            assert cable.ask_hello()[0] == 1
        with pty_cable(addresses[0]) as cable:
            assert cable.ask_hello()[0] == 1
    assert not (tmp_path / "unit-1").is_symlink()


def test_a_sweep_measures_the_rooms_walls(connected: Open, box: Path):
    with connected("--room", str(box), "--speed", "20") as cable:
        cable.ask_hello()
        cable.tell(SINGLE, bytes([1]))
        ((_, echoes),) = sweeps_of(cable, 1)
    assert len(echoes) == 13
    perpendicular_m = {0.0: 2.5, 90.0: 1.8, -90.0: 1.2}
    for bearing_deg, range_m in perpendicular_m.items():
        ticks = 2 * range_m / SPEED_OF_SOUND * TICKS_PER_SECOND
        assert echoes[bearing_deg] == pytest.approx(ticks, abs=2), bearing_deg
    # The corner at (4, 3) lies 35.8 deg to the left, inside the beam at 45 deg, and nothing else does.
    assert echoes[45.0] == pytest.approx(2 * (2.5**2 + 1.8**2) ** 0.5 / SPEED_OF_SOUND * TICKS_PER_SECOND, abs=2)
    assert echoes[67.5] == NO_ECHO


def test_a_carried_unit_sweeps_once_at_each_waypoint(connected: Open, tmp_path: Path):
    room = tmp_path / "walk.toml"
    path = "[path]\ncorners_m = [[1.5, 1.2], [1.8, 1.2]]\nspacing_m = 0.1\n"
    room.write_text(BOX.split("[unit]")[0] + path)
    with connected("--room", str(room), "--speed", "20") as cable:
        sweeps = sweeps_of(cable, 4)
    assert [waypoint for waypoint, _ in sweeps] == [0, 1, 2, 3]
    for waypoint, echoes in sweeps:
        ticks = 2 * (2.5 - 0.1 * waypoint) / SPEED_OF_SOUND * TICKS_PER_SECOND
        assert echoes[0.0] == pytest.approx(ticks, abs=2)


def test_the_boot_number_counts_up_over_power_ups_of_a_kept_flash(connected: Open, tmp_path: Path):
    boots = []
    for _ in range(3):
        with connected("--speed", "5", "--state", str(tmp_path)) as cable:
            boots.append(cable.ask_hello()[1])
    assert boots == [boots[0], boots[0] + 1, boots[0] + 2]


def test_the_same_seed_gives_the_same_sweep(connected: Open):
    def first_sweep(seed: str) -> dict[float, int]:
        with connected("--room", "paper", "--speed", "20", "--seed", seed) as cable:
            return sweeps_of(cable, 1)[0][1]

    assert first_sweep("5") == first_sweep("5")
    assert first_sweep("5") != first_sweep("6")


def test_a_room_with_an_unknown_field_is_refused_by_name(image: Path, tmp_path: Path):
    room = tmp_path / "attic.toml"
    room.write_text(BOX + "colour = 'red'\n")
    ended = subprocess.run(
        ["noctule-sim", "--firmware", image, "--room", room, "--duration", "0.1"], capture_output=True, text=True
    )
    assert ended.returncode == 1
    assert "attic.toml" in ended.stderr and "colour" in ended.stderr


def test_a_missing_firmware_is_refused_with_what_to_do(tmp_path: Path):
    ended = subprocess.run(["noctule-sim"], capture_output=True, text=True, cwd=tmp_path)
    assert ended.returncode == 1
    assert "make -C firmware" in ended.stderr


def test_twenty_units_in_one_process_have_every_sweep_acknowledged(image: Path):
    command = ["noctule-sim", "--firmware", image, "--units", "20", "--acknowledge", "--speed", "max"]
    ended = subprocess.run([*command, "--duration", "20"], capture_output=True, text=True, timeout=150)
    assert ended.returncode == 0, ended.stderr
    units = re.findall(r"(\d+) sweeps acknowledged, 0 resent, 0 missed, 0 bad frames", ended.stdout)
    assert len(units) == 20 and all(int(sweeps) >= 1 for sweeps in units), ended.stdout
