"""Hosts as network namespaces of this machine, on one switch, each with a cable that can be pulled.

What a killed test has left behind is removed by the next one. All need root: ``why_not()`` says what is missing.
"""

import contextlib
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import psutil

HOSTS_FILES = Path("/etc/netns")  # `ip netns exec` shows a namespace its own /etc/hosts from here
_SWITCH = "switch"
_NAME = re.compile(r"noctule-(\d+)-\S+")
_LOSS = ("netem", "loss", "20%")
# For a kernel without netem: a link that drops what its queue of one packet can't hold.
_NARROW = ("tbf", "rate", "200kbit", "burst", "1600", "limit", "3200")


@cache
def why_not() -> str:
    """Why there can be no network namespaces here; empty if they work."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if shutil.which("ip") is None:
        return "network namespaces need the command ip (package iproute2)"
    inside = ("-n", _namespace("probe"), "link", "add")
    tries = (
        ("netns", "add", _namespace("probe")),
        (*inside, "bridge", "type", "bridge"),
        (*inside, "one", "type", "veth", "peer", "name", "other"),
    )
    try:
        for words in tries:
            _ip(*words)
    except AssertionError as failed:
        return f"no network of namespaces can be made here: {failed}"
    finally:
        _remove(_namespace("probe"))
    return ""


class Network:
    """A switch and its hosts. A host begins as one whose cable is out and that has no address yet."""

    def __init__(self) -> None:
        self._addresses: dict[str, str] = {}
        _add(_SWITCH)
        _ip("-n", _namespace(_SWITCH), "link", "add", "bridge", "type", "bridge")
        _ip("-n", _namespace(_SWITCH), "link", "set", "bridge", "up")

    def add(self, host: str, address: str) -> None:
        """A host that will have ``address`` once it is plugged in."""
        self._addresses[host] = address
        _add(host)
        port = ("link", "add", host, "type", "veth", "peer", "name", "eth0", "netns", _namespace(host))
        _ip("-n", _namespace(_SWITCH), *port)
        _ip("-n", _namespace(_SWITCH), "link", "set", host, "master", "bridge")

    def within(self, host: str, *command: str) -> list[str]:
        """The command line that runs ``command`` on a host; the process is the command's own."""
        return ["ip", "netns", "exec", _namespace(host), *command]

    def plug(self, host: str) -> None:
        """Put the cable in; the host gets its address, unless it has it already."""
        _ip("-n", _namespace(_SWITCH), "link", "set", host, "up")
        _ip("-n", _namespace(host), "link", "set", "eth0", "up")
        _ip("-n", _namespace(host), "address", "replace", f"{self._addresses[host]}/24", "dev", "eth0")

    def pull(self, host: str) -> None:
        """Pull the cable: the host loses its carrier, and no end of a connection is announced."""
        _ip("-n", _namespace(_SWITCH), "link", "set", host, "down")

    def take_address(self, host: str) -> None:
        """Have a host, whose cable is out, be as after a boot: without address."""
        _ip("-n", _namespace(host), "address", "flush", "dev", "eth0")

    def name(self, host: str, *names: str) -> None:
        """From now on ``host`` can look up the ``names`` of hosts with a domain."""
        lines = "".join(f"{self._addresses[each.partition('.')[0]]} {each}\n" for each in names)
        with _hosts_file(host).open("a") as file:  # the same file: a running program sees it
            file.write(lines)

    def spoil(self, host: str) -> None:
        """Have the cable lose packets in both directions."""
        for namespace, device in ((_SWITCH, host), (host, "eth0")):
            inside = ("tc", "-n", _namespace(namespace), "qdisc", "add", "dev", device, "root")
            if subprocess.run([*inside, *_LOSS], capture_output=True, check=False).returncode != 0:
                subprocess.run([*inside, *_NARROW], capture_output=True, check=True)

    def repair(self, host: str) -> None:
        """Have the cable lose nothing again."""
        for namespace, device in ((_SWITCH, host), (host, "eth0")):
            subprocess.run(["tc", "-n", _namespace(namespace), "qdisc", "delete", "dev", device, "root"], check=True)


@contextlib.contextmanager
def network() -> Iterator[Network]:
    """A network of one test; namespaces, and processes that are left in them, are gone at the end."""
    for name in _present():
        pid = int(name.split("-")[1])
        if pid == os.getpid() or not psutil.pid_exists(pid):
            _remove(name)
    try:
        yield Network()
    finally:
        for name in _present():
            if name.startswith(_namespace("")):
                _remove(name)
        with contextlib.suppress(OSError):  # it is not there, or others are in it
            HOSTS_FILES.rmdir()


def _namespace(host: str) -> str:
    return f"noctule-{os.getpid()}-{host}"


def _hosts_file(host: str) -> Path:
    return HOSTS_FILES / _namespace(host) / "hosts"


def _add(host: str) -> None:
    _ip("netns", "add", _namespace(host))
    _hosts_file(host).parent.mkdir(parents=True, exist_ok=True)
    _hosts_file(host).write_text("127.0.0.1 localhost\n")
    _ip("-n", _namespace(host), "link", "set", "lo", "up")


def _present() -> list[str]:
    """Namespaces, and folders of namespaces that a boot has ended."""
    listed = subprocess.run(["ip", "netns", "list"], capture_output=True, text=True, check=True).stdout.splitlines()
    names = {*listed, *(path.name for path in HOSTS_FILES.glob("noctule-*"))}
    return sorted({match[0] for name in names if (match := _NAME.match(name))})


def _remove(name: str) -> None:
    """Remove a namespace and what runs in it, as far as it is there: another test may be removing it too."""
    inside = subprocess.run(["ip", "netns", "pids", name], capture_output=True, text=True, check=False)
    for pid in inside.stdout.split():
        with contextlib.suppress(ProcessLookupError):
            os.kill(int(pid), signal.SIGKILL)
    deleted = subprocess.run(["ip", "netns", "delete", name], capture_output=True, text=True, check=False)
    assert deleted.returncode == 0 or "No such file" in deleted.stderr, f"{name} stays: {deleted.stderr.strip()}"
    shutil.rmtree(HOSTS_FILES / name, ignore_errors=True)


def _ip(*words: str) -> None:
    ended = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, f"ip {' '.join(words)}: {ended.stderr.strip()}"
