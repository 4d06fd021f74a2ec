"""The commands ``firmware-key`` and ``firmware-sign``: who vouches for the images that units take."""

import re
from pathlib import Path
from typing import Annotated

import typer

from noctule_deploy.cli.options import naming_files


def firmware_key(
    file: Annotated[Path, typer.Argument(metavar="KEY.pem", help="The new private key; keep it off all hosts.")],
) -> None:
    """Make a key that signs firmware images, and print its public half for the fleet file."""
    from noctule_deploy.firmware_key import make

    with naming_files(file):
        public = make(file)
    typer.echo(f"{file} is the private key: keep it, and a backup, where nobody else can read it.")
    typer.echo("Add its public half to the fleet file, render it, copy the gateways' folders and start them again:\n")
    typer.echo(f'[firmware.keys]\n{re.sub("[^a-z0-9_-]", "-", file.stem.lower())} = "{public}"')


def firmware_sign(
    image: Annotated[Path, typer.Argument(metavar="UPDATE.hex", help="build/update.hex of the firmware.")],
    key: Annotated[Path, typer.Option(metavar="KEY.pem", help="What firmware-key made.")],
) -> None:
    """Sign a firmware image in its place. An image may be signed by several keys, one after the other."""
    from noctule_deploy.firmware_key import sign

    with naming_files(image):
        typer.echo(f"{image} is signed by key {sign(image, key)}")
