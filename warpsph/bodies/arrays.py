"""Arrays on a device, and blocks of the points that bodies own."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

# Points that one thread goes through; a fixed number, so that sums do not depend on the threads.
BLOCK_SIZE = 64


class Maker:
    """Makes arrays on a device."""

    def __init__(self, device: wp.Device) -> None:
        self._device = device

    def array(self, values: Any, dtype: Any) -> wp.array:
        """The values as an array of `dtype`."""
        return wp.array(np.asarray(values), dtype=dtype, device=self._device)

    def zeros(self, dtype: Any, *shape: int) -> wp.array:
        """An array of zeros."""
        return wp.zeros(shape, dtype=dtype, device=self._device)

    def blocks(self, sizes: Sequence[int]) -> tuple[int, wp.array, wp.array, wp.array]:
        """Blocks of the points of each body: how many, their first points and bodies, and each body's first block.

        `sizes` are how many points each body has, the ground first.
        """
        firsts = np.concatenate([[0], np.cumsum(sizes)])
        blocks = [
            (first, b) for b, (begin, end) in enumerate(pairwise(firsts)) for first in range(begin, end, BLOCK_SIZE)
        ]
        owners = np.array([b for _, b in blocks], int)
        return (
            len(blocks),
            self.array([*(first for first, _ in blocks), firsts[-1]], int),
            self.array(owners, int),
            self.array(np.searchsorted(owners, np.arange(len(sizes) + 1)), int),
        )
