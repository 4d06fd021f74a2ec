"""How a command that an operator types fails: with one red line, and exit status 1."""

from collections.abc import Iterator
from contextlib import contextmanager

import typer

from noctule.errors import NoctuleError, in_words


@contextmanager
def failing_in_words() -> Iterator[None]:
    """Say in a line what went wrong, and end: bad input, or a file that the system refuses."""
    try:
        yield
    except (NoctuleError, OSError) as error:
        from rich.console import Console

        Console(stderr=True).print(in_words(error), style="red", soft_wrap=True, markup=False)
        raise typer.Exit(1) from error
