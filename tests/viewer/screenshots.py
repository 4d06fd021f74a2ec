"""The pictures of the pages: the demo after its walk through the paper's room, and a board of twenty units.

    PYTHONPATH=tests python tests/viewer/screenshots.py

writes viewer/demo.png and viewer/board.png, as headless Chromium shows them.
"""

import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mapper.room import paper_room
from PIL import Image
from playwright.sync_api import Browser
from system.processes import ROOT, Programs, free_ports, programs, wait_until
from viewer.browser import Screen, chromium, screen
from viewer.room_in_picture import says_all_is_well, shown_share
from viewer.sick_units import has_words_of_trouble, heard, shows_spots
from viewer.watched_site import ALL_OF_IT, watched_site

SIZE_PX = (1280, 760)
MOST_BYTES = 300_000
WITHIN_S = 900.0  # a loaded machine without a graphics card takes its time
LOOK_EVERY_S, SAME_LOOKS = 5.0, 3  # rays and labels come after the walls
BAR = (20, 5)  # row and column: red in a bar that says that the page is old
MAP = (slice(120, 720), slice(0, 700))  # of the picture: what stands still once all has come


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for name, take in (("demo", demo), ("board", board)):
            made = Path(folder) / name
            made.mkdir()
            take(browser, made, ROOT / "viewer" / f"{name}.png")


def demo(browser: Browser, folder: Path, path: Path) -> None:
    """The demo as `make demo` shows it, once the whole room is drawn."""
    ports = dict(zip(("UNIT", "ZENOH", "RERUN", "WEB"), map(str, free_ports(4)), strict=True))
    settings = {f"DEMO_{name}_PORT": port for name, port in ports.items()} | {"DEMO_DATA": str(folder / "data")}
    with programs(folder) as running:
        running.start("demo", sys.executable, "deploy/demo/run.py", env=settings)
        (address,) = wait_until(lambda: re.findall(r"Watch the map at (\S+)", running.log("demo")), "no address")
        with screen(browser, size_px=SIZE_PX) as shown:
            shown.open(address)
            shown.wait_for(lambda: shows_room(shown, running), "the room is not shown", 2.0, WITHIN_S)
            save(shown, path, says_all_is_well)
        running.end("demo")


def board(browser: Browser, folder: Path, path: Path) -> None:
    """Twenty units at one site, two of which are not well."""
    with watched_site(folder) as site, screen(browser, size_px=SIZE_PX) as shown:
        site.sweep_as(20)
        with heard(site.live.endpoint, site.live.client.unit_statuses()):
            shown.open(site.relay.page)
            shown.wait_for(lambda: shows_room(shown, site.live.running), "no room", 2.0, WITHIN_S)
            save(shown, path, shows_troubles)


def shows_room(shown: Screen, running: Programs) -> bool:
    running.check()
    return shown_share(shown.picture(), paper_room()) > ALL_OF_IT


def shows_troubles(picture: np.ndarray) -> bool:
    """Whether the picture shows who is not well, and the page is not old."""
    return shows_spots(picture) and has_words_of_trouble(picture) and picture[BAR].max() < 100


def still(shown: Screen, complete: Callable[[np.ndarray], bool]) -> np.ndarray:
    """The picture once its map has been the same for a while, and it is ``complete``."""
    pictures = [shown.picture()]

    def is_still() -> bool:
        pictures.append(shown.picture())
        last = pictures[-SAME_LOOKS:]
        same = len(last) == SAME_LOOKS and all(np.array_equal(each[MAP], last[0][MAP]) for each in last)
        return same and complete(last[-1])

    shown.wait_for(is_still, "the map does not stand still", LOOK_EVERY_S, WITHIN_S)
    return pictures[-1]


def save(shown: Screen, path: Path, complete: Callable[[np.ndarray], bool]) -> None:
    """The picture in 256 colours, which is small and looks the same."""
    Image.fromarray(still(shown, complete)).quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)
    size = path.stat().st_size
    assert size < MOST_BYTES, f"{path.name} has {size} bytes"
    print(f"{path.relative_to(ROOT)}: {size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
