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

from noctule.errors import NoctuleError
from noctule_deploy import check as checking
from noctule_deploy import firmware_key as firmware_keys
from noctule_deploy import fleet
from noctule_deploy import render as rendering
from noctule_deploy.render import Place

EXAMPLE = "example_fleet.toml"

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Certificates, access rules and configuration of a fleet, all from one file.",
)

FleetFile = Annotated[Path, typer.Option("--fleet", metavar="FLEET.toml", help="The fleet file.")]
Out = Annotated[Path, typer.Option(help="Where the rendered folders are, one for each certificate.")]
Ca = Annotated[Path | None, typer.Option("--ca", help="Folder of the authority and its key; OUT/ca if left out.")]
Subject = Annotated[str, typer.Argument(metavar="NAME", help="Role and name, as in gateway.attic.")]

DEFAULT_FLEET, DEFAULT_OUT = Path("fleet.toml"), Path("rendered")


def main() -> None:
    """Run the command line; what went wrong stands in one line."""
    try:
        app()
    except NoctuleError as error:
        sys.exit(f"noctule-deploy: {error}")


@app.command()
def init(file: Annotated[Path, typer.Argument(metavar="[FLEET.toml]")] = DEFAULT_FLEET) -> None:
    """Write an example of a fleet file, with comments."""
    try:
        with file.open("x") as out:
            out.write(files("noctule_deploy").joinpath(EXAMPLE).read_text())
    except FileExistsError:
        sys.exit(f"noctule-deploy: {file} is there already: edit it, or name another file")
    typer.echo(f"{file} is an example: make it yours, then run noctule-deploy render")


@app.command()
def render(fleet_file: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Make the authority, and for each name its certificate, key and configuration; rules for the routers."""
    with _told(out):
        touched = rendering.render(fleet.load(fleet_file), _place(out, ca), _now())
        _tell(touched, "nothing has changed")


@app.command()
def renew(subject: Subject, fleet_file: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Make a new certificate of a name; the one before it stays admitted until the next renewal or revocation."""
    with _told(out):
        _tell(rendering.renew(fleet.load(fleet_file), _place(out, ca), subject, _now()))


@app.command()
def revoke(subject: Subject, fleet_file: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Admit none of the certificates that a name has had, and make it a new one."""
    with _told(out):
        _tell(rendering.revoke(fleet.load(fleet_file), _place(out, ca), subject, _now()))


@app.command()
def check(fleet_file: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Say what is wrong with what was rendered. Exit status: 0 nothing, 1 something, 3 a certificate expires soon."""
    with _told(out):
        findings = checking.check(fleet.load(fleet_file), _place(out, ca), _now())
    for each in findings:
        typer.echo(each.text)
    if not findings:
        typer.echo("all is well")
    raise typer.Exit(min((each.severity for each in findings), default=0))


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


@contextmanager
def _told(out: Path) -> Iterator[None]:
    """A file that the operating system refuses is named."""
    try:
        yield
    except OSError as error:
        sys.exit(f"noctule-deploy: {error.filename or out}: {error.strerror}")


def _tell(touched: list[Path], none: str = "") -> None:
    for folder in touched:
        typer.echo(f"{folder} has changed: copy it to its host")
    if any(folder.name.startswith(f"{fleet.ROUTER}.") for folder in touched):
        typer.echo("Copy the routers' folders first and start the routers again: Zenoh reads its rules at the start.")
    elif not touched:
        typer.echo(none)


def _place(out: Path, ca: Path | None) -> Place:
    return Place(out, ca or out / "ca")


def _now() -> datetime:
    return datetime.now(UTC)
