"""Lattices: centres of cells in slabs, and questions to many points, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from warpsph.scene.scene import Scene
from warpsph.shapes.points import BLOCK, Array

# A point typed to five digits still rests on the slope that it was computed for. In spacings.
CLEARANCE_SLACK = 1e-3
# Sites of two fluids that share a lattice are one spacing apart but for rounding. In spacings.
LATTICE_SLACK = 1e-6
# More points than this are a slip of the spacing, not a scene: they would take tens of GB.
MOST_POINTS = 100_000_000


def cell_centres(scene: Scene, path: str, low: Array, high: Array) -> Iterator[Array]:
    """Centres of the unit cells that meet the box from `low` to `high`, row by row, in slabs of shape [n, 3]."""
    first, last = np.floor(low + 1e-9), np.ceil(high - 1e-9)
    refuse_too_many(scene, path, float(np.prod(np.maximum(last - first, 0.0))))
    x, y, z = (np.arange(a, b) + 0.5 for a, b in zip(first, last, strict=True))
    rows = max(1, BLOCK // max(len(x), 1))  # as many whole rows as a block holds, and as many whole layers
    layers = max(1, rows // max(len(y), 1))
    for k in range(0, len(z), layers):
        for j in range(0, len(y), rows):
            grid = np.meshgrid(z[k : k + layers], y[j : j + rows], x, indexing="ij")
            yield np.stack(grid[::-1], axis=-1).reshape(-1, 3)


def joined(parts: Sequence[Array], shape: tuple[int, ...] = (0, 3)) -> Array:
    """All `parts` end to end, without a copy where there is one; empty, of `shape`, where there is none."""
    if len(parts) == 1:
        return parts[0]
    return np.concatenate([np.empty(shape), *parts])


def refuse_too_many(scene: Scene, path: str, points: float) -> None:
    """Raise SceneError for more points than any machine holds."""
    if points > MOST_POINTS:
        words = f"{scene.spacing:g} m is too fine: {path} would take {points:.2g} points, {MOST_POINTS:.0e} is the most"
        raise scene.error("spacing", words)
