"""The messages between a mapper's service and the process of its map, pickled over a pipe."""

import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from noctule.messages_pb2 import Contour, Features, GridTile
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.window import Identity


class MapProcessError(Exception):
    """Something that was raised in the process of the map: ``reason`` in a line, and its traceback there."""

    def __init__(self, reason: str, trace: str) -> None:
        super().__init__(reason, trace)
        self.reason, self.trace = reason, trace

    def __str__(self) -> str:
        return f"in the map's process\n{self.trace}"


def as_message(error: BaseException) -> MapProcessError:
    """``error`` as the other process can show it: exceptions lose their traceback when they are pickled."""
    return MapProcessError(f"{type(error).__name__}: {error}", "".join(traceback.format_exception(error)))


# ---- From the service


@dataclass(frozen=True)
class MapSettings:
    """What a map is to be; ``fit_turn`` as in LiveSettings. The first message."""

    config: LiveConfig
    site: str
    service: str
    fit_turn: Path | None = None


@dataclass(frozen=True)
class Changed:
    """Sweeps to be taken off the map, and then sweeps to be put on it; the first of them came at ``since_s``
    (monotonic, the same clock in both processes).
    """

    left: Sequence[Identity]
    entered: Sequence[SweepReadings]
    since_s: float


@dataclass(frozen=True)
class Shown:
    """The state that was sent is shown; the next one may come. Where it could not be, why."""

    error: Exception | None = None


# ---- From the map's process


@dataclass(frozen=True)
class MapState:
    """The map after a fit, as messages without a version; ``tiles`` are those that have changed since the last one."""

    contour: Contour
    features: Features
    tiles: Sequence[GridTile]


@dataclass(frozen=True)
class PackedState:
    """A MapState that can be pickled, which the messages of noctule.messages_pb2 can't: they name a module noctule.v1
    as theirs.
    """

    contour: bytes
    features: bytes
    tiles: Sequence[bytes]

    @classmethod
    def of(cls, state: MapState) -> "PackedState":
        """Pack ``state``."""
        tiles = [tile.SerializeToString() for tile in state.tiles]
        return cls(state.contour.SerializeToString(), state.features.SerializeToString(), tiles)

    def unpacked(self) -> MapState:
        """The state as it was."""
        return MapState(
            Contour.FromString(self.contour),
            Features.FromString(self.features),
            [GridTile.FromString(tile) for tile in self.tiles],
        )


@dataclass(frozen=True)
class Broke:
    """A sweep that broke the map, which has been made again without it."""

    readings: SweepReadings
    error: MapProcessError


@dataclass(frozen=True)
class Trouble:
    """Trouble of a kind has begun or is over, as Troubles hears it."""

    kind: str
    text: str
    over: bool
    error: MapProcessError | None = None


@dataclass(frozen=True)
class Beat:
    """A sign of life, each second: the map's figures, and whether it makes progress."""

    figures: dict[str, int]
    makes_progress: bool
