"""The command that has a unit carry out a command."""

import math
from enum import StrEnum
from typing import Annotated

import typer

from noctule import survey
from noctule.cli.joining import DEFAULT_CONNECT, Connect, SiteName, UnitName, joined
from noctule.errors import BusError
from noctule.messages_pb2 import Calibration, CommandRequest, SweepPlan

COMMANDS = (
    *("hello", "status", "settings", "start", "stop", "single", "home", "go_to", "set_waypoint"),
    *("configure", "calibrate", "trim_temperature", "store", "reset"),
)


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
    timeout_s: Annotated[float, typer.Option(help="How long to wait for the reply.")] = 30.0,
    pause_s: Annotated[float, typer.Option(help="start: between two sweeps.")] = 0.0,
    waypoint: Annotated[int | None, typer.Option(help="set_waypoint: none if left out.")] = None,
    bearing_deg: Annotated[float | None, typer.Option(help="go_to.")] = None,
    first_bearing_deg: Annotated[float | None, typer.Option(help="configure.")] = None,
    bearing_step_deg: Annotated[float | None, typer.Option(help="configure.")] = None,
    count: Annotated[int | None, typer.Option(help="configure: readings per sweep.")] = None,
    ping_interval_s: Annotated[float | None, typer.Option(help="configure.")] = None,
    top_speed_half_steps_s: Annotated[float | None, typer.Option(help="configure.")] = None,
    ramp_s: Annotated[float | None, typer.Option(help="configure.")] = None,
    settle_s: Annotated[float | None, typer.Option(help="configure.")] = None,
    pings: Annotated[int | None, typer.Option(help="configure: 1, 3 or 5 a reading, which is their median.")] = None,
    half_steps_per_turn: Annotated[float | None, typer.Option(help="calibrate.")] = None,
    backlash_half_steps: Annotated[int | None, typer.Option(help="calibrate.")] = None,
    home: Annotated[Home | None, typer.Option(help="calibrate: what home is.")] = None,
    home_bearing_deg: Annotated[float | None, typer.Option(help="calibrate: where home is.")] = None,
    temperature_c: Annotated[float | None, typer.Option(help="trim_temperature: of the air, now.")] = None,
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
    with joined(site, connect) as client:
        reply = client.command(unit, command, request, timeout_s)
    if not reply.done:
        raise BusError(f"unit {unit!r} did not {command}: {reply.error}")
    typer.echo(survey.to_json(reply))


def _radians(angle_deg: float | None) -> float | None:
    return None if angle_deg is None else math.radians(angle_deg)
