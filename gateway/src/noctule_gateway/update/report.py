"""An update on the operator's screen: a bar for each unit, and what became of each."""

from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from noctule.plain_text import plain
from noctule_gateway.errors import GatewayError, LineError
from noctule_gateway.update.image import Image
from noctule_gateway.update.outcome import Current, Updated, describe
from noctule_gateway.update.site import UnitUpdate


class Bars:
    """A bar for each unit, between ``with`` and its end."""

    def __init__(self, console: Console) -> None:
        columns = (
            TextColumn("{task.fields[unit]}"),
            BarColumn(),
            TextColumn("{task.description}"),
            TimeElapsedColumn(),
        )
        self._progress = Progress(*columns, console=console)
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> "Bars":
        self._progress.start()
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._progress.stop()

    def show(self, updates: Sequence[UnitUpdate]) -> None:
        """Show how far the updates are."""
        for update in updates:
            name, updater = update.unit.name, update.updater
            if name not in self._tasks:
                self._tasks[name] = self._progress.add_task("", unit=name)
            progress = updater.progress
            description = progress.step.value if updater.outcome is None else _word(update)
            ended = updater.outcome is not None
            completed = progress.of_pages if ended and not _failed(update) else progress.pages
            self._progress.update(
                self._tasks[name], description=description, completed=completed, total=progress.of_pages
            )


def report(console: Console, updates: Sequence[UnitUpdate], image: Image) -> bool:
    """Say what became of each unit; whether all have the image now."""
    table = Table("unit", "outcome", "")
    for update in updates:
        table.add_row(update.unit.name, _word(update), Text(plain(_detail(update, image))))
    console.print(table)
    return not any(map(_failed, updates))


def _failed(update: UnitUpdate) -> bool:
    return isinstance(update.updater.outcome, GatewayError)


def _word(update: UnitUpdate) -> str:
    match update.updater.outcome:
        case Updated():
            return "updated"
        case Current():
            return "up to date"
    return "failed"


def _detail(update: UnitUpdate, image: Image) -> str:
    outcome = update.updater.outcome
    assert outcome is not None
    told = describe(outcome, image)
    if isinstance(outcome, LineError):
        by_gateway = f"noctule rpc SITE {update.unit.name} update --image FILE"
        told += "" if told.endswith("?") else "."
        return f"{told} A gateway may hold the line: have it do the update, {by_gateway}"
    return told
