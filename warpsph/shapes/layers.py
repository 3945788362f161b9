"""Points in layers behind a wall: along a line, between its corners, and in rows from one end to another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from warpsph.shapes.outline import Bend, Leg, Outline
from warpsph.shapes.points import Array

# A joint that turns by more is a corner, and has a point of its own in every layer [rad].
LEAST_CORNER = math.radians(15.0)
# Points of two walls, or of two layers that meet, keep this many spacings apart, else the later one is left out.
LEAST_GAP = 0.6
# How far rounding may bring a point closer to the wall than its layer is deep, in spacings.
SLACK = 0.02


def spread(line: Outline, dx: float) -> tuple[Array, Array]:
    """Points [n, 2] about `dx` [m] apart along a line, and the length that each stands for [m], [n].

    A corner has a point, an end has its first half a step off. Lengths add up to the length of the line; one that has
    shrunk to a point, in the middle of a square of an odd number of steps, stands for a step.
    """
    if line.length < 1e-6 * dx:
        return line.legs[0].points(np.zeros(1)), np.full(1, dx)
    points, shares = [], []
    chains = _chains(line)
    for chain, (opens, closes) in chains:
        length = sum(leg.length for leg in chain)
        halves = 0.5 * (opens + closes)
        steps = max(round(length / dx - halves), 0 if halves else 1) + halves
        first, last = (0.5 if opens else 0.0), (steps - 0.5 if closes else steps)
        station = np.arange(first, last + 1e-6) * length / steps
        points.append(_points_along(chain, station))
        share = np.full(len(station), length / steps)
        share[:1] *= 1.0 if opens else 0.5
        share[-1:] *= 1.0 if closes else 0.5
        shares.append(share)
    # A corner belongs to two chains: the later one's first point is merged into the earlier one's last.
    for i, ((_, (_, closes)), after) in enumerate(zip(chains, [*shares[1:], shares[0]], strict=True)):
        if not closes:
            shares[i][-1] += after[0]
    begins = [0 if opens else 1 for _, (opens, _) in chains]
    kept = [(point[k:], share[k:]) for point, share, k in zip(points, shares, begins, strict=True)]
    return np.concatenate([point for point, _ in kept]), np.concatenate([share for _, share in kept])


def _chains(line: Outline) -> list[tuple[list[Leg], tuple[bool, bool]]]:
    """Legs in a row without a corner between them, and whether the line is open where they begin and where they end."""
    legs = [leg for leg in line.legs if leg.length > 0.0]
    chains = [[legs[0]]]
    for before, after in pairwise(legs):
        if _turn(before, after) > LEAST_CORNER:
            chains.append([])
        chains[-1].append(after)
    if line.closed and len(chains) > 1 and _turn(legs[-1], legs[0]) <= LEAST_CORNER:
        chains[0] = chains.pop() + chains[0]
    last = len(chains) - 1
    return [(chain, (not line.closed and i == 0, not line.closed and i == last)) for i, chain in enumerate(chains)]


def _turn(before: Leg, after: Leg) -> float:
    """The angle by which a line turns from one leg to the next [rad]."""
    a, b = before.normals(np.ones(1))[0], after.normals(np.zeros(1))[0]
    return math.acos(float(np.clip(a @ b, -1.0, 1.0)))


def _points_along(chain: Sequence[Leg], station: Array) -> Array:
    """Points at each `station` [m] along legs end to end, shape [n, 2]."""
    ends = np.cumsum([leg.length for leg in chain])
    index = np.minimum(np.searchsorted(ends, station - 1e-9 * ends[-1]), len(chain) - 1)
    points = np.empty((len(station), 2))
    for i, leg in enumerate(chain):
        mine = index == i
        points[mine] = leg.points(np.clip((station[mine] - ends[i]) / leg.length + 1.0, 0.0, 1.0))
    return points


def signed_distance(outline: Outline, points: Array) -> Array:
    """Distance from each of `points` [n, 2] to the line [m], shape [n], more than 0 on its left."""
    distances = np.array([leg.distance(points) for leg in outline.legs])
    least = distances.min(axis=0)
    across = np.zeros(len(points))
    for leg, distance in zip(outline.legs, distances, strict=True):
        # At a corner both legs are as near, and their sides count together.
        across += np.where(distance < least + 1e-9, _off_leg(leg, points), 0.0)
    return np.sign(across) * least


def _off_leg(leg: Leg, points: Array) -> Array:
    """How far to the left of the line or circle of a leg each of `points` lies [m], shape [n]."""
    if isinstance(leg, Bend):
        return math.copysign(1.0, leg.turn) * (leg.radius - np.linalg.norm(points - leg.center, axis=1))
    return (points - leg.start) @ leg.normals(np.zeros(1))[0]


def cells_between(low: float, high: float, dx: float, beyond: int) -> tuple[Array, Array]:
    """Middles of cells of about `dx` [m] from `low` to `high`, and of some of `dx` beyond either end; their sizes."""
    pieces = max(1, round((high - low) / dx))
    size = (high - low) / pieces
    off = (np.arange(beyond) + 0.5) * dx
    middles = np.concatenate([low - off[::-1], low + (np.arange(pieces) + 0.5) * size, high + off])
    return middles, np.concatenate([np.full(beyond, dx), np.full(pieces, size), np.full(beyond, dx)])
