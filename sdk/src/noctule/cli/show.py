"""The commands that show a site: its units now, and what comes by."""

import sys
from typing import Annotated

import typer

from noctule.cli.options import DEFAULT_CONNECT, Connect, SiteName
from noctule.program_options import SITE, Tls


def units(
    site: Annotated[
        str, typer.Argument(metavar="SITE|SITE.toml", callback=SITE, help="The site's name, or its site file.")
    ],
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    json: Annotated[bool, typer.Option("--json", help="JSON lines: {unit, served, since, detail, status}.")] = False,
    goes_on: Annotated[
        bool, typer.Option("--watch", help="On a terminal: show it each second, units in trouble first, until Ctrl-C.")
    ] = False,
) -> None:
    """Show a site's units: which gateway serves them, in which state and since when, how long their logs are.

    With the site file, its units that are missing are shown too; without, those that a service has read before.
    Below them are the site's services: gateways, mappers, viewers.
    """
    from noctule.cli.site_table import show_site

    if goes_on and (json or not sys.stdout.isatty()):
        raise typer.BadParameter(
            "needs a terminal: noctule watch SITE prints what comes as lines", param_hint="--watch"
        )
    show_site(site, connect, tls, json, goes_on)


def watch(
    site: SiteName,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    json: Annotated[bool, typer.Option("--json", help="JSON lines: {key, message, value}.")] = False,
) -> None:
    """Show sweeps, statuses and contours as they come, until Ctrl-C or until nobody reads them."""
    from noctule.cli.passing import show_passing

    show_passing(site, connect, tls, json)
