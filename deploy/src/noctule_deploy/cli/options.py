"""The options that several commands have, and what they mean together."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

DEFAULT_FLEET, DEFAULT_OUT = Path("fleet.toml"), Path("rendered")

FleetFile = Annotated[Path, typer.Argument(metavar="FLEET.toml", help="The fleet file.")]
Out = Annotated[Path, typer.Option(metavar="DIR", help="Where the rendered folders are.")]
Ca = Annotated[
    Path | None,
    typer.Option("--ca", metavar="DIR", help="Folder of the authority and its key; ca in --out if left out."),
]


def ca_folder(out: Path, ca: Path | None) -> Path:
    """The folder of the authority and its key."""
    return ca or out / "ca"


@contextmanager
def naming_files(out: Path) -> Iterator[None]:
    """A file that the operating system refuses is named, or ``out`` where the error names none; exit status 1."""
    try:
        yield
    except OSError as error:
        sys.exit(f"noctule-deploy: {error.filename or out}: {error.strerror}")
