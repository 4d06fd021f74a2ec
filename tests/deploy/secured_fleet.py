"""A fleet on this host as noctule-deploy renders it: its routers run, and a program that has a folder can join."""

import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import zenoh
from system.processes import PATIENCE_S, free_ports, listens, programs, wait_until

from noctule import bus, tls
from noctule_deploy import fleet_file, render
from noctule_deploy.render import Place

FOLDER = "/nowhere/bus"
# The path of zenohd, where there is one: the same tests then run against the real program.
ZENOHD = os.environ.get("NOCTULE_ZENOHD") or shutil.which("zenohd")
FLEET = """
folder = "/nowhere/bus"
{top}
[[router]]
name = "one"
address = "127.0.0.1"
port = {one}
listen = "127.0.0.1"

[[router]]
name = "two"
address = "localhost"
port = {two}
listen = "127.0.0.1"

[[gateway]]
name = "attic"
site = "house"
units = ["u1", "u2"]

[[gateway]]
name = "barn"
site = "farm"
units = ["u1", "u9"]

[[mapper]]
name = "cartographer"
sites = ["house"]

[[operator]]
name = "anna"
sites = ["*"]

[[viewer]]
name = "screen"
sites = ["house"]

[[service]]
name = "alarm"
sites = ["house"]

[[service]]
name = "tracker"
sites = ["house"]
tracks = [{{ site = "house", unit = "u1" }}]
"""


@dataclass(frozen=True)
class SecuredFleet:
    """Where it is rendered, and at which ports its routers are."""

    file: Path
    place: Place
    ports: tuple[int, int]

    def folder(self, common_name: str) -> Path:
        """The folder of a certificate."""
        return self.place.out / common_name

    def endpoint(self, router: int) -> str:
        """Where clients reach the first router (0) or the second."""
        return f"tls/{('127.0.0.1', 'localhost')[router]}:{self.ports[router]}"

    def join(self, common_name: str, *connect: str) -> zenoh.Session:
        """A session with the certificate of that name; the caller closes it."""
        return bus.open_session(connect, patience_s=PATIENCE_S, tls_folder=self.folder(common_name))


def rendered(folder: Path, top: str = "", now: datetime | None = None) -> SecuredFleet:
    """The fleet's files, made in ``folder``; ``top`` is what stands above all tables."""
    one, two = free_ports(2)
    file = folder / "fleet.toml"
    file.write_text(FLEET.format(top=top, one=one, two=two))
    place = Place(folder / "rendered", folder / "authority")
    render.render(fleet_file.load(file), place, now or datetime.now(UTC))
    return SecuredFleet(file, place, (one, two))


@contextmanager
def running_routers(secured: SecuredFleet) -> Iterator[None]:
    """Both routers, linked, as their folders say: in this process, or zenohd where there is one."""
    with ExitStack() as closing:
        if ZENOHD:
            started = closing.enter_context(programs(secured.file.parent))
            for number, name in enumerate(("one", "two")):
                started.start(f"zenohd-{name}", ZENOHD, "-c", str(_with_files_here(secured, name)))
                port = secured.ports[number]
                wait_until(lambda port=port: started.check() or listens(port), "zenohd does not listen")
        else:
            for name in ("one", "two"):
                closing.enter_context(bus.open_session(tls_folder=secured.folder(f"router.{name}.g1")))
        yield


def _with_files_here(secured: SecuredFleet, name: str) -> Path:
    """The router's configuration with the paths of its folder on this host."""
    folder = secured.folder(f"router.{name}.g1")
    copy = secured.file.parent / f"zenohd-{name}.json5"
    copy.write_text((folder / tls.CONFIG).read_text().replace(FOLDER, str(folder)))
    return copy
