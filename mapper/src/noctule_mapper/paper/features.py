"""Feature points: cells that hang together are a cluster, and its most reliable cell is where a reflector was touched
(Section III.D, Fig. 8).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import FeatureConfig
from noctule_mapper.contacts.tangent_circle import TangentCircles
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.grid.grid import GridTile
from noctule_mapper.readings import arrays
from noctule_mapper.readings.echoes import Echoes

_EIGHT_NEIGHBOURS = np.ones((3, 3), int)
_MOST_TILES = 4096  # laid out as one array: 80 m square of 2 cm cells


@dataclass(frozen=True)
class FeaturePoints:
    """Arrays (n,): place, m(occupied) of the most reliable cell, the Kind of most contacts about it, the direction they
    were heard in, and the place's error in that direction and across it.
    """

    x_m: np.ndarray
    y_m: np.ndarray
    reliability: np.ndarray
    kind: np.ndarray
    direction_rad: np.ndarray
    sigma_m: np.ndarray  # in the direction: off the reflector
    sigma_along_m: np.ndarray  # across the direction: along the reflector

    take = arrays.take


def feature_points(
    tiles: Sequence[GridTile], echoes: Echoes, circles: TangentCircles, config: FeatureConfig
) -> FeaturePoints:
    """The feature points of the grid, each placed at the mean of the contacts about its most reliable cell.

    A cluster longer than a block is cut along the blocks: on a wall walked along closely the clusters grow together,
    and one point for all of it would say nothing of its direction. Round a cylinder the blocks are shorter.
    """
    touches = _touches(echoes, circles)
    return arrays.join([_NO_POINTS, *(_points_of(group, touches, config) for group in _adjacent(tiles))])


_NONE = np.zeros(0)
_NO_POINTS = FeaturePoints(_NONE, _NONE, _NONE, _NONE.astype(int), _NONE, _NONE, _NONE)


@dataclass(frozen=True)
class _Touches:
    """Contacts as places, arrays (n,); the range's share of the error is each reading's own, the pose's may be common
    to all.
    """

    x_m: np.ndarray
    y_m: np.ndarray
    direction_rad: np.ndarray
    kind: np.ndarray
    curvature_per_m: np.ndarray  # of the reflector: 1 / r on a cylinder, else 0
    variance_m2: np.ndarray
    variance_along_m2: np.ndarray
    pose_variance_m2: np.ndarray


def _touches(echoes: Echoes, circles: TangentCircles) -> _Touches:
    """Where the readings touched their reflectors, those that did.

    A direction that is off by an angle puts the contact beside the true one and, by the curvatures of arc and
    reflector, a little off the reflector.
    """
    touching = circles.kind != Kind.NONE
    echoes, circles = echoes.take(touching), circles.take(touching)
    direction, range_m = circles.direction_rad, echoes.range_m
    along = range_m * np.hypot(circles.direction_sigma_rad, echoes.sigma_heading_rad)
    cylinder = circles.kind == Kind.CYLINDER
    curvature = np.where(cylinder, 1 / np.maximum(circles.radius_m, _SMALLEST_RADIUS_M), 0)
    return _Touches(
        echoes.x_m + range_m * np.cos(direction),
        echoes.y_m + range_m * np.sin(direction),
        direction,
        circles.kind,
        curvature,
        echoes.sigma_m**2 + ((1 / range_m + curvature) * along**2 / 2) ** 2,
        along**2,
        echoes.sigma_position_m**2,
    )


_SMALLEST_RADIUS_M = 0.01  # what bends more is no cylinder of ours


def _points_of(tiles: Sequence[GridTile], touches: _Touches, config: FeatureConfig) -> FeaturePoints:
    """The feature points of tiles that lie together, laid out as one array."""
    from scipy import ndimage  # takes a while to load, and the default method does without

    occupied, first_column, first_row = _mosaic(tiles)
    cell_m = tiles[0].cell_m
    label = np.zeros(occupied.shape, np.int32)
    ndimage.label(occupied > config.least_occupied, structure=_EIGHT_NEIGHBOURS, output=label)
    column = np.floor(touches.x_m / cell_m).astype(int) - first_column
    row = np.floor(touches.y_m / cell_m).astype(int) - first_row
    inside = np.nonzero((column >= 0) & (column < occupied.shape[1]) & (row >= 0) & (row < occupied.shape[0]))[0]
    inside = inside[label[row[inside], column[inside]] > 0]
    block = max(1, round(config.block_m / cell_m))
    places = np.stack([label[row[inside], column[inside]], row[inside] // block, column[inside] // block], axis=1)
    inside = inside[_of_the_majority(places, touches.kind[inside])]
    column, row, kind = column[inside], row[inside], touches.kind[inside]
    block = np.where(kind == Kind.CYLINDER, max(1, round(config.curved_block_m / cell_m)), block)
    members = np.stack([label[row, column], row // block, column // block, kind], axis=1)
    groups, which = np.unique(members, axis=0, return_inverse=True)
    return _means(touches, inside, which.reshape(-1), groups[:, -1], occupied[row, column])


def _means(
    touches: _Touches, inside: np.ndarray, which: np.ndarray, kind: np.ndarray, belief: np.ndarray
) -> FeaturePoints:
    """Of the touches numbered ``inside``, (n,), those of group ``which`` as one point: means weighed by ``belief``."""
    reliability = np.zeros(len(kind))
    np.maximum.at(reliability, which, belief)
    share = belief / np.bincount(which, belief)[which]

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(which, share * values[inside])

    own, own_along = (
        np.bincount(which, share**2 * v[inside]) for v in (touches.variance_m2, touches.variance_along_m2)
    )
    common = mean(touches.pose_variance_m2)
    direction = np.arctan2(mean(np.sin(touches.direction_rad)), mean(np.cos(touches.direction_rad)))
    x, y, nx, ny = mean(touches.x_m), mean(touches.y_m), np.cos(direction), np.sin(direction)
    beside = (touches.y_m[inside] - y[which]) * nx[which] - (touches.x_m[inside] - x[which]) * ny[which]
    # The mean of an arc lies inside it, by the variance along it over twice its radius.
    inside_m = np.bincount(which, share * beside**2) * mean(touches.curvature_per_m) / 2
    return FeaturePoints(
        x - inside_m * nx,
        y - inside_m * ny,
        reliability,
        kind,
        direction,
        np.sqrt(own + common),
        np.sqrt(own_along + common),
    )


def _adjacent(tiles: Sequence[GridTile]) -> Iterator[list[GridTile]]:
    """The tiles in groups that touch, also by a corner: between two groups may lie any distance, and no cluster."""
    left = {(tile.tile_x, tile.tile_y): tile for tile in tiles}
    while left:
        reached = [next(iter(left))]
        group = [left.pop(reached[0])]
        while reached:
            x, y = reached.pop()
            for beside in ((x + across, y + up) for across in (-1, 0, 1) for up in (-1, 0, 1)):
                if beside in left:
                    group.append(left.pop(beside))
                    reached.append(beside)
        yield from _within(group, _MOST_TILES)


def _within(group: list[GridTile], most: int) -> Iterator[list[GridTile]]:
    """The group cut across its longer side until each part's box holds ``most`` tiles: a path of a kilometre aslant has
    a box that no memory holds.
    """
    keys = np.array([(tile.tile_x, tile.tile_y) for tile in group])
    extent = np.ptp(keys, axis=0) + 1
    if extent.prod() <= most:
        yield group
        return
    axis = int(extent.argmax())
    cut = (keys[:, axis].min() + keys[:, axis].max()) / 2
    for side in (keys[:, axis] <= cut, keys[:, axis] > cut):
        yield from _within([tile for tile, chosen in zip(group, side, strict=True) if chosen], most)


def _of_the_majority(places: np.ndarray, kind: np.ndarray) -> np.ndarray:
    """Which touches, bool (n,), are of the kind that most touches at their place, rows of ``places``, are of."""
    _, which = np.unique(places, axis=0, return_inverse=True)
    which = which.reshape(-1)
    counts = np.zeros((len(places), len(Kind)), int)
    np.add.at(counts, (which, kind), 1)
    return counts.argmax(axis=1)[which] == kind


def _mosaic(tiles: Sequence[GridTile]) -> tuple[np.ndarray, int, int]:
    """m(occupied) of all tiles as one array, and the site's column and row number of its first cell."""
    size = tiles[0].occupied.shape[0]
    keys = np.array([(tile.tile_x, tile.tile_y) for tile in tiles])
    first, last = keys.min(axis=0), keys.max(axis=0)
    columns, rows = (last - first + 1) * size
    occupied = np.zeros((rows, columns), np.float32)
    for tile in tiles:
        column, row = (tile.tile_x - first[0]) * size, (tile.tile_y - first[1]) * size
        occupied[row : row + size, column : column + size] = tile.occupied
    return occupied, int(first[0]) * size, int(first[1]) * size
