"""Units among others that are not well, as their gateway says it, and whether a picture of the page shows them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from mapper.live_site import SITE
from system.processes import repeated

from noctule import bus, keys
from noctule.messages_pb2 import UnitStatus

# As the gateway says it (noctule_gateway/status).
TROUBLES = {
    "u7": (UnitStatus.STATE_FAULT, "no home switch found within a turn: check the switch and the motor's wiring"),
    "u14": (UnitStatus.STATE_DISCONNECTED, "no answer on /dev/serial/by-path/noctule-u14"),
}
SPOTS = ((255, 176, 32), (235, 64, 64))  # under units that are not well, the darker towards the rim
# Shares of the picture's height and width.
_MAP = (0.16, 0.95), (0.0, 0.55)
_BESIDE_THE_TABLE = (0.31, 0.95), (0.85, 1.0)  # where the words of a unit that is not well go on, and a row does not


@contextmanager
def heard(endpoint: str, statuses: Sequence[UnitStatus]) -> Iterator[None]:
    """Within the block these statuses, with TROUBLES, come each second, as a gateway sends them."""
    for status in statuses:
        if status.unit in TROUBLES:
            status.state, status.detail = TROUBLES[status.unit]
    with bus.open_session(connect=[endpoint]) as session:
        publishers = [bus.StatePublisher(session, keys.unit_status(SITE, each.unit), UnitStatus) for each in statuses]

        def tell() -> None:
            for publisher, status in zip(publishers, statuses, strict=True):
                publisher.put(status)

        with repeated(tell):
            yield


def shows_spots(picture: np.ndarray) -> bool:
    """Whether the map has both of SPOTS."""
    of_map = part(picture, *_MAP)
    bright = of_map[of_map.max(axis=-1) > 100].astype(float)
    hue = bright / bright.sum(axis=-1, keepdims=True)
    return all((np.abs(hue - np.divide(spot, sum(spot))).max(axis=-1) < 0.02).sum() > 20 for spot in SPOTS)


def has_words_of_trouble(picture: np.ndarray) -> bool:
    """Whether above the table of units there are lines that are wider than it, of light letters."""
    return int((part(picture, *_BESIDE_THE_TABLE) > 180).all(axis=-1).sum()) > 50


def part(picture: np.ndarray, rows: tuple[float, float], columns: tuple[float, float]) -> np.ndarray:
    height, width = picture.shape[:2]
    (top, bottom), (left, right) = rows, columns
    return picture[round(top * height) : round(bottom * height), round(left * width) : round(right * width)]
