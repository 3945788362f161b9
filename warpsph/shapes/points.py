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
