"""The command that has a unit carry out a command: `noctule rpc SITE UNIT`, with a subcommand for each.

What each means is in gateway/README.md, "Commands".
"""

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperGroup

from noctule.cli.asked import Addressed, Asked
from noctule.cli.options import DEFAULT_CONNECT, Connect, SiteName, UnitName
from noctule.program_options import Tls

MAX_COUNT = 0xFFFF  # no count on the line is larger
TIMEOUT_S = 30.0
# Longer than it takes the gateway to give up (gateway/README.md, "What a unit measures of itself").
MEASURE_TIMEOUT_S = 200.0
SELF_TEST_TIMEOUT_S = 450.0  # at the slowest plan
UPDATE_TIMEOUT_S = 1800.0  # 20 minutes over a line that spoils one byte in twenty

Timeout = Annotated[float, typer.Option(help="How many seconds to wait for the reply.")]


class Home(StrEnum):
    """What a unit finds its bearings by."""

    SWITCH = "switch"
    STOP = "stop"
    OPENING_SWITCH = "opening-switch"


_HOMES = {Home.SWITCH: "HOME_SWITCH", Home.STOP: "HOME_STOP", Home.OPENING_SWITCH: "HOME_OPENING_SWITCH"}


class _JsonAnywhere(TyperGroup):
    """``--json`` may also stand behind the command, as it does elsewhere."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:
        others = [each for each in args if each != "--json"]
        return super().parse_args(ctx, others if others == args else ["--json", *others])


rpc = typer.Typer(no_args_is_help=True, cls=_JsonAnywhere)


@rpc.callback()
def _address(
    context: typer.Context,
    site: SiteName,
    unit: UnitName,
    json: Annotated[
        bool, typer.Option("--json", help="The reply as JSON: noctule rpc SITE UNIT status --json.")
    ] = False,
) -> None:
    """Have a unit carry out a command. Each command has its own options: noctule rpc SITE UNIT COMMAND --help."""
    context.obj = Addressed(site, unit, json)


def _add_plain(name: str, summary: str, longest_s: float = TIMEOUT_S) -> None:
    """Add a command that takes nothing."""

    @rpc.command(name, help=summary)
    def _plain(
        context: typer.Context, connect: Connect = DEFAULT_CONNECT, tls: Tls = None, timeout_s: Timeout = longest_s
    ) -> None:
        _ask(context, connect, tls, timeout_s)


for _name, _summary in (
    ("hello", "The same as status."),
    ("status", "Print the unit's status, as the gateway knows it."),
    ("settings", "Print the unit's plan and calibration."),
    ("stop", "Stop sweeping."),
    ("single", "Make one sweep."),
    ("home", "Find home. The reply comes when the unit begins."),
    ("store", "Keep plan, calibration and trim in the unit's flash."),
    ("reset", "Reset the unit."),
    ("accept_room", "Take the room as it is now: the gateway learns again what a fixed unit hears."),
):
    _add_plain(_name, _summary)
for _name, _summary, _longest_s in (
    (
        "measure_gear",
        "Measure the half steps of a turn; the sensor must be free for a whole one. Takes 70 s.",
        MEASURE_TIMEOUT_S,
    ),
    (
        "measure_backlash",
        "Measure the play of the gears, by the home switch met from both sides. Takes 5 s.",
        MEASURE_TIMEOUT_S,
    ),
    (
        "self_test",
        "Test supply, home switch, motor, sensor and clock; the unit must be idle. Takes 45 s, more with a slow plan.",
        SELF_TEST_TIMEOUT_S,
    ),
):
    _add_plain(_name, _summary, _longest_s)


@rpc.command()
def start(
    context: typer.Context,
    pause_s: Annotated[float, typer.Option(help="From the end of a sweep to the next one.")] = 0.0,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Timeout = TIMEOUT_S,
) -> None:
    """Sweep until stopped."""
    _ask(context, connect, tls, timeout_s, pause_s=pause_s)


@rpc.command("go_to")
def go_to(
    context: typer.Context,
    bearing_deg: Annotated[float, typer.Option(help="Where to turn.")],
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Timeout = TIMEOUT_S,
) -> None:
    """Turn to a bearing and stay there; the unit must be homed and idle. The reply comes when it begins."""
    _ask(context, connect, tls, timeout_s, bearing_rad=_radians(bearing_deg))


@rpc.command("set_waypoint")
def set_waypoint(
    context: typer.Context,
    waypoint: Annotated[
        int | None, typer.Option(help="Its number, from 0; at none if left out.", min=0, max=MAX_COUNT)
    ] = None,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Timeout = TIMEOUT_S,
) -> None:
    """Say at which waypoint of its path the unit is."""
    _ask(context, connect, tls, timeout_s, waypoint=waypoint)


@rpc.command()
def configure(
    context: typer.Context,
    first_bearing_deg: Annotated[float | None, typer.Option(help="The lowest bearing of a sweep.")] = None,
    bearing_step_deg: Annotated[float | None, typer.Option(help="From one bearing to the next.")] = None,
    count: Annotated[int | None, typer.Option(help="Bearings of a sweep.", min=0, max=MAX_COUNT)] = None,
    ping_interval_s: Annotated[float | None, typer.Option(help="From one ping to the next, at least.")] = None,
    top_speed_half_steps_s: Annotated[float | None, typer.Option(help="How fast the motor turns.")] = None,
    ramp_s: Annotated[float | None, typer.Option(help="How long it takes to reach that speed.")] = None,
    settle_s: Annotated[float | None, typer.Option(help="How long it rests before a ping.")] = None,
    pings: Annotated[
        int | None, typer.Option(help="1, 3 or 5 a reading, which is their median.", min=0, max=MAX_COUNT)
    ] = None,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Timeout = TIMEOUT_S,
) -> None:
    """Change the unit's plan; what is left out keeps its present value."""
    plan = dict(
        first_bearing_rad=_radians(first_bearing_deg),
        bearing_step_rad=_radians(bearing_step_deg),
        count=count,
        ping_interval_s=ping_interval_s,
        top_speed_half_steps_s=top_speed_half_steps_s,
        ramp_s=ramp_s,
        settle_s=settle_s,
        pings=pings,
    )
    _ask(context, connect, tls, timeout_s, plan=plan)


@rpc.command()
def calibrate(
    context: typer.Context,
    half_steps_per_turn: Annotated[float | None, typer.Option(help="Of the sensor, as measure_gear finds it.")] = None,
    backlash_half_steps: Annotated[
        int | None, typer.Option(help="The gears' play, as measure_backlash finds it.", min=0, max=MAX_COUNT)
    ] = None,
    home: Annotated[Home | None, typer.Option(help="What the unit finds home by.")] = None,
    home_bearing_deg: Annotated[float | None, typer.Option(help="At which bearing home is.")] = None,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Timeout = TIMEOUT_S,
) -> None:
    """Tell the unit what was measured of it; what is left out keeps its present value."""
    calibration = dict(
        half_steps_per_turn=half_steps_per_turn,
        backlash_half_steps=backlash_half_steps,
        home=None if home is None else _HOMES[home],
        home_bearing_rad=_radians(home_bearing_deg),
    )
    _ask(context, connect, tls, timeout_s, calibration=calibration)


@rpc.command("trim_temperature")
def trim_temperature(
    context: typer.Context,
    temperature_c: Annotated[float, typer.Option(help="Of the air beside the unit, now.")],
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Timeout = TIMEOUT_S,
) -> None:
    """Trim the unit's thermometer by the air's temperature; its sweeps then carry one."""
    _ask(context, connect, tls, timeout_s, temperature_c=temperature_c)


@rpc.command()
def update(
    context: typer.Context,
    image: Annotated[Path, typer.Option(help="build/update.hex of the firmware.")],
    force: Annotated[bool, typer.Option("--force", help="Even if the unit has this version.")] = False,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    timeout_s: Timeout = UPDATE_TIMEOUT_S,
) -> None:
    """Give the unit new firmware; a terminal shows how far it is."""
    from noctule.cli.asking import ask_showing_progress

    ask_showing_progress(_asked(context, connect, tls, timeout_s), {"image": image.read_bytes(), "force": force})


def _ask(context: typer.Context, connect: list[str], tls: Path | None, timeout_s: float, **fields: object) -> None:
    """Have the unit carry out the command, its request with ``fields``; one that is None is not set."""
    from noctule.cli.asking import ask

    ask(_asked(context, connect, tls, timeout_s), fields)


def _asked(context: typer.Context, connect: list[str], tls: Path | None, timeout_s: float) -> Asked:
    assert context.info_name is not None
    return Asked(context.obj, context.info_name, connect, tls, timeout_s)


def _radians(angle_deg: float | None) -> float | None:
    return None if angle_deg is None else math.radians(angle_deg)
