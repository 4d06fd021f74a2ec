"""The command that gives a site's units new firmware, group by group."""

import json
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from noctule.campaign.campaign import Campaign, Outcome, Rules, UnitResult
from noctule.campaign.image_version import version_of
from noctule.campaign.unit_updates import UnitUpdates, Update, candidates
from noctule.cli.joining import DEFAULT_CONNECT, Connect, Tls, joined
from noctule.client import Client
from noctule.messages_pb2 import UnitStatus
from noctule.plain_text import plain
from noctule.progress import progress

SOME_LACK_IT, HALTED, STOPPED = 1, 3, 130  # exit status

TIMEOUT_S = 1800.0  # a quarter of an hour over a line that spoils one byte in twenty
SERVED_WITHIN_S = 30.0


def update(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="build/update.hex.", exists=True, dir_okay=False)],
    site: Annotated[str, typer.Option(help="The site whose units to update.")],
    unit: Annotated[list[str] | None, typer.Option(help="Only this unit; give more for several.")] = None,
    first: Annotated[int, typer.Option(help="Units in the first group.", min=1)] = Rules.first,
    group: Annotated[int, typer.Option(help="Units in each group after it, updated at once.", min=1)] = Rules.group,
    max_failed: Annotated[
        float, typer.Option(help="Halt when more than this share of a group fails.", min=0, max=1)
    ] = Rules.max_failed_share,
    retries: Annotated[int, typer.Option(help="Tries more for those of a group that failed.", min=0)] = Rules.retries,
    force: Annotated[bool, typer.Option("--force", help="Update units that have this version, too.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="JSON lines, one a unit, in place of the table.")] = False,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Annotated[float, typer.Option(help="How long to wait for one unit.")] = TIMEOUT_S,
    served_within_s: Annotated[
        float, typer.Option(help="A unit that does not run it so long after its update has failed.")
    ] = SERVED_WITHIN_S,
) -> None:
    """Give a site's units new firmware: a few first, then group by group.

    Units that have the version are skipped, so the same command goes on with a campaign that was halted or stopped.
    Exit status: 0 all units have it, 1 some do not, 3 halted, 130 stopped by Ctrl-C.
    """
    content = image.read_bytes()
    given = Update(content, version_of(content, str(image)), force, timeout_s, served_within_s)
    rules = Rules(first, group, max_failed, retries, force)
    with joined(site, connect, tls) as client:
        campaign = Campaign(candidates(client, unit or []), given.version, rules)
        stopped = _run(campaign, client, given)
        _print(campaign, as_json)
        if stopped:
            # Threads still wait for gateways over the session, which can't be closed under them.
            sys.stdout.flush()
            os._exit(STOPPED)
    if campaign.halted:
        raise typer.Exit(HALTED)
    if not all(each.runs_the_image for each in campaign.results()):
        raise typer.Exit(SOME_LACK_IT)


def _run(campaign: Campaign, client: Client, given: Update) -> bool:
    """Update group by group, saying of each unit what became of it; whether the operator has stopped it."""
    updates, under_way = UnitUpdates(client), set[str]()
    with progress() as shown:

        def show(status: UnitStatus) -> None:
            if status.unit in under_way:
                results = campaign.results()
                over = sum(each.outcome is not Outcome.NOT_TRIED for each in results)
                shown.at(plain(f"{status.unit}: {status.detail}"), over, len(results))

        client.on_unit_status(show)
        try:
            while units := campaign.next_units():
                under_way.update(units)
                typer.echo(f"updating {', '.join(units)} to {campaign.version}", err=True)
                for done in updates.update(units, given):
                    under_way.discard(done.unit)
                    result = campaign.note(done.unit, done.error, done.detail)
                    typer.echo(plain(f"{result.unit}: {result.outcome}: {result.reason}"), err=True)
        except KeyboardInterrupt:
            campaign.leave(under_way)
            return True
    return False


def _print(campaign: Campaign, as_json: bool) -> None:
    results = campaign.results()
    if as_json:
        for each in results:
            typer.echo(_json_line(each, campaign.version))
    else:
        Console().print(_table(results))
    counts = Counter(each.outcome for each in results)
    told = ", ".join(f"{counts[outcome]} {outcome}" for outcome in Outcome if counts[outcome])
    typer.echo(f"{campaign.version}: {told}", err=True)
    if campaign.halted:
        typer.echo(plain(f"halted: {campaign.halted}"), err=True)


def _json_line(result: UnitResult, version: str) -> str:
    return json.dumps(
        {
            "unit": result.unit,
            "outcome": result.outcome,
            "reason": result.reason,
            "before": result.before,
            "version": version,
            "group": result.group,
            "tries": result.tries,
        }
    )


def _table(results: Sequence[UnitResult]) -> Table:
    table = Table("unit", "group", "tries", "outcome", "")
    for each in results:
        cells = (each.unit, str(each.group or ""), str(each.tries or ""), each.outcome, each.reason or each.before)
        table.add_row(*(Text(plain(cell)) for cell in cells))
    return table
