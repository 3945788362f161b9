"""Points and vectors, of the x-z plane and of space: what more than one room does with them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# So many points are worked on at a time: more would only take memory.
BLOCK = 1 << 18


def spatial(vector: Sequence[float] | Array) -> Array:
    """A point or a vector [x, z] as [x, 0, z], shape [3]; one of three numbers as it is."""
    return np.array(vector if len(vector) == 3 else (vector[0], 0.0, vector[1]), dtype=float)


def in_plane(points: Array) -> Array:
    """x and z of points [n, 3], shape [n, 2]."""
    return np.ascontiguousarray(points[:, [0, 2]])


def in_space(plane: Array, y: float = 0.0) -> Array:
    """Points or vectors [n, 2] of the x-z plane as [n, 3]."""
    return np.insert(plane, 1, y, axis=1)


def middles_between(begin: float, end: float, spacing: float, low: float, high: float) -> tuple[Array, Array]:
    """Middles of pieces from `begin` to `end`, and how long each is between `low` and `high` [m]."""
    edges = np.linspace(begin, end, max(1, math.ceil((end - begin) / spacing - 1e-9)) + 1)
    length = np.minimum(edges[1:], high) - np.maximum(edges[:-1], low)
    return 0.5 * (edges[:-1] + edges[1:]), np.maximum(length, 0.0)


def across(plane: Array, stations: Array) -> Array:
    """Points of the x-z plane [n, 2], once at each of the stations along y [k], shape [k n, 3]."""
    return np.concatenate([np.empty((0, 3)), *(in_space(plane, y) for y in stations)])


def divide(low: float, high: float, spacing: float) -> tuple[Array, Array]:
    """Stations from `low` to `high`, both included and at most `spacing` apart, and the length of each [m]."""
    pieces = max(1, math.ceil((high - low) / spacing - 1e-9))
    share = np.full(pieces + 1, (high - low) / pieces)
    share[[0, -1]] /= 2
    return np.linspace(low, high, pieces + 1), share


def nothing_at(points: Array) -> Array:
    """A row of zeros that is seen as many times as there are points, not to be written to, shape [n, 3]."""
    return np.broadcast_to(np.zeros(3), points.shape)


def turned(points: ArrayLike, angle: float, pivot: ArrayLike | None = None) -> Array:
    """Plane points [n, 2] turned counter-clockwise by `angle` [rad] about `pivot`, the origin when absent."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    points = np.asarray(points, float)
    return points @ turn if pivot is None else (points - pivot) @ turn + pivot


def unit(vector: Array, otherwise: ArrayLike) -> Array:
    """The unit vector along `vector`, shape [3] or [2]; `otherwise` where it has no length."""
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-12 else np.asarray(otherwise, float)


def around(*sets: Array) -> tuple[Array, Array]:
    """Lower and upper corner of the box around points [m], each of shape [3]; some of the sets may be empty."""
    some = [points.T for points in sets if len(points)]
    # Column by column: over rows of three numpy takes ten times as long.
    lower = np.array([min(float(points[axis].min()) for points in some) for axis in range(3)])
    return lower, np.array([max(float(points[axis].max()) for points in some) for axis in range(3)])


def inside_box(points: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """Whether each of `points` [n, 3] lies inside a box and not on its faces, shape [n]."""
    inside = np.ones(len(points), dtype=bool)
    for x, a, b in zip(points.T, low, high, strict=True):
        inside &= (x > a) & (x < b)
    return inside


def inside_polygon(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """Whether each of `points` [n, 2] lies inside `polygon` [k, 2] by the even-odd rule, shape [n]."""
    inside = np.zeros(len(points), dtype=bool)
    x, z = points[:, 0], points[:, 1]
    for (ax, az), (bx, bz) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if az != bz:
            with np.errstate(over="ignore"):  # of a side that is next to level: which part of it counts, one cannot say
                inside ^= ((az > z) != (bz > z)) & (x < ax + (z - az) * (bx - ax) / (bz - az))
    return inside


def near(points: Array, others: Array, reach: float) -> NDArray[np.bool_]:
    """Whether each of `points` [n, 3] is closer than `reach` [m] to any of `others` [k, 3], shape [n]."""
    found = np.zeros(len(points), dtype=bool)
    if not len(points) or not len(others):
        return found
    # Only where the boxes around both overlap can there be any.
    low, high = around(others)
    candidates = np.flatnonzero(inside_box(points, low - reach, high + reach))
    low, high = around(points)
    others = others[inside_box(others, low - reach, high + reach)]
    for some in np.split(candidates, range(BLOCK, len(candidates), BLOCK)):
        if len(some):
            chosen = points[some]
            low, high = around(chosen)
            found[some] = _near(chosen, others[inside_box(others, low - reach, high + reach)], reach)
    return found


def _near(points: Array, others: Array, reach: float) -> NDArray[np.bool_]:
    """The same, all at once."""
    found = np.zeros(len(points), dtype=bool)
    if not len(others):
        return found
    # Cells of edge `reach` numbered row by row with a margin of one, so that a neighbour is never a wrap-around.
    low = np.minimum(points.min(axis=0), others.min(axis=0))
    cell = np.floor((points - low) / reach).astype(np.int64) + 1
    other_cell = np.floor((others - low) / reach).astype(np.int64) + 1
    _, *rows = np.maximum(cell.max(axis=0), other_cell.max(axis=0)) + 2
    weight = np.array([math.prod(rows[axis:]) for axis in range(len(rows) + 1)])
    other_key = other_cell @ weight
    order = np.argsort(other_key, kind="stable")
    other_key, others = other_key[order], others[order]
    for step in product((-1, 0, 1), repeat=len(weight)):
        key = (cell + step) @ weight
        first = np.searchsorted(other_key, key, side="left")
        count = np.searchsorted(other_key, key, side="right") - first
        for k in range(count.max()):
            rows = np.flatnonzero((count > k) & ~found)
            gap = points[rows] - others[first[rows] + k]
            found[rows] = np.einsum("ij,ij->i", gap, gap) < reach**2
    return found
