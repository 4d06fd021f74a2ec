"""Set a contour from the bus beside the simulated room that it is a map of.

Only the demo and the tests know the truth; nothing that maps imports this.
"""

import argparse
import math
import threading
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import zenoh

from noctule import awake, bus
from noctule.client import Client
from noctule.errors import BusConfigError, BusError
from noctule.messages_pb2 import Contour

XY = tuple[float, float]
FOUND_WITHIN_M = 0.15  # farther off than this, it is another object


@dataclass(frozen=True)
class Room:
    """A simulated room: its walls' ends and corners, and its cylinders as (x_m, y_m, radius_m)."""

    walls: tuple[tuple[XY, XY], ...]
    cylinders: tuple[tuple[float, float, float], ...]

    @property
    def corners(self) -> tuple[XY, ...]:
        """Points where one wall ends and another begins."""
        ends = [end for _, end in self.walls]
        return tuple(start for start, _ in self.walls if start in ends)


@dataclass(frozen=True)
class Comparison:
    """How far a contour is from the room, in metres; None where a corner or cylinder of the room was not found."""

    corner_errors_m: tuple[float | None, ...]
    cylinder_errors_m: tuple[tuple[float, float] | None, ...]  # (centre, radius)
    invented_walls: int
    invented_corners: int
    invented_cylinders: int

    @property
    def complete(self) -> bool:
        """Everything of the room was found."""
        return None not in self.corner_errors_m and None not in self.cylinder_errors_m

    @property
    def invented(self) -> int:
        """Objects that the room does not have."""
        return self.invented_walls + self.invented_corners + self.invented_cylinders

    @property
    def mean_corner_error_m(self) -> float:
        """Mean distance of the found corners from the room's; NaN where none was found."""
        found = [error for error in self.corner_errors_m if error is not None]
        return sum(found) / len(found) if found else math.nan


def load_room(path: Path) -> Room:
    """Read what stands in a room file of the simulator: what moves is no part of a map."""
    room = tomllib.loads(path.read_text())
    walls = [wall for wall in room["wall"] if "path" not in wall]
    cylinders = [cylinder for cylinder in room.get("cylinder", []) if "path" not in cylinder]
    return Room(
        walls=tuple((_xy(wall["from_m"]), _xy(wall["to_m"])) for wall in walls),
        cylinders=tuple((*_xy(c["center_m"]), float(c["radius_m"])) for c in cylinders),
    )


def compare(contour: Contour, room: Room) -> Comparison:
    """Match each object of the room to the nearest of the contour; what is far from all of the room's is invented."""
    corners = [(corner.x_m, corner.y_m) for corner in contour.corners]
    centres = [(cylinder.x_m, cylinder.y_m) for cylinder in contour.cylinders]
    true_centres = [(x, y) for x, y, _ in room.cylinders]
    return Comparison(
        corner_errors_m=tuple(_distance_to_nearest(corner, corners) for corner in room.corners),
        cylinder_errors_m=tuple(_cylinder_error(cylinder, contour) for cylinder in room.cylinders),
        invented_walls=sum(not _lies_on_a_wall(wall, room) for wall in contour.walls),
        invented_corners=sum(_distance_to_nearest(corner, room.corners) is None for corner in corners),
        invented_cylinders=sum(_distance_to_nearest(centre, true_centres) is None for centre in centres),
    )


def _xy(point: Sequence[float]) -> XY:
    return (float(point[0]), float(point[1]))


def _distance_to_nearest(point: XY, others: Sequence[XY]) -> float | None:
    nearest = min((math.dist(point, other) for other in others), default=math.inf)
    return nearest if nearest <= FOUND_WITHIN_M else None


def _cylinder_error(truth: tuple[float, float, float], contour: Contour) -> tuple[float, float] | None:
    x_m, y_m, radius_m = truth
    errors = [
        (math.dist((x_m, y_m), (found.x_m, found.y_m)), abs(found.radius_m - radius_m)) for found in contour.cylinders
    ]
    nearest = min(errors, default=(math.inf, math.inf))
    return nearest if nearest[0] <= FOUND_WITHIN_M else None


def _lies_on_a_wall(wall, room: Room) -> bool:
    ends = ((wall.start.x_m, wall.start.y_m), (wall.end.x_m, wall.end.y_m))
    return any(all(_distance_to_segment(end, *true) <= FOUND_WITHIN_M for end in ends) for true in room.walls)


def _distance_to_segment(point: XY, start: XY, end: XY) -> float:
    along = (end[0] - start[0], end[1] - start[1])
    offset = (point[0] - start[0], point[1] - start[1])
    share = (offset[0] * along[0] + offset[1] * along[1]) / (along[0] ** 2 + along[1] ** 2)
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, (start[0] + share * along[0], start[1] + share * along[1]))


def describe(comparison: Comparison, contour: Contour, room: Room) -> str:
    """The comparison as a few lines for a terminal."""
    found_walls = f"{len(contour.walls)} of the room's {len(room.walls)} walls"
    lines = [f"{_counted(contour.sweeps, 'sweep')}, {found_walls}, {_corners_off(comparison)}"]
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    for label, (x_m, y_m), error_m in zip(letters, room.corners, comparison.corner_errors_m, strict=False):
        off = "not found" if error_m is None else f"{100 * error_m:.2f} cm off"
        lines.append(f"  corner {label} ({x_m:+.3f}, {y_m:+.3f}) m: {off}")
    for (x_m, y_m, radius_m), errors_m in zip(room.cylinders, comparison.cylinder_errors_m, strict=True):
        off = "not found"
        if errors_m is not None:
            off = f"centre {100 * errors_m[0]:.2f} cm off, radius {100 * errors_m[1]:.2f} cm off"
        lines.append(f"  cylinder ({x_m:+.3f}, {y_m:+.3f}) m, radius {radius_m:.3f} m: {off}")
    if comparison.invented:
        lines.append(f"  not in the room: {comparison.invented} objects")
    return "\n".join(lines)


def _corners_off(comparison: Comparison) -> str:
    if math.isnan(comparison.mean_corner_error_m):
        return "no corner yet"
    return f"corners {100 * comparison.mean_corner_error_m:.2f} cm off on average"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def describe_complete(contour: Contour) -> str:
    """One line on a map that has all of the room."""
    counts = [(len(contour.walls), "wall"), (len(contour.corners), "corner"), (len(contour.cylinders), "cylinder")]
    return f"The map is complete: {', '.join(_counted(*count) for count in counts)}; more sweeps make it more accurate"


def watch(room: Room, site: str, connect: str, every_s: float) -> None:
    """Print the site's contour against the room when there is a newer one, at most every ``every_s``."""
    started_s = time.monotonic()
    latest = _Latest()
    completed = False
    with bus.closing(_join(connect)) as session, Client(site, session=session) as client, awake.told_to_end() as over:
        client.on_contour(latest.put)
        while not over.is_set():
            contour = latest.take(awake.EVERY_S)
            if contour is None:
                continue
            after = f"After {time.monotonic() - started_s:.0f} s: "
            comparison = compare(contour, room)
            print(f"{after}{describe(comparison, contour, room)}", flush=True)
            if comparison.complete and not completed:
                completed = True
                print(f"{after}{describe_complete(contour)}", flush=True)
            over.wait(every_s)


class _Latest:
    """The newest contour with a wall that nobody has taken yet."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._contour: Contour | None = None

    def put(self, contour: Contour) -> None:
        """A contour has come."""
        if contour.walls:
            with self._changed:
                self._contour = contour
                self._changed.notify()

    def take(self, within_s: float) -> Contour | None:
        """Wait for a contour, at most ``within_s``."""
        with self._changed:
            self._changed.wait_for(lambda: self._contour is not None, within_s)
            contour, self._contour = self._contour, None
        return contour


def _join(connect: str) -> zenoh.Session:
    """A session on the bus, once its router answers; until then it waits without a word."""
    while True:
        try:
            return bus.open_session([connect], patience_s=0)
        except BusConfigError:
            raise
        except BusError:
            continue


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("room", type=Path, help="the simulator's room file")
    parser.add_argument("--site", required=True)
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447")
    parser.add_argument("--every-s", type=float, default=5.0)
    arguments = parser.parse_args()
    try:
        watch(load_room(arguments.room), arguments.site, arguments.connect, arguments.every_s)
    except KeyboardInterrupt:
        return


if __name__ == "__main__":
    main()
