"""The grid's inner loops, compiled: the cells of a cone or an arc, one after the other, straight into the tiles.

Numba compiles this module when it is first imported and keeps the result beside it, or in the user's cache directory
where it can't write there.
"""

import math

import numpy as np
from numba import njit


@njit("i8(f8[::1], i8, i8, f8, f8)", cache=True)
def _first_beyond(distance, first, end, reach, sector_rad):
    """The first cell of a sector from ``first`` to ``end`` that is not within ``reach``: near where the sector's area
    says.
    """
    k = min(first + int(reach * reach * sector_rad / 2), end)
    while k > first and distance[k - 1] >= reach:
        k -= 1
    while k < end and distance[k] < reach:
        k += 1
    return k


_CONES = "i8(i8[:,::1], f8[:,::1], i8[::1], u4[::1], f8[::1], i4[:,::1], i8[:,::1], i4[::1], {0}[:,:,::1], i8, {0})"
_ARCS = (
    "UniTuple(i8, 2)(f8[:,::1], i8[::1], f8, i8, i4[:,::1], i8[:,::1], i4[::1], i4[:,::1], i4[::1], i8, i4[::1],"
    "f4[:,::1], f4[:,::1], i8, i8)"
)


@njit([_CONES.format("u2"), _CONES.format("u4")], cache=True)
def stroke_cones(apex, beam, disc_first, disc_step, disc_distance, window, pieces, spare, counts, side_bits, change):
    """Count cones in (``change`` 1) or out (-1 as an unsigned number): each of their cells at its level of trust.

    apex (n, 2): column and row in the window; beam (n, 5): axis_rad, low_rad, high_rad, reach in cells, width_rad.
    disc_*: as in module ``disc``. window (rows, columns): slots of tiles, -1 where there is none; a tile that is
    needed takes the last slot of ``spare``. pieces, as window: cells counted. counts: (slots, levels, cells of a tile).
    Returns how many of ``spare`` are left.
    """
    levels, cells = counts.shape[1], counts.shape[2]
    flat = counts.ravel()
    left = len(spare)
    sectors = len(disc_first) - 1
    sector_rad = 2 * math.pi / sectors
    # A place is 2^16 rows + columns: its lower bits of each are the cell of the tile, the others the tile.
    column_mask = np.uint32((1 << side_bits) - 1)
    row_shift = np.uint32(16 - side_bits)
    row_mask = np.uint32(((1 << side_bits) - 1) << side_bits)
    tile_mask = np.uint32(0xFFFFFFFF - (((1 << side_bits) - 1) * 0x10001))
    for n in range(len(apex)):
        start = np.uint32((apex[n, 1] << 16) + apex[n, 0])
        for turned in range(math.ceil(beam[n, 1] / sector_rad - 0.5), math.ceil(beam[n, 2] / sector_rad - 0.5)):
            trust = 1 - 2 * abs((turned + 0.5) * sector_rad - beam[n, 0]) / beam[n, 4]
            if trust <= 0:
                continue
            level = np.uint64(int(trust * levels) * cells)
            sector = turned % sectors
            first = disc_first[sector]
            last = _first_beyond(disc_distance, first, disc_first[sector + 1], beam[n, 3], sector_rad)
            while first < last:
                tile = np.uint32(start + disc_step[first]) & tile_mask
                tile_row, tile_column = int(tile >> 16) >> side_bits, int(tile & 0xFFFF) >> side_bits
                if window[tile_row, tile_column] < 0:
                    left -= 1
                    window[tile_row, tile_column] = spare[left]
                base = np.uint64(window[tile_row, tile_column] * levels * cells) + level
                k = first
                while k < last:
                    place = np.uint32(start + disc_step[k])
                    if place & tile_mask != tile:
                        break
                    cell = base + np.uint64(((place >> row_shift) & row_mask) | (place & column_mask))
                    flat[cell] += change
                    k += 1
                pieces[tile_row, tile_column] += k - first
                first = k
    return left


@njit("i8(f8, f8, f8, f8, f8, f8, i8)", cache=True)
def _level_on_arc(dx_m, dy_m, range_m, along_x, along_y, eps_m, steps):
    """The level of what a contact region says of a place (Eq. 5-8, with the region's 6 eps / R for width), -1 where it
    says nothing; (along_x, along_y) is the direction of its contact.
    """
    square = dx_m * dx_m + dy_m * dy_m
    if square > (range_m + eps_m) ** 2 or square < max(range_m - eps_m, 0.0) ** 2:
        return -1
    angle = math.atan2(along_x * dy_m - along_y * dx_m, along_x * dx_m + along_y * dy_m)
    trust = 1 - abs(angle) * range_m / (3 * eps_m)
    if trust <= 0:
        return -1
    off = abs(math.sqrt(square) - range_m) / eps_m
    return min(int(trust * steps), steps - 1) * steps + min(int(off * steps), steps - 1)


@njit(_ARCS, cache=True)
def stroke_arcs(
    arcs, origin, cell_m, steps, window, pieces, spare, rows, spare_rows, left_rows, held, sums, terms, side_bits, sign
):
    """Add (``sign`` 1) or take off (-1) the terms of contact regions in each of their cells.

    arcs (n, 5): x_m, y_m, range_m, direction_rad, epsilon_m. origin: column and row of the window's corner. window,
    pieces, spare: as for cones. rows: (slots, cells of a tile): a cell's row of ``sums``, 0 where it has none; a cell
    that needs one takes number ``left_rows`` - 1 of ``spare_rows``; a row that nothing is held in any more is put back.
    held: beliefs in a row. terms (steps^2, width): of each level. Returns how many spare tiles and rows are left.
    """
    left, inside = len(spare), (1 << side_bits) - 1
    for n in range(len(arcs)):
        x_m, y_m, range_m, direction, eps_m = arcs[n]
        along_x, along_y = math.cos(direction), math.sin(direction)
        # No point of a contact region is farther from its contact: by the law of cosines 3 eps / R round at R + eps,
        # and never beyond the far side.
        tip_m = min(eps_m * math.sqrt(10 + 9 * eps_m / range_m), 2 * range_m + eps_m)
        reach = math.ceil(tip_m / cell_m) + 1
        middle_column = math.floor((x_m + range_m * along_x) / cell_m)
        middle_row = math.floor((y_m + range_m * along_y) / cell_m)
        for row in range(middle_row - reach, middle_row + reach + 1):
            for column in range(middle_column - reach, middle_column + reach + 1):
                dx_m, dy_m = (column + 0.5) * cell_m - x_m, (row + 0.5) * cell_m - y_m
                level = _level_on_arc(dx_m, dy_m, range_m, along_x, along_y, eps_m, steps)
                if level < 0:
                    continue
                tile_row, tile_column = (row - origin[1]) >> side_bits, (column - origin[0]) >> side_bits
                if window[tile_row, tile_column] < 0:
                    left -= 1
                    window[tile_row, tile_column] = spare[left]
                pieces[tile_row, tile_column] += 1
                slot = window[tile_row, tile_column]
                cell = (((row - origin[1]) & inside) << side_bits) | ((column - origin[0]) & inside)
                if rows[slot, cell] == 0:
                    left_rows -= 1
                    rows[slot, cell] = spare_rows[left_rows]
                line = rows[slot, cell]
                held[line] += sign
                for k in range(terms.shape[1]):
                    sums[line, k] += sign * terms[level, k]
                if held[line] == 0:
                    sums[line] = 0
                    rows[slot, cell] = 0
                    spare_rows[left_rows] = line
                    left_rows += 1
    return left, left_rows
