"""The command that gives a site's units new firmware, group by group."""

from pathlib import Path
from typing import Annotated

import typer

from noctule.campaign.campaign import Campaign, Rules
from noctule.cli.options import DEFAULT_CONNECT, Connect
from noctule.ending import leave
from noctule.program_options import NAME, Tls

SOME_LACK_IT, HALTED, STOPPED = 1, 3, 130  # exit status

TIMEOUT_S = 1800.0  # 20 minutes over a line that spoils one byte in twenty
SERVED_WITHIN_S = 30.0


def update(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="build/update.hex.")],
    site: Annotated[str, typer.Option(callback=NAME, help="The site whose units to update.")],
    unit: Annotated[
        list[str] | None, typer.Option(metavar="UNIT", callback=NAME, help="Only this unit; give more for several.")
    ] = None,
    first: Annotated[int, typer.Option(help="Units in the first group.", min=1)] = Rules.first,
    group: Annotated[int, typer.Option(help="Units in each group after it, updated at once.", min=1)] = Rules.group,
    max_failed: Annotated[
        float, typer.Option(help="Halt when more than this share of a group fails.", min=0, max=1)
    ] = Rules.max_failed_share,
    retries: Annotated[
        int, typer.Option(help="How often those of a group that failed are tried again.", min=0)
    ] = Rules.retries,
    force: Annotated[bool, typer.Option("--force", help="Update units that have this version, too.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="JSON lines, one a unit, in place of the table.")] = False,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Annotated[float, typer.Option(help="How many seconds to wait for one unit.")] = TIMEOUT_S,
    served_within_s: Annotated[
        float, typer.Option(help="A unit that does not run it so many seconds after its update has failed.")
    ] = SERVED_WITHIN_S,
) -> None:
    """Give a site's units new firmware: a few first, then group by group.

    Units that have the version are skipped, so the same command goes on with a campaign that was halted or stopped.
    Exit status: 0 all units have it, 1 some do not, 3 halted, 130 stopped by Ctrl-C.
    """
    from noctule.campaign.image_version import version_of
    from noctule.campaign.unit_updates import Update, candidates
    from noctule.cli.joining import joined
    from noctule.cli.updating import print_results, run

    content = image.read_bytes()
    given = Update(content, version_of(content, str(image)), force, timeout_s, served_within_s)
    rules = Rules(first, group, max_failed, retries, force)
    with joined(site, connect, tls) as client:
        campaign = Campaign(candidates(client, unit or []), given.version, rules)
        stopped = run(campaign, client, given)
        print_results(campaign, as_json)
        if stopped:
            # Threads still wait for gateways over the session, which can't be closed under them.
            leave(STOPPED)
    if campaign.halted:
        raise typer.Exit(HALTED)
    if not all(each.runs_the_image for each in campaign.results()):
        raise typer.Exit(SOME_LACK_IT)
