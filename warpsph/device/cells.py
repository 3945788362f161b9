"""Cells on the host's side: the box that they fill, and points sorted by them."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from warpsph.device.launch import Launcher, alias
from warpsph.kernels import neighbours as kernels

# Cells to the list radius: half as wide as the radius, cells enclose it so closely that half of the candidates are
# neighbours; narrower still, there are more rows to walk.
REACH = 2
# A box may have this many cells a particle, or this many in all; beyond, cells are made wider.
CELLS_PER_PARTICLE, LEAST_CELLS = 8, 1 << 16


def cell_grid(lower: np.ndarray, upper: np.ndarray, radius: float, dimensions: int, particles: int) -> kernels.CellGrid:
    """Cells over the box from `lower` to `upper` [m], shape [3], for lists of `radius` [m]."""
    extent = np.maximum(upper - lower, radius)
    inside = sorted([0, 2] if dimensions == 2 else [0, 1, 2], key=lambda axis: extent[axis])
    axes = inside if dimensions == 3 else [*inside, 1]
    edge = radius / REACH
    most = max(CELLS_PER_PARTICLE * particles, LEAST_CELLS)
    edge *= max(1.0, (math.prod(extent[inside] / edge) / most) ** (1 / dimensions))

    inner, reach = np.ones(3, int), np.zeros(3, int)
    inner[:dimensions] = np.ceil(extent[inside] / edge).astype(int)
    reach[:dimensions] = REACH
    count = inner + 2 * reach
    grid = kernels.CellGrid()
    grid.origin, grid.inverse_edge = wp.vec3(*lower[axes]), 1.0 / edge
    grid.axes, grid.inner, grid.reach, grid.count = (wp.vec3i(*map(int, n)) for n in (axes, inner, reach, count))
    grid.blocks = wp.vec3i(*(-(-int(n) // int(kernels.BLOCK_EDGE)) for n in count))
    return grid


class Cells:
    """Points sorted by cell.

    Attributes:
        cell: Cell of the point in each slot, shape [2 point_count]; the second half is room for sorting.
        order: order[new slot] = old slot, likewise.
        start: start[c] = first slot of cell c, shape [cell_count + 1].
    """

    def __init__(
        self, grid: kernels.CellGrid, position: wp.array, launcher: Launcher, lent: Sequence[wp.array] = ()
    ) -> None:
        """`position` [m], shape [point_count], is where the points are whenever they are sorted.

        `lent` may be two arrays of as many entries, of 8 bytes or more, for `cell` and `order` to live in.
        """
        self._count, cells = len(position), math.prod(grid.count)
        self._bits = cells.bit_length()
        room = 2 * self._count
        self.cell, self.order = (
            [alias(array, int, room) for array in lent]
            if lent
            else [wp.zeros(room, dtype=int, device=launcher.device) for _ in range(2)]
        )
        self.start = wp.zeros(cells + 1, dtype=int, device=launcher.device)
        if not self._count:
            self._launches: list[Callable[[], None]] = []
            return
        record, count = launcher.record, self._count
        self._launches = [
            record(kernels.find_cells, count, self, grid=grid, position=position),
            lambda: wp.utils.radix_sort_pairs(self.cell, self.order, count, end_bit=self._bits),
            record(kernels.search_starts, cells + 1, self, count=count)
            if launcher.device.is_cuda
            else record(kernels.find_starts, count, self, count=count, cell_count=cells),
        ]

    def sort(self) -> None:
        """Find the cell of each point, and the order of slots by cell; the sort is stable, so it is reproducible."""
        for launch in self._launches:
            launch()
