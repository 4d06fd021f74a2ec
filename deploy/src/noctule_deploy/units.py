"""The systemd units of a host's programs and the users that they run as.

What all units have in common is in ``templates/program.service``. What differs is here, each line with its reason.
"""

from collections.abc import Iterable, Mapping
from importlib.resources import files
from pathlib import PurePosixPath
from string import Template

from noctule_deploy.fleet import ROUTER
from noctule_deploy.hosts import WEB, Program

_LOWEST_FREE_PORT = 1024  # those below are root's
_NO_CAPABILITIES = ("CapabilityBoundingSet=", "AmbientCapabilities=")
_NO_DEVICES = ("PrivateDevices=yes", "DevicePolicy=closed")
# A process that no capability and no other user's file concerns sees only its own user.
_ALONE = ("PrivateUsers=yes", "ProtectClock=yes")
_NO_NEW_CODE = ("MemoryDenyWriteExecute=yes",)
_NOTIFIES = ("WatchdogSec=30",)

_LINES: dict[str, tuple[str, ...]] = {
    ROUTER: (*_NO_CAPABILITIES, *_NO_DEVICES, *_ALONE, *_NO_NEW_CODE, "LimitNOFILE=65536"),
    "gateway": (
        *_NOTIFIES,
        *_NO_CAPABILITIES,
        *_NO_NEW_CODE,
        # Serial adapters, which belong to the group dialout, the devices of the site file, and no others.
        "SupplementaryGroups=dialout",
        "DevicePolicy=closed",
        "DeviceAllow=char-ttyUSB rw",
        "DeviceAllow=char-ttyACM rw",
        # It asks the kernel whether the clock is synchronised (adjtimex), and may set nothing: it has no capability.
        "SystemCallFilter=adjtimex clock_adjtime",
        "LimitNOFILE=65536",
    ),
    "mapper": (
        *_NOTIFIES,
        *_NO_CAPABILITIES,
        *_NO_DEVICES,
        *_ALONE,
        # Numba compiles at the first start, so memory becomes code here; what it has compiled is kept.
        "CacheDirectory=noctule/$subject",
        "CacheDirectoryMode=0700",
        "Environment=NUMBA_CACHE_DIR=/var/cache/noctule/$subject",
        # Each map is made in a process of its own, which the mapper starts again when the kernel had no memory for it.
        "OOMPolicy=continue",
    ),
    "viewer": (
        *_NOTIFIES,
        *_NO_CAPABILITIES,
        *_NO_DEVICES,
        *_ALONE,
        *_NO_NEW_CODE,
        # Of setpriv, which binds the relay to its parent and sets the capabilities to what they are: none.
        "SystemCallFilter=capset",
    ),
    WEB: (*_NO_DEVICES, "ProtectClock=yes", *_NO_NEW_CODE, "Environment=XDG_DATA_HOME=/var/lib/noctule/$subject"),
}


def unit(program: Program, web_port: int | None = None, devices: Iterable[str] = ()) -> str:
    """The unit of a program; ``web_port`` is that of a page, ``devices`` are a gateway's."""
    lines = [*_LINES[program.role], *(_ports(web_port) if web_port else ())]
    allowed = [f"DeviceAllow={_quoted(each)} rw" for each in devices]
    service = "\n".join([Template("\n".join(lines)).substitute(subject=program.own), *allowed])
    return _template("program.service").substitute(
        title=f"{program.role} {program.name}",
        type="notify" if program.role in ("gateway", "mapper", "viewer", WEB) else "exec",
        command=" ".join(map(_quoted, program.command)),
        user=program.user,
        subject=program.own,
        service=service,
    )


def users(programs: Iterable[Program]) -> str:
    """What systemd-sysusers makes: a user of its own for each role."""
    lines = {f'u {each.user} - "Noctule {each.role}" /var/lib/noctule' for each in programs}
    return "# Made by noctule-deploy render.\n" + "".join(f"{line}\n" for line in sorted(lines))


def owners(private: Mapping[PurePosixPath, str]) -> str:
    """What systemd-tmpfiles does: files with secrets are their users' only.

    Their folders stay root's: systemd does not trust what root has in a folder of another user.
    """
    lines = (f"z {path} 0600 {user} {user}\n" for path, user in private.items())
    return "# Made by noctule-deploy render.\n" + "".join(lines)


def _ports(port: int) -> tuple[str, ...]:
    """A page on a port of root's needs the right to have it, and that right needs the host's users."""
    if port >= _LOWEST_FREE_PORT:
        return *_NO_CAPABILITIES, "PrivateUsers=yes"
    return "CapabilityBoundingSet=CAP_NET_BIND_SERVICE", "AmbientCapabilities=CAP_NET_BIND_SERVICE"


def _quoted(word: str) -> str:
    """A word of a command line as systemd reads it: ``%`` and ``$`` stand for themselves."""
    escaped = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{escaped}"' if not word or any(letter in word for letter in " \t\"'\\;") else escaped


def _template(name: str) -> Template:
    return Template(files("noctule_deploy").joinpath("templates", name).read_text())
