"""The grid's inner loops, compiled: the cells of cones and contact regions, one after the other, straight into the
tiles.

Numba compiles this module when it is first imported and keeps the result beside it, or in the user's cache directory
where it can't write there.
"""

import math

import numpy as np
from numba import njit

from noctule_mapper.fusion import sensor_model
from noctule_mapper.grid.geometry import cone_rows, tip_m

_SILENT = 255  # the level of a sector that a cone says nothing of

_direction_trust = njit("f8(f8, f8)", cache=True)(sensor_model.direction_trust)  # Eq. 5
_off_arc = njit("f8(f8, f8, f8)", cache=True)(sensor_model.off_arc)  # Eq. 6-7
_free_level = njit("i8(f8)", cache=True)(sensor_model.free_level)
_arc_level = njit("i8(f8, f8)", cache=True)(sensor_model.arc_level)

# The directory of the tiles, as in module ``tiles``: corner, window, keys, pieces, stamps, spare, left.
_TILES = "i8[::1], i4[:,::1], i8[:,::1], i8[::1], i8[::1], i4[::1], i8[::1]"
_CONES = f"void(f8[:,::1], u2[:,::1], i8, {_TILES}, {{0}}[:,:,::1], i8, {{0}}, i8)"
_ARCS = f"void(f8[:,::1], f8, {_TILES}, i4[:,::1], i4[::1], i4[::1], f4[:,::1], f4[:,::1], i8, f4, i8)"


@njit(cache=True)
def _slot(tile_column, tile_row, corner, window, spare, left):
    """The slot of a tile of the window, the next spare one where it has none."""
    slot = window[tile_row - corner[1], tile_column - corner[0]]
    return slot if slot >= 0 else spare[left[0] - 1]


@njit(cache=True)
def _enter(slot, tile_column, tile_row, pieces_more, stamp, corner, window, keys, pieces, stamps, left):
    """Write down what was done in the slot that ``_slot`` gave."""
    row, column = tile_row - corner[1], tile_column - corner[0]
    if window[row, column] < 0:
        window[row, column] = slot
        keys[slot, 0], keys[slot, 1] = tile_column, tile_row
        left[0] -= 1
    pieces[slot] += pieces_more
    stamps[slot] = stamp


@njit("UniTuple(i8, 2)(u1[::1], f8, f8, f8, f8)", cache=True)
def _set_levels(level_of, axis_rad, low_rad, high_rad, width_rad):
    """The level of each sector that has its middle between two directions; the first of them, and the one after the
    last.
    """
    sector_rad = 2 * math.pi / len(level_of)
    first, last = math.ceil(low_rad / sector_rad - 0.5), math.ceil(high_rad / sector_rad - 0.5)
    last = min(last, first + len(level_of) // 2)  # beams are half a turn wide at most; more would be a rounding error
    for turned in range(first, last):
        trust = _direction_trust((turned + 0.5) * sector_rad - axis_rad, width_rad)
        if trust > 0:
            level_of[turned % len(level_of)] = _free_level(trust)
    return first, last


@njit("UniTuple(i8, 2)(i8[::1], i8[::1], i8, u1[::1], u2[::1], i8, i8)", cache=True)
def _trim(begins, ends, rows, level_of, sector_of, place, wide):
    """Take off each row's ends what the sectors leave out; the first column of all, and the last. ``place`` is the
    place of row 0, column 0 in ``sector_of``.
    """
    leftmost, rightmost = wide, -wide
    for k in range(rows):
        begin, end = begins[k], ends[k]
        while begin < end and level_of[sector_of[place + begin]] == _SILENT:
            begin += 1
        while begin < end and level_of[sector_of[place + end - 1]] == _SILENT:
            end -= 1
        if begin < end:
            leftmost, rightmost = min(leftmost, begin), max(rightmost, end - 1)
        begins[k], ends[k] = begin, end
        place += wide
    return leftmost, rightmost


@njit([_CONES.format("u2"), _CONES.format("u4")], cache=True)
def stroke_cones(
    cones, sectors_about, sectors, corner, window, keys, pieces, stamps, spare, left, counts, side, change, stamp
):
    """Count cones in (``change`` 1) or out (-1 as an unsigned number): each of their cells at its level of trust.

    cones (n, 7): as ``regions.Cones``. sectors_about: as in module ``polar_cells``. corner to left: the directory of
    the tiles, with room for all of them. counts: (slots, cells of a tile, levels).
    """
    sign = 1 if change == 1 else -1
    levels, cells, wide = np.uint64(counts.shape[2]), side * side, sectors_about.shape[1]
    flat, sector_of = counts.ravel(), sectors_about.ravel()
    middle = (wide // 2) * (wide + 1)  # the place of the sensor's cell in ``sector_of``
    level_of = np.full(sectors, _SILENT, np.uint8)
    begins, ends = np.empty(wide, np.int64), np.empty(wide, np.int64)
    for n in range(len(cones)):
        column, row = int(cones[n, 0]), int(cones[n, 1])
        first, last = _set_levels(level_of, cones[n, 2], cones[n, 3], cones[n, 4], cones[n, 6])
        sector_rad = 2 * math.pi / sectors
        lowest, rows = cone_rows(begins, ends, first * sector_rad, last * sector_rad, cones[n, 5])
        leftmost, rightmost = _trim(begins, ends, rows, level_of, sector_of, middle + lowest * wide, wide)
        for tile_row in range((row + lowest) // side, (row + lowest + rows - 1) // side + 1):
            south = tile_row * side - row
            for tile_column in range((column + leftmost) // side, (column + rightmost) // side + 1):
                west = tile_column * side - column
                slot = _slot(tile_column, tile_row, corner, window, spare, left)
                said = 0
                for y in range(max(south, lowest), min(south + side, lowest + rows)):
                    begin, end = max(begins[y - lowest], west), min(ends[y - lowest], west + side)
                    said += max(end - begin, 0)
                    sector, cell = np.uint64(middle + y * wide), np.uint64(slot * cells + (y - south) * side - west)
                    for x in range(begin, end):
                        level = np.uint64(level_of[sector_of[sector + np.uint64(x)]])  # Eq. 5 and 7
                        flat[(cell + np.uint64(x)) * levels + level] += change
                if said > 0:
                    _enter(slot, tile_column, tile_row, sign * said, stamp, corner, window, keys, pieces, stamps, left)
        for turned in range(first, last):
            level_of[turned % sectors] = _SILENT


@njit("i8(f8, f8, f8, f8, f8, f8)", cache=True)
def _level_on_arc(dx_m, dy_m, range_m, along_x, along_y, eps_m):
    """The level of what a contact region says of a place (Eq. 5-8, with the region's 6 eps / R for width), -1 where it
    says nothing; (along_x, along_y) is the direction of its contact.
    """
    aside_m = along_x * dy_m - along_y * dx_m
    if abs(aside_m) > 3 * eps_m * (1 + eps_m / range_m):  # farther than the region's edge along the outer arc
        return -1
    off = _off_arc(math.sqrt(dx_m * dx_m + dy_m * dy_m), range_m, eps_m)  # Eq. 6-7
    if off > 1:
        return -1
    trust = _direction_trust(math.atan2(aside_m, along_x * dx_m + along_y * dy_m), 6 * eps_m / range_m)  # Eq. 5
    return _arc_level(trust, off) if trust > 0 else -1


@njit(_ARCS, cache=True)
def stroke_arcs(
    arcs,
    cell_m,
    corner,
    window,
    keys,
    pieces,
    stamps,
    spare,
    left,
    rows,
    spare_rows,
    held,
    sums,
    terms,
    side,
    sign,
    stamp,
):
    """Add (``sign`` 1) or take off (-1) the terms of contact regions in each of their cells.

    arcs (n, 5): as ``regions.Arcs``. corner to left: the directory of the tiles, with room for all of them. rows:
    (slots, cells of a tile): a cell's row of ``sums``, 0 where it has none; a cell that needs one takes number
    ``left[1]`` - 1 of ``spare_rows``; a row that holds nothing any more is given back. held: beliefs in a row. terms:
    (levels, width).
    """
    for n in range(len(arcs)):
        x_m, y_m, range_m, eps_m = arcs[n, 0], arcs[n, 1], arcs[n, 2], arcs[n, 4]
        along_x, along_y = math.cos(arcs[n, 3]), math.sin(arcs[n, 3])
        long_m = tip_m(range_m, eps_m)
        # A region of a radian either way is no deeper than eps and what the arc bends off its tangent.
        deep_m = eps_m + 4.5 * eps_m * eps_m / range_m if 3 * eps_m <= range_m else long_m
        reach_x, reach_y = deep_m * abs(along_x) + long_m * abs(along_y), deep_m * abs(along_y) + long_m * abs(along_x)
        middle_x, middle_y = x_m + range_m * along_x, y_m + range_m * along_y
        for row in range(math.floor((middle_y - reach_y) / cell_m), math.floor((middle_y + reach_y) / cell_m) + 1):
            for column in range(
                math.floor((middle_x - reach_x) / cell_m), math.floor((middle_x + reach_x) / cell_m) + 1
            ):
                dx_m, dy_m = (column + 0.5) * cell_m - x_m, (row + 0.5) * cell_m - y_m
                level = _level_on_arc(dx_m, dy_m, range_m, along_x, along_y, eps_m)
                if level < 0:
                    continue
                tile_row, tile_column = row // side, column // side
                slot = _slot(tile_column, tile_row, corner, window, spare, left)
                _enter(slot, tile_column, tile_row, int(sign), stamp, corner, window, keys, pieces, stamps, left)
                cell = (row - tile_row * side) * side + column - tile_column * side
                if rows[slot, cell] == 0:
                    left[1] -= 1
                    rows[slot, cell] = spare_rows[left[1]]
                line = rows[slot, cell]
                held[line] += int(sign)
                for k in range(terms.shape[1]):
                    sums[line, k] += sign * terms[level, k]
                if held[line] == 0:
                    sums[line] = 0
                    rows[slot, cell] = 0
                    spare_rows[left[1]] = line
                    left[1] += 1
