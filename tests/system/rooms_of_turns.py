"""A room with places for several units, as the simulator's room file and as the gateway's site file."""

from pathlib import Path

from noctule import site as site_file
from noctule.site import Site

# Metres and degrees: in the corners of a room of 5 by 4 m, each looking at its middle.
CORNERS = [(0.3, 0.3, 40), (4.7, 3.7, 220), (4.7, 0.3, 140), (0.3, 3.7, 320)]
# The data sheet allows 1.5 %.
OSCILLATORS = [0.015, -0.015, 0.004, -0.008]

_ROOM = """
name = "four"
[[wall]]
from_m = [0.0, 0.0]
to_m = [5.0, 0.0]
[[wall]]
from_m = [5.0, 0.0]
to_m = [5.0, 4.0]
[[wall]]
from_m = [5.0, 4.0]
to_m = [0.0, 4.0]
[[wall]]
from_m = [0.0, 4.0]
to_m = [0.0, 0.0]
[[cylinder]]
center_m = [2.9, 1.6]
radius_m = 0.15
[[person]]
radius_m = 0.22
doors_m = [[-0.6, 2.0]]
away_s = [40.0, 100.0]
"""


def room_file(folder: Path, units: int) -> Path:
    """The room with the first ``units`` places."""
    text = _ROOM
    for (x, y, heading), error in list(zip(CORNERS, OSCILLATORS, strict=True))[:units]:
        text += f"[[unit]]\nposition_m = [{x}, {y}]\nheading_deg = {heading}.0\noscillator_error = {error}\n"
    path = folder / f"room-{units}.toml"
    path.write_text(text)
    return path


def site_of(folder: Path, units: int, sweep: str = "start = true") -> Site:
    """The site file of those units, read."""
    text = 'site = "four"\n'
    for number, (x, y, heading) in enumerate(CORNERS[:units], start=1):
        text += (
            f'[[unit]]\nname = "u{number}"\nserial = {number}\naddress = "socket://localhost:{7000 + number}"\n'
            f"pose = {{ x_m = {x}, y_m = {y}, heading_deg = {heading} }}\nsweep = {{ {sweep} }}\n"
        )
    path = folder / f"site-{units}.toml"
    path.write_text(text)
    return site_file.load(path)
