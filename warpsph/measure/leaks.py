"""Leaks: which particles are behind the walls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpsph.device.cells import Cells, cell_grid
from warpsph.kernels import leaks as kernels
from warpsph.model import Model

# Cells grow to twice their width from one round to the next. Of the wall points one is left, of each way that they
# face, in each of so many parts of a cell along its edge.
PARTS = 4


def behind_walls(model: Model, position: wp.array | NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each particle at `position` [m], shape [n, 3], is on the far side of its nearest wall point, shape [n].

    A particle within two cells of a wall, 3 spacings and more, is held against all wall points; farther off against
    fewer and fewer of them, a quarter of a cell apart, in cells that grow until one is near enough. Of a thing smaller
    than that points are left on all of its sides, so that it is the near one that counts.
    """
    device, count = model.launcher.device, len(position)
    if not isinstance(position, wp.array):
        position = wp.array(np.asarray(position, dtype=np.float64), dtype=wp.vec3d, device=device)
    side = wp.zeros(count, dtype=wp.uint8, device=device)
    for level in _levels(model) if len(model.wall_position) and count else ():
        model.launcher.run(kernels.find_side, count, **level, position=position, side=side)
    return side.numpy() == int(kernels.BEHIND)


def _levels(model: Model) -> Iterator[dict[str, Any]]:
    """Grid, radius [m], starts of cells, points and normals of each round; the last sees all of its points."""
    device, grid, edge = model.launcher.device, model.grid, 2.0 / model.grid.inverse_edge
    points, normals = (values.astype(np.float32) for values in model.wall_line)
    radius, lower, upper = min(grid.reach[0], 2) / grid.inverse_edge, points.min(axis=0), points.max(axis=0)
    while True:
        position = wp.array(points, dtype=wp.vec3, device=device)
        cells = Cells(grid, position, model.launcher)
        cells.sort()
        order = cells.order.numpy()[: len(points)]
        points, normals = points[order], normals[order]
        position.assign(points)
        facing = wp.array(normals, dtype=wp.vec3, device=device)
        yield {"grid": grid, "radius": radius, "start": cells.start, "wall_position": position, "wall_normal": facing}
        if math.isinf(radius):
            return
        kept = _one_in_each(points, normals, lower, edge / PARTS)
        points, normals = points[kept], normals[kept]
        grid = cell_grid(lower, upper, 2.0 * edge, model.scene.dimensions, len(points))
        edge = 2.0 / grid.inverse_edge
        radius = math.inf if max(grid.inner) <= 2 else edge


def _one_in_each(
    points: NDArray[np.float32], normals: NDArray[np.float32], lower: NDArray[np.float32], edge: float
) -> NDArray[np.int64]:
    """Indices of the first of `points` [m], shape [n, 3], in each cell of a lattice with a corner at `lower` [m], of
    each of the 27 ways that normals face."""
    place = ((points - lower) / edge).astype(np.int64)
    size = place.max(axis=0) + 1
    way = np.rint(normals).astype(np.int64) + 1
    key = (place[:, 2] * size[1] + place[:, 1]) * size[0] + place[:, 0]
    key = 27 * key + way @ [1, 3, 9]
    return np.sort(np.unique(key, return_index=True)[1])
