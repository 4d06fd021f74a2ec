"""The command that has a unit carry out a command."""

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from noctule import survey
from noctule.cli.joining import DEFAULT_CONNECT, Connect, SiteName, Tls, UnitName, joined
from noctule.client import Client
from noctule.errors import BusError
from noctule.messages_pb2 import Calibration, CommandReply, CommandRequest, SweepPlan, UnitStatus

COMMANDS = (
    *("hello", "status", "settings", "start", "stop", "single", "home", "go_to", "set_waypoint"),
    *("configure", "calibrate", "trim_temperature", "store", "reset", "update"),
)
MAX_COUNT = 0xFFFF  # no count on the line is larger
TIMEOUT_S = 30.0
UPDATE_TIMEOUT_S = 1800.0  # a quarter of an hour over a line that spoils one byte in twenty


class Home(StrEnum):
    """What a unit finds its bearings by."""

    SWITCH = "switch"
    STOP = "stop"


_HOMES = {Home.SWITCH: Calibration.HOME_SWITCH, Home.STOP: Calibration.HOME_STOP}


def rpc(
    site: SiteName,
    unit: UnitName,
    command: Annotated[str, typer.Argument(metavar="COMMAND", help=f"One of {', '.join(COMMANDS)}.")],
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Annotated[
        float | None,
        typer.Option(
            help=f"How long to wait for the reply; {TIMEOUT_S:g}, or {UPDATE_TIMEOUT_S:g} for an update, if left out."
        ),
    ] = None,
    pause_s: Annotated[float, typer.Option(help="start: between two sweeps.")] = 0.0,
    waypoint: Annotated[int | None, typer.Option(help="set_waypoint: none if left out.", min=0, max=MAX_COUNT)] = None,
    bearing_deg: Annotated[float | None, typer.Option(help="go_to.")] = None,
    first_bearing_deg: Annotated[float | None, typer.Option(help="configure.")] = None,
    bearing_step_deg: Annotated[float | None, typer.Option(help="configure.")] = None,
    count: Annotated[int | None, typer.Option(help="configure: readings per sweep.", min=0, max=MAX_COUNT)] = None,
    ping_interval_s: Annotated[float | None, typer.Option(help="configure.")] = None,
    top_speed_half_steps_s: Annotated[float | None, typer.Option(help="configure.")] = None,
    ramp_s: Annotated[float | None, typer.Option(help="configure.")] = None,
    settle_s: Annotated[float | None, typer.Option(help="configure.")] = None,
    pings: Annotated[
        int | None,
        typer.Option(help="configure: 1, 3 or 5 a reading, which is their median.", min=0, max=MAX_COUNT),
    ] = None,
    half_steps_per_turn: Annotated[float | None, typer.Option(help="calibrate.")] = None,
    backlash_half_steps: Annotated[int | None, typer.Option(help="calibrate.", min=0, max=MAX_COUNT)] = None,
    home: Annotated[Home | None, typer.Option(help="calibrate: what home is.")] = None,
    home_bearing_deg: Annotated[float | None, typer.Option(help="calibrate: where home is.")] = None,
    temperature_c: Annotated[float | None, typer.Option(help="trim_temperature: of the air, now.")] = None,
    image: Annotated[
        Path | None, typer.Option(help="update: build/update.hex of the firmware.", exists=True, dir_okay=False)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="update: even if the unit has this version.")] = False,
) -> None:
    """Have a unit carry out a command."""
    if command not in COMMANDS:
        raise typer.BadParameter(f"{command!r} is not one of {', '.join(COMMANDS)}", param_hint="COMMAND")
    request = CommandRequest(
        pause_s=pause_s, waypoint=waypoint, bearing_rad=_radians(bearing_deg), temperature_c=temperature_c
    )
    if command == "configure":
        request.plan.CopyFrom(
            SweepPlan(
                first_bearing_rad=_radians(first_bearing_deg),
                bearing_step_rad=_radians(bearing_step_deg),
                count=count,
                ping_interval_s=ping_interval_s,
                top_speed_half_steps_s=top_speed_half_steps_s,
                ramp_s=ramp_s,
                settle_s=settle_s,
                pings=pings,
            )
        )
    elif command == "calibrate":
        request.calibration.CopyFrom(
            Calibration(
                half_steps_per_turn=half_steps_per_turn,
                backlash_half_steps=backlash_half_steps,
                home=None if home is None else _HOMES[home],
                home_bearing_rad=_radians(home_bearing_deg),
            )
        )
    elif command == "update":
        if image is None:
            raise typer.BadParameter("update needs the image: give --image build/update.hex", param_hint="--image")
        request.image, request.force = image.read_bytes(), force
    with joined(site, connect, tls) as client:
        if command == "update":
            reply = _update(client, unit, request, timeout_s or UPDATE_TIMEOUT_S)
        else:
            reply = client.command(unit, command, request, timeout_s or TIMEOUT_S)
    if not reply.done:
        raise BusError(f"unit {unit!r} did not {command}: {reply.error}")
    typer.echo(survey.to_json(reply))


def _update(client: Client, unit: str, request: CommandRequest, timeout_s: float) -> CommandReply:
    """Have a unit updated, and show on a terminal how far it is."""
    with Console(stderr=True).status(f"{unit}: updating") as shown:

        def show(status: UnitStatus) -> None:
            if status.unit == unit:
                shown.update(f"{unit}: {status.detail}")

        client.on_unit_status(show)
        return client.command(unit, "update", request, timeout_s)


def _radians(angle_deg: float | None) -> float | None:
    return None if angle_deg is None else math.radians(angle_deg)
