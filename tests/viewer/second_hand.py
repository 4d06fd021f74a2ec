"""A dot on the map whose colour is the second at which it was drawn: by it a picture says how old it is."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import rerun as rr

from noctule import rerun_paths

PATH = f"{rerun_paths.WORLD}/second_hand"
AROUND_S = 56  # after as many seconds the colours come again
_LEVELS = (0, 85, 170, 255)
_COLOURS = [
    (red, green, blue)
    for red in _LEVELS
    for green in _LEVELS
    for blue in _LEVELS
    if max(red, green, blue) - min(red, green, blue) > 80  # no grey, as text and lines are
][:AROUND_S]
_LEAST_PX = 300


@contextmanager
def second_hand(url: str, site: str, at_m: tuple[float, float]) -> Iterator[None]:
    """Draw the dot each second on the relay at ``url``."""
    ended = threading.Event()

    def draw() -> None:
        recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id=site)
        recording.connect_grpc(url)
        while not ended.is_set():
            colour = _COLOURS[int(time.time()) % AROUND_S]
            dot = rr.Points2D([at_m], colors=[colour], radii=rr.Radius.ui_points(20), draw_order=100.0)
            recording.log(PATH, dot)
            ended.wait(1.0 - time.time() % 1.0)
        recording.disconnect()

    hand = threading.Thread(target=draw)
    hand.start()
    try:
        yield
    finally:
        ended.set()
        hand.join()


def age_s(picture: np.ndarray, taken_s: float) -> int | None:
    """How many seconds before ``taken_s`` the dot in the picture was drawn, below AROUND_S; None without a dot."""
    for age in range(AROUND_S):
        colour = _COLOURS[(int(taken_s) - age) % AROUND_S]
        if (np.abs(picture.astype(int) - colour).max(axis=-1) < 6).sum() > _LEAST_PX:
            return age
    return None
