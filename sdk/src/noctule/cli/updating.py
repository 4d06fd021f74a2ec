"""What ``update`` does with a campaign: carry it out unit by unit, and print what became of each."""

import json
from collections import Counter
from collections.abc import Sequence

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from noctule.campaign.campaign import Campaign, Outcome, UnitResult
from noctule.campaign.unit_updates import UnitUpdates, Update
from noctule.client import Client
from noctule.messages_pb2 import UnitStatus
from noctule.plain_text import plain
from noctule.progress import progress


def run(campaign: Campaign, client: Client, given: Update) -> bool:
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


def print_results(campaign: Campaign, as_json: bool) -> None:
    """Print what became of each unit, and the counts on standard error."""
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
