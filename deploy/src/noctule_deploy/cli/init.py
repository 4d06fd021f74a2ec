"""The command ``init``: the examples that a fleet begins with."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from noctule_deploy.cli.options import DEFAULT_FLEET, naming_files

EXAMPLES = {"fleet.toml": "example_fleet.toml", "house.toml": "example_site.toml"}


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder; made if missing.")] = Path(),
) -> None:
    """Write an example of a fleet file and its site file, with comments. Both can be rendered as they are."""
    from importlib.resources import files

    with naming_files(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in EXAMPLES:
            if (folder / name).exists():
                sys.exit(f"noctule-deploy: {folder / name} is there already: edit it, or name another folder")
        for name, example in EXAMPLES.items():
            (folder / name).write_text(files("noctule_deploy").joinpath(example).read_text())
    written = " and ".join(str(folder / name) for name in EXAMPLES)
    typer.echo(f"{written} are examples: make them yours, then run noctule-deploy render {folder / DEFAULT_FLEET}")
