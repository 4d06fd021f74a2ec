"""What the environment sets of the demo, and whether it can run like that: everything that is wrong is said at once."""

import errno
import re
import socket
from collections.abc import Mapping
from pathlib import Path

import folder
import psutil
import rooms

DEFAULTS = {
    "ROOM": rooms.USUAL,
    "DEMO_SPEED": "12",  # simulated seconds per second: the walk around the room takes some 8 minutes
    "DEMO_SEED": "1",
    "DEMO_UNIT_PORT": "7101",
    "DEMO_ZENOH_PORT": "7447",
    "DEMO_RERUN_PORT": "9876",
    "DEMO_WEB_PORT": "9090",
    "DEMO_DATA": ".demo",
}
HOST = "127.0.0.1"
_SHOWN_OF_A_COMMAND = 60


def read(environment: Mapping[str, str]) -> dict[str, str]:
    """Every setting by its name."""
    return {name: environment.get(name) or default for name, default in DEFAULTS.items()}


def faults(settings: Mapping[str, str]) -> list[str]:
    """A line for each thing that is in the way of a demo with these settings."""
    found = []
    room, speed, seed = settings["ROOM"], settings["DEMO_SPEED"], settings["DEMO_SEED"]
    if room not in rooms.names():
        found.append(f"ROOM={room}: there is no such room; choose one of {', '.join(rooms.names())}")
    if speed != "max" and not (re.fullmatch(r"\d+(\.\d+)?", speed) and 0.001 <= float(speed) <= 1e6):
        found.append(f"DEMO_SPEED={speed}: write simulated seconds per second, from 0.001 to 1000000, or max")
    if not (_is_whole(seed) and int(seed) < 2**64):
        found.append(f"DEMO_SEED={seed}: write a whole number from 0 to {2**64 - 1}")
    found += _faults_of_ports(settings)
    try:
        folder.check(Path(settings["DEMO_DATA"]))
    except (folder.FolderError, OSError) as error:
        found.append(str(error))
    return found


def _faults_of_ports(settings: Mapping[str, str]) -> list[str]:
    found = []
    users: dict[int, str] = {}
    for name, value in settings.items():
        if not name.endswith("_PORT"):
            continue
        count = _ports(name, settings["ROOM"])
        last = 65536 - count
        if not (_is_whole(value) and 1 <= int(value) <= last):
            found.append(f"{name}={value}: write a port, a whole number from 1 to {last}")
            continue
        for offset in range(count):
            port, user = int(value) + offset, f"{name} + {offset}" if offset else name
            if port in users:
                found.append(f"{users[port]} and {user} are both {port}: each needs a port of its own")
            else:
                users[port] = user
                found += _port_faults(name, port)
    return found


def _ports(name: str, room: str) -> int:
    """How many ports in a row begin at the one of that name: a unit each, where it is the units'."""
    return rooms.units(room) if name == "DEMO_UNIT_PORT" and room in rooms.names() else 1


def _is_whole(text: str) -> bool:
    return text.isascii() and text.isdecimal()


def _port_faults(name: str, port: int) -> list[str]:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return [f"Port {port} is in use by {_holder(port)}: end it, or choose another with {name}=..."]
            return [f"Port {port} can't be used ({error.strerror}): choose another with {name}=..."]
    return []


def _holder(port: int) -> str:
    """Who listens on the port: pid and command, of the whole demo where it is a part of one."""
    pids = {
        connection.pid
        for connection in psutil.net_connections("tcp")
        if connection.laddr and connection.status == psutil.CONN_LISTEN and connection.laddr.port == port
    }
    try:
        process = psutil.Process(min(pid for pid in pids if pid is not None))
        for parent in process.parents():
            if any(argument.endswith("demo/run.py") for argument in parent.cmdline()):
                return f"another demo (pid {parent.pid})"
        return f"pid {process.pid} ({_command(process)})"
    except (ValueError, psutil.Error):
        return "a process of another user"


def _command(process: psutil.Process) -> str:
    """The command as someone would have typed it: without the interpreter and the folders of a script."""
    words = process.cmdline() or [process.name()]
    if len(words) > 1 and re.fullmatch(r"python[\d.]*", Path(words[0]).name) and not words[1].startswith("-"):
        words = words[1:]
    command = " ".join([Path(words[0]).name, *words[1:]])
    return command if len(command) <= _SHOWN_OF_A_COMMAND else f"{command[:_SHOWN_OF_A_COMMAND]} ..."
