"""How a command fails: it says in a line what is wrong."""

import sys
from typing import NoReturn

import typer


def fail(message: str, status: int = 1) -> NoReturn:
    """End with ``status``, after the line."""
    print(f"noctule-viewer: {message}", file=sys.stderr)
    raise typer.Exit(status)
