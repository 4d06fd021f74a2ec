"""The demo's settings: everything that is in its way is said at once, a line each."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from settings import DEFAULTS, faults, read
from system.processes import ROOT, free_port_range, free_ports

LISTEN = (
    "import socket, sys; s = socket.create_server(('127.0.0.1', int(sys.argv[1]))); print('up', flush=True); s.accept()"
)


def settings(folder: Path, **changed: str) -> dict[str, str]:
    """Settings with free ports, but for those given."""
    names = [name for name in DEFAULTS if name.endswith("_PORT")]
    ports = dict(zip(names, map(str, free_ports(len(names))), strict=True))
    return read(ports | {"DEMO_DATA": str(folder / "data")} | changed)


def test_nothing_is_in_the_way_of_free_ports_and_a_new_folder(tmp_path: Path) -> None:
    assert faults(settings(tmp_path)) == []
    assert faults(settings(tmp_path, DEMO_SPEED="max", DEMO_SEED=str(2**64 - 1))) == []


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("DEMO_RERUN_PORT", value) for value in ("abc", "-1", "0", "65536", "7447.5", "²")),
        *(("DEMO_SPEED", value) for value in ("fast", "0", "-2", "1e9", "2000000", "nan")),
        *(("DEMO_SEED", value) for value in ("one", "-1", "1.5", str(2**64))),
    ],
)
def test_a_value_that_is_none_is_named_in_one_line(name: str, value: str, tmp_path: Path) -> None:
    (line,) = faults(settings(tmp_path, **{name: value}))
    assert line.startswith(f"{name}={value}: write ")


def test_all_faults_come_at_once_and_as_the_commands_whole_output(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").touch()
    chosen = settings(tmp_path, DEMO_SPEED="fast", DEMO_SEED="x", DEMO_WEB_PORT="abc", DEMO_DATA=str(tmp_path))
    command = [sys.executable, "deploy/demo/run.py"]
    ended = subprocess.run(command, cwd=ROOT, env=os.environ | chosen, capture_output=True, text=True)
    assert ended.returncode == 1
    named = [line.split("=")[0].split(" holds")[0] for line in ended.stderr.splitlines()]
    assert named == ["DEMO_SPEED", "DEMO_SEED", "DEMO_WEB_PORT", str(tmp_path)]
    assert ended.stdout == ""


def test_a_room_that_is_not_there_is_named_with_those_that_are(tmp_path: Path) -> None:
    for room in ("lobby", "Lounge", "../../demo/sites/lounge"):
        (line,) = faults(settings(tmp_path, ROOM=room))
        assert line == f"ROOM={room}: there is no such room; choose one of l-shaped, lounge, paper"


@pytest.mark.parametrize("room", ["l-shaped", "lounge", "paper"])
def test_nothing_is_in_the_way_of_any_room(room: str, tmp_path: Path) -> None:
    first = str(free_port_range(2))
    assert faults(settings(tmp_path, ROOM=room, DEMO_UNIT_PORT=first)) == []


def test_the_port_of_a_rooms_second_unit_must_be_free_too(tmp_path: Path) -> None:
    first = free_port_range(2)
    chosen = settings(tmp_path, ROOM="lounge", DEMO_UNIT_PORT=str(first), DEMO_WEB_PORT=str(first + 1))
    assert faults(chosen) == [
        f"DEMO_UNIT_PORT + 1 and DEMO_WEB_PORT are both {first + 1}: each needs a port of its own"
    ]
    with socket.create_server(("127.0.0.1", first + 1)):
        (line,) = faults(settings(tmp_path, ROOM="lounge", DEMO_UNIT_PORT=str(first)))
        assert line.startswith(f"Port {first + 1} is in use by ")
        assert line.endswith("choose another with DEMO_UNIT_PORT=...")
    (line,) = faults(settings(tmp_path, ROOM="lounge", DEMO_UNIT_PORT="65535"))
    assert line == "DEMO_UNIT_PORT=65535: write a port, a whole number from 1 to 65534"


def test_two_settings_with_one_port_are_named(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    (line,) = faults(settings(tmp_path, DEMO_UNIT_PORT=str(port), DEMO_WEB_PORT=str(port)))
    assert line == f"DEMO_UNIT_PORT and DEMO_WEB_PORT are both {port}: each needs a port of its own"


def test_a_port_in_use_names_pid_and_command_of_its_holder(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    holder = tmp_path / "holder.py"
    holder.write_text(LISTEN)
    with subprocess.Popen([sys.executable, holder, str(port)], stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None and process.stdout.readline()
            (line,) = faults(settings(tmp_path, DEMO_ZENOH_PORT=str(port)))
        finally:
            process.kill()
    expected = f"pid {process.pid} (holder.py {port}): end it, or choose another with DEMO_ZENOH_PORT=..."
    assert line == f"Port {port} is in use by {expected}"


def test_a_port_of_a_running_demo_names_the_demo(tmp_path: Path) -> None:
    """To end the part would not help: the demo would start it again."""
    (port,) = free_ports(1)
    starter = tmp_path / "demo/run.py"
    starter.parent.mkdir()
    starter.write_text(f"import subprocess, sys; subprocess.run([sys.executable, '-c', {LISTEN!r}, '{port}'])")
    with subprocess.Popen([sys.executable, starter], stdout=subprocess.PIPE, start_new_session=True) as process:
        try:
            assert process.stdout is not None and process.stdout.readline()
            (line,) = faults(settings(tmp_path, DEMO_ZENOH_PORT=str(port)))
        finally:
            os.killpg(process.pid, 9)
    assert line.startswith(f"Port {port} is in use by another demo (pid {process.pid}): end it, ")


def test_a_port_whose_last_connection_has_just_been_closed_is_free(tmp_path: Path) -> None:
    """As after an earlier demo: the kernel still holds the closed connection (TIME_WAIT)."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)):
            server.accept()[0].close()
    assert faults(settings(tmp_path, DEMO_WEB_PORT=str(port))) == []
