"""The table that ``status`` prints."""

from rich.console import Console
from rich.table import Table
from rich.text import Text

from noctule.plain_text import plain
from noctule_deploy.status import Row, State

_WIDE = 1000  # columns
_COLUMNS = ("host", "program", "site", "state", "version", "certificate\nuntil")


def show(rows: list[Row], console: Console | None = None) -> None:
    """Print a line for each row, its state in red where it is not well. On a terminal the complaints stand below the
    table, where there is room for them; in a pipe each stands in its row. No word is cut.
    """
    console = console or Console()
    if not console.is_terminal:
        Console(file=console.file, width=_WIDE).print(_table(rows, with_detail=True))
        return
    console.print(_table(rows, with_detail=False))
    for each in rows:
        if each.detail:
            site = f" ({each.site})" if each.site else ""
            console.print(Text.assemble((each.program, _style(each)), f"{site}: {plain(each.detail)}"))


def _table(rows: list[Row], with_detail: bool) -> Table:
    table = Table()
    for column in (*_COLUMNS, "detail") if with_detail else _COLUMNS:
        table.add_column(column.replace("\n", " ") if with_detail else column, overflow="fold")
    for each in rows:
        until = f"{each.expires:%Y-%m-%d}" if each.expires else ""
        state = Text(each.state, style=_style(each))
        detail = (plain(each.detail),) if with_detail else ()
        cells = (each.host, each.program, each.site, state, each.version, until, *detail)
        table.add_row(*(cell if isinstance(cell, Text) else Text(cell) for cell in cells))
    return table


def _style(row: Row) -> str:
    return "green" if row.state is State.WELL else "red"
