"""The command ``survey``: where the units are by what they hear of the room, into the site file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from noctule.program_options import ENDPOINT

if TYPE_CHECKING:
    from noctule.messages_pb2 import Contour


def survey(
    site: Annotated[Path, typer.Option(help="Site file of the units.")],
    sweeps: Annotated[
        Path | None,
        typer.Argument(
            metavar="SURVEY", help="Sweeps as JSON lines, or MCAP by suffix; without, the site's mapper is asked."
        ),
    ] = None,
    write: Annotated[bool, typer.Option("--write", help="Write the poses into the site file.")] = False,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="UNIT", help="Write only this unit; give more for several. A pose that is called wrong needs it."
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(metavar="ENDPOINT", callback=ENDPOINT, help="A router; give more for a fallback."),
    ] = None,
    tls: Annotated[
        Path | None,
        typer.Option(envvar="NOCTULE_TLS", metavar="FOLDER", help="Certificate and key, as noctule-deploy makes them."),
    ] = None,
    sensor: Annotated[Path | None, typer.Option(help="TOML file of the survey's sensor.")] = None,
) -> None:
    """Show where a site's fixed units are, by what they hear of the room; --write puts that into the site file."""
    from noctule import site as site_file
    from noctule.plain_text import plain
    from noctule_mapper.calibration.site_edit import write_edits
    from noctule_mapper.calibration.unit_survey import edits, unit_verdicts

    loaded = site_file.load(site)
    contour = _running(loaded.name, connect, tls) if sweeps is None else _fitted(sweeps, sensor)
    verdicts = unit_verdicts(contour, loaded, site, unit or ())
    for verdict in verdicts:
        print(plain(f"{verdict.unit}: {verdict.said}"))
        if verdict.fields:
            print(f"    pose = {{ {', '.join(f'{key} = {value:g}' for key, value in verdict.fields.items())} }}")
    changes = edits(verdicts, site)
    if not changes:
        print(f"Nothing to change in {site}.")
    elif not write:
        print(f"Nothing written: --write puts this into {site}.")
    else:
        write_edits(site, changes)
        print(f"Written to {site}: restart the gateway, so that sweeps state these poses.")


def _fitted(sweeps: Path, sensor: Path | None) -> "Contour":
    from noctule import survey as survey_file
    from noctule.progress import progress
    from noctule_mapper.live.config import load_sensor
    from noctule_mapper.survey_fit import fit

    with progress() as shown:
        return fit(survey_file.read(sweeps), sensor=load_sensor(sensor) if sensor else None, progress=shown)


def _running(name: str, connect: list[str] | None, tls: Path | None) -> "Contour":
    from noctule import bus
    from noctule.client import Client
    from noctule_mapper.calibration.unit_survey import UnitSurveyError

    with (
        bus.closing(bus.open_session(connect or [], patience_s=2.0, tls_folder=tls)) as session,
        Client(name, session=session) as client,
    ):
        contour = client.contour()
    if contour is None:
        raise UnitSurveyError(f"no mapper has a contour of site {name!r}: start noctule-mapper run, or give a survey")
    return contour
