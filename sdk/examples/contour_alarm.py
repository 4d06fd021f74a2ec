"""Raises an alarm when walls come or go: contour_alarm.py SITE [ROUTER ...]"""

import asyncio
import math
import sys

import noctule
from noctule import threads
from noctule.messages_pb2 import Wall

NEAR_M, NEAR_RAD = 0.15, math.radians(10)  # walls this close are the same wall


def same(a: Wall, b: Wall) -> bool:
    """Whether the middle of ``a`` lies on ``b``, and both have one direction."""
    turned_rad = abs(a.theta_rad - b.theta_rad) % math.pi  # a wall's normal is only known up to pi
    x_m, y_m = (a.start.x_m + a.end.x_m) / 2, (a.start.y_m + a.end.y_m) / 2
    off_m = abs(x_m * math.cos(b.theta_rad) + y_m * math.sin(b.theta_rad) - b.rho_m)
    return min(turned_rad, math.pi - turned_rad) < NEAR_RAD and off_m < NEAR_M


def missing(walls: list[Wall], among: list[Wall]) -> list[Wall]:
    """Those ``walls`` that are not ``among`` the others."""
    return [wall for wall in walls if not any(same(wall, other) or same(other, wall) for other in among)]


def changes(before: list[Wall], now: list[Wall]) -> list[str]:
    """A line for each wall that has come or gone."""
    return [
        f"a wall has {verb}: ({wall.start.x_m:.2f}, {wall.start.y_m:.2f}) to ({wall.end.x_m:.2f}, {wall.end.y_m:.2f}) m"
        for verb, walls in (("come", missing(now, before)), ("gone", missing(before, now)))
        for wall in walls
    ]


async def main(site: str, routers: list[str]) -> None:
    """Print an alarm for each change, until the program is ended."""
    known: list[Wall] = []
    async with noctule.AsyncClient(site, connect=routers) as client:
        async for contour in client.watch_contours():
            changed = changes(known, list(contour.walls))
            for change in changed:
                print(f"ALARM {site}, contour {contour.version}: {change}", flush=True)
            if changed:
                known = list(contour.walls)


if __name__ == "__main__":
    threads.end_process_when_one_fails()
    asyncio.run(main(sys.argv[1], sys.argv[2:]))
