"""The command that writes a site's sweeps to a file, all of them."""

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from noctule.cli.options import DEFAULT_CONNECT, Connect, SiteName
from noctule.program_options import Tls, check_folders


def _out(name: str) -> Path:
    from noctule.recording import JOURNAL_SUFFIX
    from noctule.survey import MCAP_SUFFIX

    out = Path(name)
    if out.suffix not in (JOURNAL_SUFFIX, MCAP_SUFFIX):
        raise typer.BadParameter(f"{name} is neither {JOURNAL_SUFFIX} nor {MCAP_SUFFIX}: name it by what it is to be")
    return out


def record(
    site: SiteName,
    out: Annotated[
        Path,
        typer.Argument(parser=_out, metavar="OUT.jsonl|OUT.mcap", help="Goes on where it ends if it is there."),
    ],
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Record every sweep of a site until Ctrl-C, through outages, from where the file ends."""
    from noctule import awake
    from noctule.cli.joining import joined_until
    from noctule.log_follower import LogFollower
    from noctule.progress import progress
    from noctule.read_watch import ReadWatch
    from noctule.recording import Recording

    check_folders(out)
    with (
        awake.told_to_end() as over,
        closing(Recording(out, site)) as recording,
        joined_until(over, site, connect, tls) as client,
        progress() as shown,
    ):
        if client is not None:
            with (
                closing(ReadWatch(client, connect, tls)) as watch,
                LogFollower(client, recording.append, recording.cursors),
            ):
                watch.begin()
                while not over.wait(awake.EVERY_S):
                    units = f"{len(recording.cursors)} unit{'' if len(recording.cursors) == 1 else 's'}"
                    shown.at(f"recording {units}; sweeps since the start", recording.appended)
    held = ", ".join(f"{unit} to {cursor.log_sequence}" for unit, cursor in sorted(recording.cursors.items()))
    typer.echo(f"{out} holds {held or 'no sweeps yet'}", err=True)
