"""The commands ``repair``, ``check`` and ``backup``: the mapper's store by hand."""

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from noctule.program_options import NAME

Data = Annotated[Path, typer.Argument(metavar="DATA", help="The data folder of a mapper, which may be running.")]


def repair(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="The data folder of a mapper that is stopped.")],
    site: Annotated[str, typer.Option(callback=NAME, help="The site whose store it is.")],
    unit: Annotated[list[str], typer.Option(metavar="UNIT", help="Forget this unit; give more for several.")],
) -> None:
    """Forget a unit's sweeps and how far its log was read; the mapper then reads the log from its oldest sweep on."""
    from noctule.folder_lock import FolderLock, Owner, owner_of
    from noctule_mapper.config import Window
    from noctule_mapper.live.store import SweepStore
    from noctule_mapper.live.store_file import StoreError

    path = data / f"{site}.sqlite3"
    if not path.is_file():
        raise StoreError(f"{data} holds no store of site {site}: give what noctule-mapper run has as --data and --site")
    with (
        FolderLock(data, owner_of(data) or Owner("mapper", site, "repair")),
        closing(SweepStore(path, Window())) as store,
    ):
        if store.damage:
            typer.echo(store.damage)
        for name in dict.fromkeys(unit):
            typer.echo(f"{path.name}: {store.forget(name)} sweeps of {name} and its cursor are forgotten")


def check(data: Data) -> None:
    """Read every row of the store and say what is damaged; exit status 1 if anything is. Changes nothing."""
    _tell(_faults(data))


def _faults(data: Path) -> dict[Path, str]:
    """What is damaged in each store, empty where it is sound. Raises StoreError where there is no store."""
    from noctule import elapsed
    from noctule.progress import progress
    from noctule_mapper.live.store_file import StoreError, fault

    stores = sorted(data.glob("*.sqlite3"))
    if not stores:
        raise StoreError(f"{data} holds no store: give what noctule-mapper run has as --data")
    faults = {}
    with progress() as shown:
        for done, store in enumerate(stores):
            shown.at(f"Reading {store.name}", done, len(stores))
            faults[store] = fault(store, elapsed.now().kernel_boot)
    return faults


def _tell(faults: dict[Path, str]) -> None:
    from noctule_mapper.live.store_file import held

    for store, damage in faults.items():
        typer.echo(f"{store.name}: {damage or f'{held(store)} sweeps, all is sound'}")
    if any(faults.values()):
        raise typer.Exit(1)


def backup(
    data: Data,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the copy; it must not be there yet.")],
) -> None:
    """Copy the store into OUT as it is at one moment, and check the copy; exit status 1 if it is damaged."""
    from noctule.backup import copy_databases, whole_or_nothing
    from noctule.progress import progress

    with whole_or_nothing(out):
        with progress() as shown:
            copy_databases(data, out, shown.at)
        faults = _faults(out)
    _tell(faults)  # a damaged copy stays: nothing better can be had
