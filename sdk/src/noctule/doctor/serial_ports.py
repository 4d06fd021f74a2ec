"""The serial adapters of a site's units: there, free, ours to use, and never to be taken for one another."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from noctule.doctor.finding import Finding, Level
from noctule.doctor.host import Host, group_of
from noctule.site import Unit

GATEWAY = "noctule-gateway"[:15]  # the kernel keeps 15 characters of a process's name
# Programs that open adapters which they take for their own, and how to keep each away.
_GRABBERS = {
    "ModemManager": "sudo systemctl disable --now ModemManager, or give the adapter ENV{ID_MM_DEVICE_IGNORE}=1 in udev",
    "brltty": "sudo apt-get remove brltty",
}


def check(units: tuple[Unit, ...], host: Host) -> Iterator[Finding]:
    """Look at the adapter of each unit that has one; units behind socket:// or rfc2217:// are passed over."""
    on_adapters = [unit for unit in units if "://" not in unit.address]
    if not on_adapters:
        yield Finding(Level.OK, "serial ports", "no unit is on a serial adapter of this host")
        return
    running = {name for _, name in host.processes()}
    names = Counter(_usb_name(host, each) for each in (host.sys / "class/tty").glob("tty*"))
    for unit in on_adapters:
        about = f"unit {unit.name}, {unit.address}"
        device = host.dev / Path(unit.address).relative_to("/dev") if unit.address.startswith("/dev/") else None
        path = device or Path(unit.address)
        found = list(_unit(path, about, host, running, names))
        yield from found or [Finding(Level.OK, about, "is there and can be used")]


def _unit(path: Path, about: str, host: Host, running: set[str], names: Counter[str]) -> Iterator[Finding]:
    if not path.exists():
        there = ", ".join(str(each) for each in _by_id(host)) or "none"
        yield Finding(Level.FAULT, about, f"is not there: plug it in, or correct the address; adapters here: {there}")
        return
    tty = path.resolve()
    if not host.may_use(tty):
        group = group_of(tty)
        remedy = f"sudo usermod -aG {group} USER, then log in again; in a unit file: SupplementaryGroups={group}"
        yield Finding(Level.FAULT, about, f"may not be used by this user (group {group}): {remedy}")
    holders = host.holders(tty)
    for pid, name in holders:
        if name != GATEWAY:
            yield Finding(Level.FAULT, about, f"is in use by {name} (process {pid}): stop that program")
    for name in sorted(running & _GRABBERS.keys()):
        if name != "ModemManager" or not _ignored_by_modem_manager(host, tty):
            yield Finding(Level.WARNING, about, f"{name} runs and may open it at each plugging-in: {_GRABBERS[name]}")
    yield from _naming(path, tty, about, host, names)


def _naming(path: Path, tty: Path, about: str, host: Host, names: Counter[str]) -> Iterator[Finding]:
    usb_name = _usb_name(host, host.sys / "class/tty" / tty.name)
    by_path = [each for each in _links(host, "by-path") if each.resolve() == tty]
    if usb_name and names[usb_name] > 1 and "by-path" not in path.parts:
        better = f": write {by_path[0]}, which names the socket" if by_path else ": use a path of /dev/serial/by-path"
        text = f"{names[usb_name]} adapters have one name ({usb_name}), so this may be either{better}"
        yield Finding(Level.WARNING, about, text)
    elif usb_name and "serial" not in path.parts:
        by_id = [each for each in _by_id(host) if each.resolve() == tty]
        better = f": write {by_id[0]}" if by_id else ": use a path of /dev/serial/by-id"
        yield Finding(Level.WARNING, about, f"the number {tty.name} may be another adapter's after a restart{better}")


def _usb_name(host: Host, tty: Path) -> str:
    """Vendor, product and serial number of a USB adapter; empty for another port."""
    at = (tty / "device").resolve()
    for folder in (at, *at.parents):
        if not folder.is_relative_to(host.sys.resolve()):
            return ""
        if (folder / "idVendor").is_file():
            parts = [folder / name for name in ("idVendor", "idProduct", "serial")]
            return " ".join(part.read_text().strip() for part in parts if part.is_file())
    return ""


def _ignored_by_modem_manager(host: Host, tty: Path) -> bool:
    """Whether a udev rule keeps ModemManager from the device."""
    try:
        number = (host.sys / "class/tty" / tty.name / "dev").read_text().strip()
        return "E:ID_MM_DEVICE_IGNORE=1" in (host.udev / f"c{number}").read_text().splitlines()
    except OSError:
        return False


def _by_id(host: Host) -> list[Path]:
    return _links(host, "by-id")


def _links(host: Host, kind: str) -> list[Path]:
    folder = host.dev / "serial" / kind
    return sorted(folder.iterdir()) if folder.is_dir() else []
