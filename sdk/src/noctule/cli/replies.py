"""What a unit replied to a command, in words: angles in degrees, as they are given."""

import math
from collections.abc import Iterable, Iterator

from google.protobuf.message import Message

from noctule.messages_pb2 import Calibration, CommandReply, Measurement, UnitSettings, UnitStatus

DONE = {
    "stop": "stops after its present reading",
    "single": "makes one sweep",
    "start": "sweeps until stopped",
    "home": "looks for home; give the next command when it stands still",
    "go_to": "turns; give the next command when it stands still",
    "set_waypoint": "knows its waypoint",
    "configure": "has the new plan; store keeps it",
    "calibrate": "has the new calibration; store keeps it",
    "trim_temperature": "has the new trim; store keeps it",
    "store": "has its settings in flash",
    "reset": "resets",
    "accept_room": "its gateway learns again what it hears",
}
_ONLY_BEGUN = ("stop", "single", "start", "home", "go_to", "reset")  # what the unit's state was before says nothing


def lines(unit: str, command: str, reply: CommandReply) -> list[str]:
    """One line, or for status, hello and settings a line for each value; not yet plain (see noctule.plain_text)."""
    if command == "settings" and reply.HasField("settings"):
        return [f"{unit}: its settings", *_settings(reply.settings)]
    if command in ("status", "hello") and reply.HasField("status"):
        return [f"{unit}: {state(reply.status)}", *_status(reply.status)]
    if command not in ("status", "hello") and reply.measurements:
        return [f"{unit}: {reply.detail}", *measurements(reply.measurements)]
    told = [DONE.get(command, "done"), reply.detail]
    if reply.HasField("status"):
        told += [] if command in _ONLY_BEGUN else [f"{state(reply.status)} now"]
        told.append(reply.status.detail)
    return [f"{unit}: {'; '.join(filter(None, told))}"]


def state(status: UnitStatus) -> str:
    """The state of a unit in one word, or that a newer gateway has one that is not known here."""
    if status.state not in UnitStatus.State.values():
        return f"state {status.state} of a newer gateway"
    return UnitStatus.State.Name(status.state).removeprefix("STATE_").lower()


def measurements(found: Iterable[Measurement]) -> Iterator[str]:
    """A line for each figure: good, bad or unknown, its name, and in words."""
    for each in found:
        verdict = Measurement.Verdict.Name(each.verdict).removeprefix("VERDICT_").lower()
        yield f"  {verdict:<8} {each.name.replace('_', ' '):<24} {each.words}"


def _status(status: UnitStatus) -> Iterator[str]:
    rows = [
        ("detail", status.detail),
        ("gateway", status.gateway),
        ("serial", status.serial or ""),
        *(_of_the_unit(status) if status.firmware else ()),  # else it has not said HELLO to this gateway yet
        ("log", f"{status.log_tail} to {status.log_head}" if status.log_head else "empty"),
        *((name.replace("_", " "), count) for name, count in sorted(status.counters.items()) if count),
    ]
    return _aligned(rows)


def _of_the_unit(status: UnitStatus) -> Iterator[tuple[str, object]]:
    yield "firmware", status.firmware
    yield "boot", status.boot
    yield "last reset", status.reset_cause
    yield "homed", "yes" if status.homed else "no"
    yield "latest slip", f"{math.degrees(status.slip_rad):+.1f} degrees" if status.HasField("slip_rad") else ""
    yield "waypoint", status.waypoint if status.HasField("waypoint") else "none"
    yield "clock error", f"{status.clock_error_s * 1e3:.2f} ms, drift {status.clock_drift * 1e6:.0f} ppm"
    yield "chip", f"{status.chip_temperature_c:.1f} C" if status.HasField("chip_temperature_c") else ""


def _settings(settings: UnitSettings) -> Iterator[str]:
    rows = [*_fields(settings.plan), *_fields(settings.calibration)]
    if settings.HasField("temperature_trim_k"):
        rows.append(("temperature trim", f"{settings.temperature_trim_k:+.1f} K"))
    rows.append(("in flash", "yes" if settings.stored else "no: noctule rpc SITE UNIT store keeps them"))
    return _aligned(rows)


def _fields(message: Message) -> Iterator[tuple[str, object]]:
    """Name and value of each field that is set, with its unit of measure, which is the end of its name."""
    for field, value in message.ListFields():
        name, _, unit_of_measure = field.name.rpartition("_")
        speed = field.name.removesuffix("_half_steps_s")
        if field.enum_type is Calibration.Home.DESCRIPTOR:
            yield field.name, Calibration.Home.Name(value).removeprefix("HOME_").lower()
        elif speed != field.name:
            yield speed.replace("_", " "), f"{value:g} half steps/s"
        elif unit_of_measure == "rad":
            yield name.replace("_", " "), f"{math.degrees(value):.2f} degrees"
        elif unit_of_measure == "s":
            yield name.replace("_", " "), f"{value:g} s"
        else:
            yield field.name.replace("_", " "), f"{value:g}"


def _aligned(rows: Iterable[tuple[str, object]]) -> Iterator[str]:
    return (f"  {name:<16} {value}" for name, value in rows if value != "")
