"""Whether a picture shows a room, by its walls' lines, wherever and however large the view has drawn them; and whether
all is well at the site.
"""

import numpy as np
from mapper.room import Room
from scipy.signal import fftconvolve

WALLS = (236, 240, 245)  # as the mapper draws them
_HEADING_ROWS = 60  # of the picture, with the line on top
_WELL_ENDS = 0.5  # of 960 pixels' width: "all is well" ends at 0.37, "no mapper is heard ..." at 0.85
_COARSE = 2  # pixels of the picture to one of the search
_NEAR_PX = 1  # of the search, to either side of a line
_STEP_PX = 1.0  # along a wall, of the search


def shown_share(picture: np.ndarray, room: Room, colour: tuple[int, int, int] = WALLS) -> float:
    """The share of the walls' length that has pixels nearly of ``colour`` on it, where the room fits best.

    ``picture`` is (height, width, 3) bytes; y points up in the room. The room is at least a fifth of the picture wide.
    """
    near = (np.abs(picture.astype(int) - colour).max(axis=-1) < 40).astype(np.float32)
    height, width = (side // _COARSE * _COARSE for side in near.shape)
    coarse = near[:height, :width].reshape(height // _COARSE, _COARSE, width // _COARSE, _COARSE).max(axis=(1, 3))
    wide = _thickened(coarse)
    extent_m = np.ptp(room.vertices, axis=0)
    largest = min(wide.shape[1] / extent_m[0], wide.shape[0] / extent_m[1])
    least = 0.2 * wide.shape[1] / extent_m[0]
    return max(_best(wide, room, float(scale)) for scale in np.geomspace(least, largest, 60))


def says_all_is_well(picture: np.ndarray) -> bool:
    """Whether the line on top, of light letters, is as short as it is without an alarm."""
    columns = np.nonzero((picture[:_HEADING_ROWS] > 200).all(axis=-1).any(axis=0))[0]
    return 0 < columns.max(initial=0) < _WELL_ENDS * picture.shape[1]


def _best(wide: np.ndarray, room: Room, px_per_m: float) -> float:
    """The share at the best place of the room at this scale."""
    left_m, top_m = room.vertices[:, 0].min(), room.vertices[:, 1].max()
    corners = np.stack([room.vertices[:, 0] - left_m, top_m - room.vertices[:, 1]], axis=1) * px_per_m
    points = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(2, round(float(np.hypot(*(end - start))) / _STEP_PX))
        points.append(start + (end - start) * np.linspace(0, 1, count)[:, None])
    at = np.unique(np.round(np.concatenate(points)).astype(int), axis=0)
    template = np.zeros(at.max(axis=0)[::-1] + 1, np.float32)
    template[at[:, 1], at[:, 0]] = 1.0
    if any(of_room > of_picture for of_room, of_picture in zip(template.shape, wide.shape, strict=True)):
        return 0.0
    return float(fftconvolve(wide, template[::-1, ::-1], mode="valid").max() / template.sum())


def _thickened(mask: np.ndarray) -> np.ndarray:
    """Each pixel of the mask, and those near it."""
    padded = np.pad(mask, _NEAR_PX)
    height, width = mask.shape
    offsets = range(2 * _NEAR_PX + 1)
    return np.max([padded[y : y + height, x : x + width] for y in offsets for x in offsets], axis=0)
