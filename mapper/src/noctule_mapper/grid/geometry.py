"""Cones and contact regions as shapes among the grid's cells, compiled: their tables, and where they end."""

import math

import numpy as np
from numba import f8, i8, types

from noctule_mapper.contacts.voting import Kind
from noctule_mapper.grid import compiling, regions
from noctule_mapper.grid.compiling import compiled

_NO_CONTACT = int(Kind.NONE)
_READ, _KINDS = (types.Array(of, 1, "A", readonly=True) for of in (f8, i8))
TIE_CELLS = 1e-6  # a cell so near the edge of a cone is inside

compiling.announce()


_epsilon_m = compiled("f8(f8, f8, f8)")(regions.bounded_epsilon_m)


@compiled(f8[:, ::1](f8, f8, f8, _READ, _READ, f8, f8, f8, f8, f8))
def beams(x_m, y_m, heading_rad, bearing_rad, range_m, width_rad, sigma_m, sigmas, cell_m, farthest):
    """``regions.Cones`` of one sweep: the beams (n,) that have a range, by rising axis. Where one cone ends at the
    next, both have the same number there, so that no direction is in both.
    """
    eps_m = _epsilon_m(sigma_m, sigmas, cell_m)
    axes, reaches, count = np.empty(len(range_m)), np.empty(len(range_m)), 0
    for n in range(len(range_m)):
        if math.isfinite(range_m[n]):
            axis, k = (heading_rad + bearing_rad[n]) % (2 * math.pi), count
            while k > 0 and axes[k - 1] > axis:  # sorted by insertion, as they nearly are
                axes[k], reaches[k] = axes[k - 1], reaches[k - 1]
                k -= 1
            axes[k], reaches[k] = axis, (range_m[n] - eps_m) / cell_m
            count += 1
    column, row, cones = math.floor(x_m / cell_m), math.floor(y_m / cell_m), np.empty((count, 8))
    for n in range(count):
        axis = axes[n]
        before = axis - axes[n - 1] if n else axis + 2 * math.pi - axes[count - 1]
        after = axes[n + 1] - axis if n + 1 < count else axes[0] + 2 * math.pi - axis
        cones[n, 0], cones[n, 1], cones[n, 2] = column, row, axis
        cones[n, 3], cones[n, 4] = axis - min(before, width_rad) / 2, axis + min(after, width_rad) / 2
        if n and before <= width_rad:
            cones[n, 3] = cones[n - 1, 4]
        cones[n, 5], cones[n, 6] = min(max(reaches[n], 0.0), farthest), width_rad
        cones[n, 7] = n == 0
    return cones


@compiled(f8[:, ::1](_KINDS, _READ, _READ, _READ, _READ, _READ, f8, f8))
def contact_arcs(kind, x_m, y_m, range_m, direction_rad, sigma_m, sigmas, cell_m):
    """``regions.Arcs`` of the echoes (n,) that have a contact."""
    arcs, found = np.empty((len(kind), 5)), 0
    for n in range(len(kind)):
        if kind[n] != _NO_CONTACT:
            arcs[found, 0], arcs[found, 1], arcs[found, 2] = x_m[n], y_m[n], range_m[n]
            arcs[found, 3], arcs[found, 4] = direction_rad[n], _epsilon_m(sigma_m[n], sigmas, cell_m)
            found += 1
    return arcs[:found]


@compiled("f8(f8, f8)")
def tip_m(range_m, eps_m):
    """No point of a contact region is farther from its contact: by the law of cosines 3 eps / R round at R + eps, and
    never beyond the far side.
    """
    return min(eps_m * math.sqrt(10 + 9 * eps_m / range_m), 2 * range_m + eps_m)


@compiled("UniTuple(f8, 5)(UniTuple(f8, 5), f8, f8, f8)")
def _widened(box, x, y, reach):
    """``box`` with the square of half side ``reach`` about (x, y) in it, and the greatest half side so far."""
    return (
        min(box[0], x - reach),
        min(box[1], y - reach),
        max(box[2], x + reach),
        max(box[3], y + reach),
        max(box[4], reach),
    )


@compiled("UniTuple(i8, 5)(f8[:,::1])")
def cone_box(cones):
    """The least column and row, the greatest column and row that ``cones`` can touch, and their farthest reach, in
    cells.
    """
    box = (np.inf, np.inf, -np.inf, -np.inf, 0.0)
    for n in range(len(cones)):
        box = _widened(box, cones[n, 0], cones[n, 1], cones[n, 5])
    return math.floor(box[0]), math.floor(box[1]), math.ceil(box[2]), math.ceil(box[3]), math.ceil(box[4])


@compiled("UniTuple(i8, 5)(f8[:,::1], f8)")
def arc_box(arcs, cell_m):
    """The same of contact regions, the reach from their contacts."""
    box = (np.inf, np.inf, -np.inf, -np.inf, 0.0)
    for n in range(len(arcs)):
        range_m, direction = arcs[n, 2], arcs[n, 3]
        x_m, y_m = arcs[n, 0] + range_m * math.cos(direction), arcs[n, 1] + range_m * math.sin(direction)
        box = _widened(box, x_m / cell_m, y_m / cell_m, tip_m(range_m, arcs[n, 4]) / cell_m)
    return math.floor(box[0]), math.floor(box[1]), math.ceil(box[2]), math.ceil(box[3]), math.ceil(box[4])


@compiled("UniTuple(i8, 4)(f8, f8, f8)")
def sector_box(low_rad, high_rad, reach):
    """The least column and row, the greatest column and row of the cells between two directions, half a turn apart at
    most, and within ``reach`` of (0, 0). The sector holds a direction whose cosine against its middle is that of its
    edges or more.
    """
    half = (high_rad - low_rad) / 2
    x, y = math.cos(low_rad + half), math.sin(low_rad + half)
    edge, aside = math.cos(half), math.sin(half)
    low_x, low_y = x * edge + y * aside, y * edge - x * aside
    high_x, high_y = x * edge - y * aside, y * edge + x * aside
    left = -1.0 if -x >= edge else min(0.0, low_x, high_x)
    low = -1.0 if -y >= edge else min(0.0, low_y, high_y)
    right = 1.0 if x >= edge else max(0.0, low_x, high_x)
    high = 1.0 if y >= edge else max(0.0, low_y, high_y)
    return (
        math.ceil(reach * left - TIE_CELLS),
        math.ceil(reach * low - TIE_CELLS),
        math.floor(reach * right + TIE_CELLS),
        math.floor(reach * high + TIE_CELLS),
    )
