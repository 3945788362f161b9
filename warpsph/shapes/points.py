"""Points and vectors, of the x-z plane and of space: what more than one room does with them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


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
