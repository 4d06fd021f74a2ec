"""How units and the mapper itself fare, as the viewer shows it: states, figures over time, and a log of events."""

import rerun as rr

from noctule import rerun_paths
from noctule.messages_pb2 import UnitStatus
from noctule.rerun_together import Together
from noctule.unit_colours import unit_colour
from noctule_mapper.rerun_view.drawing import Entries

_STATES: dict[int, tuple[str, tuple[int, int, int]]] = {
    UnitStatus.STATE_UNSPECIFIED: ("unknown", (90, 96, 106)),
    UnitStatus.STATE_DISCONNECTED: ("disconnected", (140, 70, 70)),
    UnitStatus.STATE_IDLE: ("idle", (96, 125, 139)),
    UnitStatus.STATE_SWEEPING: ("sweeping", (76, 150, 110)),
    UnitStatus.STATE_HOMING: ("homing", (90, 130, 190)),
    UnitStatus.STATE_WAITING: ("waiting", (215, 160, 60)),
    UnitStatus.STATE_FAULT: ("fault", (214, 80, 80)),
    UnitStatus.STATE_PAUSED: ("paused", (84, 110, 122)),
    UnitStatus.STATE_TURNING: ("turning", (110, 120, 200)),
    UnitStatus.STATE_MEASURING: ("measuring", (110, 120, 200)),
    UnitStatus.STATE_LOADER: ("loader", (190, 90, 140)),
}
_TROUBLE = (
    UnitStatus.STATE_DISCONNECTED,
    UnitStatus.STATE_WAITING,
    UnitStatus.STATE_FAULT,
    UnitStatus.STATE_LOADER,
)


def draw_state(status: UnitStatus) -> Entries:
    """The state that a unit has come into, for the timeline of states."""
    path = rerun_paths.unit_state(status.unit)
    names, colours = zip(*_STATES.values(), strict=True)
    yield path, rr.StateConfiguration(values=names, labels=names, colors=colours)
    yield path, rr.StateChange(state=_name(status))


def draw_clock(status: UnitStatus) -> Entries:
    """How well a unit's time is known, in milliseconds."""
    line = rr.SeriesLines(colors=[unit_colour(status.unit)], names=[status.unit])
    yield rerun_paths.unit_clock_error(status.unit), Together(rr.Scalars(status.clock_error_s * 1e3), line)


def draw_heading(heading: str) -> Entries:
    """What the mapper says of its map, and at what hour."""
    yield rerun_paths.HEARTBEAT, rr.TextDocument(heading, media_type="text/markdown")


def draw_counter(name: str, value: float) -> Entries:
    """One of the mapper's own figures."""
    line = rr.SeriesLines(names=[name.removesuffix("_ms").replace("_", " ")])
    yield rerun_paths.mapper_counter(name), Together(rr.Scalars(value), line)


def draw_event(path: str, text: str, level: str) -> Entries:
    """A line for the log of events; ``level`` as INFO, WARN or ERROR."""
    yield path, rr.TextLog(text, level=level)


def trouble(status: UnitStatus) -> str:
    """What keeps a unit from its work, or what it has to tell its operator; empty while all is well."""
    if status.state in _TROUBLE:
        return f"{status.unit} {_name(status)}" + (f": {status.detail}" if status.detail else "")
    return f"{status.unit}: {status.detail}" if status.detail else ""


def _name(status: UnitStatus) -> str:
    return _STATES.get(status.state, _STATES[UnitStatus.STATE_UNSPECIFIED])[0]
