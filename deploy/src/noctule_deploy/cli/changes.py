"""What is to be done after folders were rendered: which to copy, and that routers come first."""

from pathlib import Path

import typer

from noctule_deploy.fleet import ROUTER, Fleet
from noctule_deploy.hosts import programs


def tell(fleet: Fleet, touched: list[Path], none: str = "") -> None:
    """Print it of the folders ``touched``; ``none`` where nothing was."""
    hosts = {each.subject: each.host for each in programs(fleet) if each.subject}
    routers = [each for each in touched if each.name in _of_routers(hosts)]
    unused = {f"gateway.{each.name}" for each in fleet.gateway if each.router}  # it has its router's certificate
    for folder in touched:
        subject = folder.name.rpartition(".")[0]
        if subject not in hosts.keys() | unused:  # the others are in the folders of their hosts
            typer.echo(f"{folder} has changed: copy it to its host")
    if routers or any(folder.name.startswith(f"{ROUTER}.") for folder in touched):
        typer.echo("Copy the routers' folders first and start the routers again: Zenoh reads its rules at the start.")
    elif not touched and none:
        typer.echo(none)


def _of_routers(hosts: dict[str, str]) -> set[str]:
    return {host for subject, host in hosts.items() if subject.startswith(f"{ROUTER}.")}
