"""A fleet on this host as noctule-deploy renders it: its routers run, and whoever has a folder can join."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import zenoh

from noctule import bus
from noctule_deploy import fleet, render
from noctule_deploy.render import Place

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
        return bus.open_session(connect, patience_s=5.0, tls_folder=self.folder(common_name))


def rendered(folder: Path, top: str = "", now: datetime | None = None) -> SecuredFleet:
    """The fleet's files, made in ``folder``; ``top`` is what stands above all tables."""
    with socket.socket() as one, socket.socket() as two:
        for each in (one, two):
            each.bind(("127.0.0.1", 0))
        ports = one.getsockname()[1], two.getsockname()[1]
    file = folder / "fleet.toml"
    file.write_text(FLEET.format(top=top, one=ports[0], two=ports[1]))
    place = Place(folder / "rendered", folder / "authority")
    render.render(fleet.load(file), place, now or datetime.now(UTC))
    return SecuredFleet(file, place, ports)


@contextmanager
def running_routers(secured: SecuredFleet) -> Iterator[list[zenoh.Session]]:
    """Both routers, linked, as their folders say."""
    with ExitStack() as closing:
        yield [
            closing.enter_context(bus.open_session(tls_folder=secured.folder(f"router.{name}.g1")))
            for name in ("one", "two")
        ]
