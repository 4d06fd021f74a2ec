"""The command ``noctule-deploy``."""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from noctule.errors import NoctuleError
from noctule.plain_text import plain
from noctule.version_option import version_option
from noctule_deploy import check as checking
from noctule_deploy import firmware_key as firmware_keys
from noctule_deploy import fleet_file, generations
from noctule_deploy import render as rendering
from noctule_deploy import status as fleet_status
from noctule_deploy.errors import FleetFileError
from noctule_deploy.fleet import ROUTER, Fleet
from noctule_deploy.hosts import programs
from noctule_deploy.render import Place
from noctule_deploy.status import Row, State

EXAMPLES = {"fleet.toml": "example_fleet.toml", "house.toml": "example_site.toml"}

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)

FleetFile = Annotated[Path, typer.Argument(metavar="FLEET.toml", help="The fleet file.")]
Out = Annotated[Path, typer.Option(metavar="DIR", help="Where the rendered folders are.")]
Ca = Annotated[
    Path | None,
    typer.Option("--ca", metavar="DIR", help="Folder of the authority and its key; ca in --out if left out."),
]
Subject = Annotated[str, typer.Argument(metavar="NAME", help="Role and name, as in gateway.attic.")]

_WIDE = 240  # columns
DEFAULT_FLEET, DEFAULT_OUT = Path("fleet.toml"), Path("rendered")


def main() -> None:
    """Run the command line; what went wrong stands in one line."""
    try:
        app()
    except FleetFileError as error:
        sys.exit(str(error))  # each of its lines begins with the file
    except NoctuleError as error:
        sys.exit(f"noctule-deploy: {error}")


@app.callback()
def _noctule_deploy(_version: Annotated[bool, version_option("noctule-deploy")] = False) -> None:
    """From one file, all that the hosts of a fleet need: certificates, access rules, services, and how they fare."""


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder; made if missing.")] = Path(),
) -> None:
    """Write an example of a fleet file and its site file, with comments. Both can be rendered as they are."""
    with _told(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in EXAMPLES:
            if (folder / name).exists():
                sys.exit(f"noctule-deploy: {folder / name} is there already: edit it, or name another folder")
        for name, example in EXAMPLES.items():
            (folder / name).write_text(files("noctule_deploy").joinpath(example).read_text())
    written = " and ".join(str(folder / name) for name in EXAMPLES)
    typer.echo(f"{written} are examples: make them yours, then run noctule-deploy render {folder / DEFAULT_FLEET}")


@app.command()
def render(fleet: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Make the authority, all certificates and access rules, and a folder for each host with what it needs.

    What is right already is left as it is.
    """
    with _told(out):
        read = fleet_file.load(fleet)
        _tell(read, rendering.render(read, _place(out, ca), _now()), "nothing has changed")


@app.command()
def renew(subject: Subject, fleet: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Make a new certificate of a name; the one before it stays admitted until the next renewal or revocation."""
    with _told(out):
        read = fleet_file.load(fleet)
        _tell(read, rendering.renew(read, _place(out, ca), subject, _now()))


@app.command()
def revoke(subject: Subject, fleet: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Admit none of the certificates that a name has had, and make it a new one."""
    with _told(out):
        read = fleet_file.load(fleet)
        _tell(read, rendering.revoke(read, _place(out, ca), subject, _now()))


@app.command()
def check(fleet: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Name every mistake in the fleet file, and what is wrong with what was rendered.

    Exit status: 0 all is well, 1 something is wrong, 3 a certificate expires within 30 days.
    """
    with _told(out):
        findings = checking.check(fleet_file.load(fleet), _place(out, ca), _now())
    for each in findings:
        typer.echo(each.text)
    if not findings:
        typer.echo("all is well")
    raise typer.Exit(min((each.severity for each in findings), default=0))


@app.command()
def status(
    fleet: FleetFile = DEFAULT_FLEET,
    out: Out = DEFAULT_OUT,
    tls_folder: Annotated[
        Path | None,
        typer.Option("--tls", metavar="FOLDER", help="Certificate and key; those of an operator in --out if left out."),
    ] = None,
) -> None:
    """Show how every program of the fleet fares, by what it says on the bus.

    Exit status: 0 all is well, 1 something is not, 3 a certificate expires within 30 days.
    """
    with _told(out):
        read, place = fleet_file.load(fleet), _place(out, None)
        known = generations.load(out)
        folder = tls_folder or fleet_status.own_folder(read, place, known)
        heard = fleet_status.listen(read, folder)
        rows = fleet_status.rows(read, heard, fleet_status.expiries(read, place, known), _now())
    _show(rows)
    bad = {each.state for each in rows} - {State.WELL}
    raise typer.Exit(0 if not bad else 3 if bad == {State.EXPIRES} else 1)


@app.command()
def firmware_key(
    file: Annotated[Path, typer.Argument(metavar="KEY.pem", help="The new private key; keep it off all hosts.")],
) -> None:
    """Make a key that signs firmware images, and print its public half for the fleet file."""
    with _told(file):
        public = firmware_keys.make(file)
    typer.echo(f"{file} is the private key: keep it, and a backup, where nobody else can read it.")
    typer.echo("Add its public half to the fleet file, render it, copy the gateways' folders and start them again:\n")
    typer.echo(f'[firmware.keys]\n{re.sub("[^a-z0-9_-]", "-", file.stem.lower())} = "{public}"')


@app.command()
def firmware_sign(
    image: Annotated[Path, typer.Argument(metavar="UPDATE.hex", help="build/update.hex of the firmware.")],
    key: Annotated[Path, typer.Option(metavar="KEY.pem", help="What firmware-key made.")],
) -> None:
    """Sign a firmware image in its place. An image may be signed by several keys, one after the other."""
    with _told(image):
        typer.echo(f"{image} is signed by key {firmware_keys.sign(image, key)}")


def _show(rows: list[Row]) -> None:
    table = Table("host", "program", "site", "state", "version", "certificate until", "detail")
    for each in rows:
        until = f"{each.expires:%Y-%m-%d}" if each.expires else ""
        state = Text(each.state, style="green" if each.state is State.WELL else "red")
        cells = (each.host, each.program, each.site, state, each.version, until, plain(each.detail))
        table.add_row(*(cell if isinstance(cell, Text) else Text(cell) for cell in cells))
    console = Console()
    # Where there is no terminal the words stay whole.
    (console if console.is_terminal else Console(width=_WIDE)).print(table)


@contextmanager
def _told(out: Path) -> Iterator[None]:
    """A file that the operating system refuses is named."""
    try:
        yield
    except OSError as error:
        sys.exit(f"noctule-deploy: {error.filename or out}: {error.strerror}")


def _tell(fleet: Fleet, touched: list[Path], none: str = "") -> None:
    hosts = {each.subject: each.host for each in programs(fleet) if each.subject}
    routers = [each for each in touched if each.name in _of_routers(hosts)]
    for folder in touched:
        subject = folder.name.rpartition(".")[0]
        if subject not in hosts:  # the others are in the folders of their hosts
            typer.echo(f"{folder} has changed: copy it to its host")
    if routers or any(folder.name.startswith(f"{ROUTER}.") for folder in touched):
        typer.echo("Copy the routers' folders first and start the routers again: Zenoh reads its rules at the start.")
    elif not touched and none:
        typer.echo(none)


def _of_routers(hosts: dict[str, str]) -> set[str]:
    return {host for subject, host in hosts.items() if subject.startswith(f"{ROUTER}.")}


def _place(out: Path, ca: Path | None) -> Place:
    return Place(out, ca or out / "ca")


def _now() -> datetime:
    return datetime.now(UTC)
