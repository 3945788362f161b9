"""How noisy the pressure is, and how many neighbours there are: measured from snapshots, on the host.

Noise is p minus the mean pressure of the neighbours within 3 dx, the particle itself left out, as a root mean square
over the interior particles and over rho g H. A pressure that varies linearly gives nothing where neighbours stand
symmetrically.

Interior are the particles that have at least nine tenths of the neighbours that a full lattice gives within 3 dx (28 in
the plane, 122 in space) and no wall point within 3 dx: that leaves out the two outermost rows at a free surface, spray,
and whatever walls push directly.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

REACH = 3.0  # [dx]
FULLNESS = 0.9  # of the neighbours on a lattice
SLACK = 1e-6  # a neighbour on the lattice that is 3 dx away counts, whatever the rounding
CHUNK = 2048  # particles whose neighbours are looked up at once
ENOUGH = 50_000  # particles to measure: of more, a sample


def pressure_noise(position: Array, pressure: Array, wall_position: Array, spacing: float, scale: float) -> float:
    """Noise of the pressure, a fraction of `scale`; NaN where no particle is interior.

    Args:
        position: Of the particles [m], shape [n, 3].
        pressure: [Pa], shape [n].
        wall_position: Of the wall points [m], shape [k, 3].
        spacing: dx [m].
        scale: rho g H [Pa].
    """
    reach = REACH * spacing * (1.0 + SLACK)
    dimensions = 2 if np.ptp(position[:, 1]) == 0.0 else 3
    chosen = sample(len(position))
    chosen = chosen[neighbours(position[chosen], wall_position, reach) == 0]
    count, total = -np.ones(len(chosen)), -pressure[chosen].astype(float)  # each finds itself too
    for i, j in pairs(position[chosen], position, reach):
        count += np.bincount(i, minlength=len(chosen))
        total += np.bincount(i, weights=pressure[j], minlength=len(chosen))
    interior = count >= FULLNESS * lattice_neighbours(dimensions)
    if not interior.any():
        return math.nan
    roughness = pressure[chosen][interior] - total[interior] / count[interior]
    return float(np.sqrt(np.mean(roughness**2)) / scale)


def sample(count: int) -> Indices:
    """All of `count` particles, or as many of them, spread by chance but always the same, as are enough."""
    if count <= ENOUGH:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, ENOUGH, replace=False))


def lattice_neighbours(dimensions: int) -> int:
    """Neighbours within 3 dx on a full lattice."""
    steps = np.arange(-math.ceil(REACH), math.ceil(REACH) + 1)
    squares = sum(axis**2 for axis in np.meshgrid(*[steps] * dimensions))
    return int(np.sum(squares <= REACH**2)) - 1


def neighbours(points: Array, others: Array, reach: float) -> NDArray[np.int64]:
    """How many of `others` [k, 3] are within `reach` [m] of each of `points` [n, 3], shape [n]."""
    count = np.zeros(len(points), dtype=np.int64)
    for i, _ in pairs(points, others, reach):
        count += np.bincount(i, minlength=len(points))
    return count


def pairs(points: Array, others: Array, reach: float) -> Iterator[tuple[Indices, Indices]]:
    """All i, j with points[i] and others[j] within `reach` [m], some thousand `points` at a time."""
    if not len(points) or not len(others):
        return
    # Cells of edge `reach`, numbered with a margin of one so that a neighbour is never a wrap-around; z runs fastest,
    # so that the three cells below, at and above a point are one run of the sorted points.
    low = np.minimum(points.min(axis=0), others.min(axis=0))
    cell, other_cell = (np.floor((x - low) / reach).astype(np.int64) + 1 for x in (points, others))
    _, across, up = np.maximum(cell.max(axis=0), other_cell.max(axis=0)) + 2
    key, other_key = ((c[:, 0] * across + c[:, 1]) * up + c[:, 2] for c in (cell, other_cell))
    order = np.argsort(other_key, kind="stable")
    other_key = other_key[order]
    columns = np.array([(dx * across + dy) * up for dx in (-1, 0, 1) for dy in (-1, 0, 1)])
    for begin in range(0, len(points), CHUNK):
        columns_of_chunk = key[begin : begin + CHUNK, None] + columns
        first = np.searchsorted(other_key, columns_of_chunk - 1, side="left").ravel()
        length = np.searchsorted(other_key, columns_of_chunk + 1, side="right").ravel() - first
        i = np.repeat(np.arange(len(length)) // len(columns) + begin, length)
        within_run = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
        j = order[np.repeat(first, length) + within_run]
        gap = points[i] - others[j]
        near = np.einsum("ij,ij->i", gap, gap) <= reach**2
        yield i[near], j[near]
