"""The grid's inner loops, compiled: the cells of cones and contact regions, one after the other, straight into the
tiles.

Numba compiles this module when it is first imported and keeps the result beside it, or in the user's cache directory
where it can't write there.
"""

import math

import numpy as np

from noctule_mapper.fusion import sensor_model
from noctule_mapper.grid.compiling import compiled
from noctule_mapper.grid.geometry import TIE_CELLS, arc_box, beams, cone_box, contact_arcs, sector_box, tip_m

_direction_trust = compiled(sensor_model.direction_trust)  # Eq. 5
_off_arc = compiled(sensor_model.off_arc)  # Eq. 6-7
_free_level = compiled(sensor_model.free_level)
_arc_level = compiled(sensor_model.arc_level)

# The directory of the tiles, as in module ``tiles``: state, window, slots, spare.
_TILES = "i8[::1], i4[:,::1], i8[:,::1], i4[::1]"
_POLAR = f"i4[:,::1], i4[:,::1], i8, {_TILES}, u8[:,::1], {{0}}[:,:,::1], i8, i8, i8"
_CONES = f"b1(f8[:,::1], {_POLAR})"
_SWEEP = f"b1(f8, f8, f8, f8[::1], f8[::1], f8, f8, f8, f8, f8, {_POLAR})"
_SETTLE = "void(i8[::1], i8[:,::1], u8[:,::1], {0}[:,:,::1], i8)"
_SUMS = f"f8, {_TILES}, i4[:,::1], i4[::1], i4[::1], f4[:,::1], f4[:,::1], i8, i8, i8"
_ARCS = f"b1(f8[:,::1], {_SUMS})"
_CONTACTS = f"b1(i8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8, {_SUMS})"

# What ``state`` holds, FANS the number of the newest fan; how many these are.
CORNER_COLUMN, CORNER_ROW, SPARE_SLOTS, SPARE_ROWS, FANS, STATES = range(6)
COLUMN, ROW, PIECES, STAMP, FAN, STROKES, FIELDS = range(7)  # what ``slots`` holds of a tile; their number
LANE_BITS = 8  # of a level in a cell's fresh counts
MOST_STROKES = 127  # that a lane can hold, either way
_FAN_STROKES = 2  # of a sweep's cones in one cell: they do not overlap, but the last may run into the first
_HALF = 1 << LANE_BITS - 1
_MIDDLES = np.uint64(sum(1 << LANE_BITS * k + LANE_BITS - 1 for k in range(sensor_model.FREE_LEVELS)))


@compiled("i8(UniTuple(i8, 5), i8, i8)")
def most_tiles(box, strokes, side):
    """No more tiles than these are touched by so many strokes inside ``box``."""
    wide, high = box[2] // side - box[0] // side + 1, box[3] // side - box[1] // side + 1
    return min(wide * high, strokes * (2 * box[4] // side + 2) ** 2)


@compiled("b1(UniTuple(i8, 5), i8, i8[::1], i4[:,::1], i8)")
def has_room(box, strokes, state, window, side):
    """Whether the window holds ``box`` and there are spare slots for the tiles that so many strokes may touch."""
    first_column, first_row, last_column, last_row = box[0] // side, box[1] // side, box[2] // side, box[3] // side
    column, row = state[CORNER_COLUMN], state[CORNER_ROW]
    inside = first_column >= column and last_column < column + window.shape[1]
    inside = inside and first_row >= row and last_row < row + window.shape[0]
    return inside and state[SPARE_SLOTS] >= most_tiles(box, strokes, side)


@compiled
def _new_slot(row, column, state, window, slots, spare):
    """The next spare slot, for the tile in ``row`` and ``column`` of the window, which has none."""
    state[SPARE_SLOTS] -= 1
    slot = spare[state[SPARE_SLOTS]]
    window[row, column] = slot
    slots[slot, COLUMN], slots[slot, ROW] = column + state[CORNER_COLUMN], row + state[CORNER_ROW]
    return slot


@compiled
def _settle(slot, state, slots, fresh, counts, side):
    """Move the fresh counts of a tile's cells to ``counts``."""
    first_row = (slots[slot, ROW] - state[CORNER_ROW]) * side
    first_column = (slots[slot, COLUMN] - state[CORNER_COLUMN]) * side
    settled, size, moved = counts[slot].ravel(), side * counts.shape[2], 0
    for row in range(side):  # in loops so plain that they are compiled to vector instructions
        lanes = fresh[first_row + row, first_column : first_column + side]
        for column in range(len(lanes)):
            lanes[column] += _MIDDLES
        each, of_row = lanes.view(np.uint8), settled[row * size : (row + 1) * size]  # the first byte is level 0
        for k in range(len(each)):
            of_row[k] += each[k]
            of_row[k] -= _HALF
        for k in range(len(each)):
            moved += np.int64(each[k])
        for column in range(len(lanes)):
            lanes[column] = 0
    slots[slot, PIECES] += moved - _HALF * side * size
    slots[slot, STROKES] = 0


@compiled([_SETTLE.format("u2"), _SETTLE.format("u4")])
def settle_all(state, slots, fresh, counts, side):
    """Move all fresh counts to ``counts``; the arrays are as in module ``tiles``."""
    for slot in range(len(slots)):
        if slots[slot, STROKES] > 0:
            _settle(slot, state, slots, fresh, counts, side)


@compiled([_CONES.format("u2"), _CONES.format("u4")])
def stroke_cones(cones, cells, rings, reach, state, window, slots, spare, fresh, counts, side, sign, stamp):
    """Count cones in (``sign`` 1) or out (-1): each of their cells at its level of trust. Whether there was room for
    it: where not, nothing is done.

    cones (n, 8): as ``regions.Cones``. cells, rings: as in module ``polar_cells``, up to ``reach`` and with the width
    of ``fresh``. state to counts: as in module ``tiles``.
    """
    box = cone_box(cones)
    if box[4] > reach or not has_room(box, len(cones), state, window, side):
        return False
    sectors, flat, wide = rings.shape[1], fresh.ravel(), fresh.shape[1]
    ring_cells = reach / (len(rings) - 2)
    sector_rad = 2 * math.pi / sectors
    west, south = state[CORNER_COLUMN] * side, state[CORNER_ROW] * side  # the window's, from which cells are counted
    for n in range(len(cones)):
        if n == 0 or cones[n, 7] > 0:
            state[FANS] += 1
        column, row = int(cones[n, 0]) - west, int(cones[n, 1]) - south
        axis_rad, width_rad = cones[n, 2], cones[n, 6]
        # The sectors that have their middle in the cone.
        first, last = math.ceil(cones[n, 3] / sector_rad - 0.5), math.ceil(cones[n, 4] / sector_rad - 0.5)
        last = min(last, first + sectors // 2)  # beams are half a turn wide at most; more would be a rounding error
        left, low, right, high = sector_box(first * sector_rad, last * sector_rad, cones[n, 5])
        for tile_row in range((row + low) // side, (row + high) // side + 1):
            for tile_column in range((column + left) // side, (column + right) // side + 1):
                slot = np.int64(window[tile_row, tile_column])
                if slot < 0:
                    slot = np.int64(_new_slot(tile_row, tile_column, state, window, slots, spare))
                if slots[slot, FAN] != state[FANS]:
                    if slots[slot, STROKES] + _FAN_STROKES > MOST_STROKES:
                        _settle(slot, state, slots, fresh, counts, side)
                    slots[slot, STROKES] += _FAN_STROKES
                    slots[slot, FAN], slots[slot, STAMP] = state[FANS], stamp
        place = row * wide + column
        square, ring = int((cones[n, 5] + TIE_CELLS) ** 2), int(cones[n, 5] / ring_cells) + 1
        ring_after = min(ring + 1, len(rings) - 1)
        for turned in range(first, last):
            trust = _direction_trust((turned + 0.5) * sector_rad - axis_rad, width_rad)  # Eq. 5
            if trust > 0:
                one = np.uint64(1) << np.uint64(LANE_BITS * _free_level(trust))
                change = one if sign > 0 else ~one + np.uint64(1)
                sector = np.uint64(turned & (sectors - 1))  # their number is a power of two
                for k in range(rings[0, sector], rings[ring, sector]):  # Eq. 7
                    flat[np.uint64(place + cells[0, np.uint64(k)])] += change
                # In the ring where the reach ends, a cell beyond it adds 0 to the sensor's own: that costs less than a
                # branch, which the processor could not predict.
                for k in range(rings[ring, sector], rings[ring_after, sector]):
                    within = np.int64(cells[1, np.uint64(k)] <= square)
                    flat[np.uint64(place + within * cells[0, np.uint64(k)])] += np.uint64(within) * change
    return True


@compiled([_SWEEP.format("u2"), _SWEEP.format("u4")])
def stroke_sweep(
    x_m, y_m, heading_rad, bearing_rad, range_m, width_rad, sigma_m, sigmas, cell_m, farthest,
    cells, rings, reach, state, window, slots, spare, fresh, counts, side, sign, stamp,
):  # fmt: skip
    """``beams`` and ``stroke_cones`` in one call."""
    cones = beams(x_m, y_m, heading_rad, bearing_rad, range_m, width_rad, sigma_m, sigmas, cell_m, farthest)
    if len(cones) == 0:
        return True
    return stroke_cones(cones, cells, rings, reach, state, window, slots, spare, fresh, counts, side, sign, stamp)


@compiled
def _angle_rad(aside, along):
    """atan2(aside, along): near the axis by its series, which leaves out less than rounding does."""
    if not 0 <= abs(aside) < 0.1 * along:
        return math.atan2(aside, along)
    slope = aside / along
    square = slope * slope
    tail = 1 / 5 - square * (1 / 7 - square * (1 / 9 - square * (1 / 11 - square * (1 / 13))))
    return slope * (1 - square * (1 / 3 - square * tail))


@compiled
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
    trust = _direction_trust(_angle_rad(aside_m, along_x * dx_m + along_y * dy_m), 6 * eps_m / range_m)  # Eq. 5
    return _arc_level(trust, off) if trust > 0 else -1


@compiled("i8(i8, i8)")
def most_arc_cells(arcs, reach):
    """No more cells than these are touched by so many arcs."""
    return arcs * (2 * reach + 1) ** 2


@compiled(_ARCS)
def stroke_arcs(arcs, cell_m, state, window, slots, spare, rows, spare_rows, held, sums, terms, side, sign, stamp):
    """Add (``sign`` 1) or take off (-1) the terms of contact regions in each of their cells. Whether there was room for
    it: where not, nothing is done.

    arcs (n, 5): as ``regions.Arcs``. state to terms: as in module ``tiles``; a cell that needs a row takes number
    ``state[SPARE_ROWS]`` - 1 of ``spare_rows``, and a row that holds nothing any more is given back.
    """
    box = arc_box(arcs, cell_m)
    if state[SPARE_ROWS] < most_arc_cells(len(arcs), box[4]) or not has_room(box, len(arcs), state, window, side):
        return False
    for n in range(len(arcs)):
        x_m, y_m, range_m, eps_m = arcs[n, 0], arcs[n, 1], arcs[n, 2], arcs[n, 4]
        along_x, along_y = math.cos(arcs[n, 3]), math.sin(arcs[n, 3])
        long_m = tip_m(range_m, eps_m)
        # A region of a radian either way is no deeper than eps and what the arc bends off its tangent.
        deep_m = eps_m + 4.5 * eps_m * eps_m / range_m if 3 * eps_m <= range_m else long_m
        reach_x, reach_y = deep_m * abs(along_x) + long_m * abs(along_y), deep_m * abs(along_y) + long_m * abs(along_x)
        middle_x, middle_y = x_m + range_m * along_x, y_m + range_m * along_y
        first_column, last_column = math.floor((middle_x - reach_x) / cell_m), math.floor((middle_x + reach_x) / cell_m)
        slot, west, south = np.int64(-1), 0, 0  # of the tile of the last cell
        for row in range(math.floor((middle_y - reach_y) / cell_m), math.floor((middle_y + reach_y) / cell_m) + 1):
            for column in range(first_column, last_column + 1):
                dx_m, dy_m = (column + 0.5) * cell_m - x_m, (row + 0.5) * cell_m - y_m
                level = _level_on_arc(dx_m, dy_m, range_m, along_x, along_y, eps_m)
                if level < 0:
                    continue
                if slot < 0 or not (0 <= column - west < side and 0 <= row - south < side):
                    tile_row, tile_column = row // side - state[CORNER_ROW], column // side - state[CORNER_COLUMN]
                    slot = np.int64(window[tile_row, tile_column])
                    if slot < 0:
                        slot = np.int64(_new_slot(tile_row, tile_column, state, window, slots, spare))
                    west, south = slots[slot, COLUMN] * side, slots[slot, ROW] * side
                    slots[slot, STAMP] = stamp
                slots[slot, PIECES] += sign
                cell = (row - south) * side + column - west
                if rows[slot, cell] == 0:
                    state[SPARE_ROWS] -= 1
                    rows[slot, cell] = spare_rows[state[SPARE_ROWS]]
                line = rows[slot, cell]
                held[line] += sign
                for k in range(terms.shape[1]):
                    sums[line, k] += np.float32(sign) * terms[level, k]
                if held[line] == 0:
                    sums[line] = 0
                    rows[slot, cell] = 0
                    spare_rows[state[SPARE_ROWS]] = line
                    state[SPARE_ROWS] += 1
    return True


@compiled(_CONTACTS)
def stroke_contacts(
    kind, x_m, y_m, range_m, direction_rad, sigma_m, sigmas,
    cell_m, state, window, slots, spare, rows, spare_rows, held, sums, terms, side, sign, stamp,
):  # fmt: skip
    """``contact_arcs`` and ``stroke_arcs`` in one call."""
    arcs = contact_arcs(kind, x_m, y_m, range_m, direction_rad, sigma_m, sigmas, cell_m)
    if len(arcs) == 0:
        return True
    tiles = state, window, slots, spare
    return stroke_arcs(arcs, cell_m, *tiles, rows, spare_rows, held, sums, terms, side, sign, stamp)


# The compiled functions themselves. Numba's look at the type of each argument costs as much as three cones, so it is
# left out: who calls these must give just the types of the signatures.
_COUNTS = ("u2", "u4")
CONES_OF_COUNTS = {np.dtype(of): stroke_cones.get_overload(_CONES.format(of)) for of in _COUNTS}
SWEEP_OF_COUNTS = {np.dtype(of): stroke_sweep.get_overload(_SWEEP.format(of)) for of in _COUNTS}
ARCS = stroke_arcs.get_overload(_ARCS)
CONTACTS = stroke_contacts.get_overload(_CONTACTS)
