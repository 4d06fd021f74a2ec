"""The table that ``status`` prints."""

from rich.console import Console
from rich.table import Table
from rich.text import Text

from noctule.plain_text import plain
from noctule_deploy.status import Row, State

_WIDE = 240  # columns


def show(rows: list[Row]) -> None:
    """Print a line for each program, in red where it does not fare well."""
    table = Table("host", "program", "site", "state", "version", "certificate until", "detail")
    for each in rows:
        until = f"{each.expires:%Y-%m-%d}" if each.expires else ""
        state = Text(each.state, style="green" if each.state is State.WELL else "red")
        cells = (each.host, each.program, each.site, state, each.version, until, plain(each.detail))
        table.add_row(*(cell if isinstance(cell, Text) else Text(cell) for cell in cells))
    console = Console()
    # Where there is no terminal the words stay whole.
    (console if console.is_terminal else Console(width=_WIDE)).print(table)
