"""Dummy particles: layers of points behind the walls of a scene, one spacing apart, the first half a spacing deep.

In a plane the layers are parallels of the wall's own outline, which meet anew at its corners, so that the strip behind
a wall is filled once: a layer is as thick as the spacing, and its points share out its length. A box in space has the
lattice around it. So the dummies of a tank that is a whole number of spacings wide carry the lattice of its water on.

Points are [x, y, z], with y = 0 in a 2-D scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from warpsph.scene.scene import Scene
from warpsph.shapes.outline import Bend, Leg, Line, Outline
from warpsph.shapes.points import Array, in_space, near
from warpsph.shapes.surface import Crate, Sheet

# A joint that turns by more is a corner, and has a point of its own in every layer [rad].
LEAST_CORNER = math.radians(15.0)
# Points of two walls, or of two layers that meet, keep this many spacings apart, else the later one is left out.
LEAST_GAP = 0.6
# How far rounding may bring a point closer to the wall than its layer is deep, in spacings.
SLACK = 0.02


@dataclass(frozen=True)
class Dummies:
    """The dummy particles of the walls of a scene.

    Attributes:
        position: [m], shape [n, 3].
        volume: Of the strip behind the wall that each fills [m3, in 2-D m2], shape [n].
        wall: Index into the scene's walls, shape [n].
        to_wall: From each to the nearest point of its wall [m], shape [n, 3].
    """

    position: Array
    volume: Array
    wall: NDArray[np.int64]
    to_wall: Array


NO_DUMMIES = Dummies(np.empty((0, 3)), np.empty(0), np.empty(0, dtype=np.int64), np.empty((0, 3)))


def place_dummies(
    scene: Scene, walls: Sequence[Sheet | Crate], sides: Sequence[int], fluid: Array, reach: float
) -> Dummies:
    """The dummies of all walls.

    `sides` are those on which the fluid is, `fluid` its particles [m], shape [n, 3], `reach` the support of the
    smoothing kernel [m], which layers fill.

    Raises:
        SceneError: there is fluid on both sides of a wall, or a wall is so thin that its dummies stand in the fluid.
    """
    dx = scene.spacing
    count = layer_count(reach, dx)
    found = NO_DUMMIES
    for index, (wall, side) in enumerate(zip(walls, sides, strict=True)):
        path, name = f"walls[{index}]", scene.walls[index].name
        hint = f"draw it as a box or a closed path, {2 * count * dx:.3g} m thick or more"
        if side == 0:
            raise scene.error(path, f"'{name}' has fluid on both sides and no thickness; {hint}")
        others = [(other, s) for other, s in zip(walls, sides, strict=True) if other is not wall]
        points, volume = (
            _around_crate(wall, side, dx, count)
            if isinstance(wall, Crate)
            else _behind_sheet(wall, side, dx, count, others)
        )
        inside = near(points, fluid, LEAST_GAP * dx)
        if inside.any():
            x, y, z = points[inside][0]
            spot = f"x = {x:.4g} m, z = {z:.4g} m" if scene.dimensions == 2 else f"[{x:.4g}, {y:.4g}, {z:.4g}] m"
            raise scene.error(path, f"'{name}' is too thin: there is fluid behind it, at {spot}; {hint}")
        fresh = ~near(points, found.position, LEAST_GAP * dx)
        found = Dummies(
            np.concatenate([found.position, points[fresh]]),
            np.concatenate([found.volume, volume[fresh]]),
            np.concatenate([found.wall, np.full(int(fresh.sum()), index)]),
            np.concatenate([found.to_wall, _to_wall(wall, points[fresh], dx)]),
        )
    return found


def _to_wall(wall: Sheet | Crate, points: Array, dx: float) -> Array:
    """From each of `points` to the nearest point of a wall [m], shape [n, 3]: against the slope of the distance."""
    step = 1e-3 * dx
    ways = np.zeros_like(points)
    for axis in range(3):
        aside = np.zeros(3)
        aside[axis] = step
        ways[:, axis] = wall.distance(points - aside) - wall.distance(points + aside)
    length = np.linalg.norm(ways, axis=1)
    return ways * (wall.distance(points) / np.where(length > 0.0, length, 1.0))[:, None]


def dummies_of_outline(outline: Outline, dx: float, reach: float) -> tuple[Array, Array]:
    """Dummies inside a counter-clockwise outline [n, 3] [m], and their volumes [n] [m2]."""
    return _behind_sheet(Sheet(outline), -1, dx, layer_count(reach, dx), [])


def dummies_of_box(low: Array, high: Array, dx: float, reach: float) -> tuple[Array, Array]:
    """Dummies inside a box in space [n, 3] [m], and their volumes [n] [m3]."""
    return _around_crate(Crate(low, high, frozenset()), -1, dx, layer_count(reach, dx))


def layer_count(reach: float, dx: float) -> int:
    """How many layers fill a support of `reach` [m]."""
    return math.ceil(reach / dx - 1e-6)


# ---------------------------------------------------------------------------------------------------------- in a plane


def _behind_sheet(
    wall: Sheet, side: int, dx: float, count: int, others: Sequence[tuple[Sheet | Crate, int]]
) -> tuple[Array, Array]:
    """Dummies of a wall drawn in the x-z plane [n, 3], and their volumes [n]."""
    outline, met = _extended(wall, dx, count, others)
    plane, lengths = np.empty((0, 2)), np.empty(0)
    for k in range(count):
        depth = (k + 0.5) * dx
        sites, shares = spread(outline.offset(-depth * side), dx)
        distance = outline.distance(sites)
        # What is nearer belongs to another part of the wall, and what is farther is the far end of a corner.
        kept = (distance > depth - SLACK * dx) & (distance < (count + 0.25) * dx)
        beyond = wall.outline.distance(sites) > distance + SLACK * dx  # behind what was added
        for other, its_side in met:
            kept &= ~beyond | (_signed_distance(other.outline, sites) * its_side < SLACK * dx)
        kept &= ~near(in_space(sites), in_space(plane), LEAST_GAP * dx)
        plane, lengths = np.concatenate([plane, sites[kept]]), np.concatenate([lengths, shares[kept]])
    if not wall.width:
        return in_space(plane), dx * lengths
    stations, breadths = _cells(*wall.width, dx, count)
    points = np.concatenate([in_space(plane, y) for y in stations])
    return points, np.outer(breadths, dx * lengths).ravel()


def spread(line: Outline, dx: float) -> tuple[Array, Array]:
    """Points [n, 2] about `dx` [m] apart along a line, and the length that each stands for [m], [n].

    A corner has a point, an end has its first half a step off. Lengths add up to that of the line.
    """
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
    first = [0 if opens else 1 for _, (opens, _) in chains]
    return tuple(np.concatenate([a[k:] for a, k in zip(arrays, first, strict=True)]) for arrays in (points, shares))


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


def _extended(
    wall: Sheet, dx: float, count: int, others: Sequence[tuple[Sheet | Crate, int]]
) -> tuple[Outline, list[tuple[Sheet, int]]]:
    """The outline, longer by its layers at each end that stands on another wall, and those walls with their sides.

    Else the corner behind two walls that meet would be left empty.
    """
    legs, met = list(wall.outline.legs), []
    for end in () if wall.closed else (0, 1):
        leg = legs[-end]
        point, normal = leg.points(np.full(1, float(end)))[0], leg.normals(np.full(1, float(end)))[0]
        beyond = point + count * dx * np.array([normal[1], -normal[0]]) * (1.0 if end else -1.0)
        for other, side in others:
            if isinstance(other, Sheet) and other.outline.distance(point[None])[0] < 0.5 * dx:
                legs = [*legs, Line(point, beyond)] if end else [Line(beyond, point), *legs]
                met.append((other, side))
                break
    return Outline(tuple(legs), wall.closed), met


def _signed_distance(outline: Outline, points: Array) -> Array:
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


# ------------------------------------------------------------------------------------------------------------ in space


def _cells(low: float, high: float, dx: float, beyond: int) -> tuple[Array, Array]:
    """Middles of cells of about `dx` [m] from `low` to `high`, and of some of `dx` beyond either end; their sizes."""
    pieces = max(1, round((high - low) / dx))
    size = (high - low) / pieces
    off = (np.arange(beyond) + 0.5) * dx
    middles = np.concatenate([low - off[::-1], low + (np.arange(pieces) + 0.5) * size, high + off])
    return middles, np.concatenate([np.full(beyond, dx), np.full(pieces, size), np.full(beyond, dx)])


def _around_crate(wall: Crate, side: int, dx: float, count: int) -> tuple[Array, Array]:
    """Dummies of the faces of a box [n, 3], outside it where the fluid is inside, and their volumes [n]."""
    axes = [_cells(low, high, dx, count if side > 0 else 0) for low, high in zip(wall.low, wall.high, strict=True)]
    points = np.stack(np.meshgrid(*(middles for middles, _ in axes), indexing="ij"), axis=-1).reshape(-1, 3)
    volume = np.prod(np.stack(np.meshgrid(*(sizes for _, sizes in axes), indexing="ij"), axis=-1), axis=-1).ravel()
    kept = wall.distance(points) < (count - 0.5 + SLACK) * dx
    if side > 0:
        kept = (wall.distance(points) < (count + 0.25) * dx) & ~wall.contains(points)
        for axis, end in product(range(3), range(2)):
            if (axis, end) not in wall.sides():  # what lies beyond an open face is not behind the others
                kept &= (points[:, axis] < wall.high[axis]) if end else (points[:, axis] > wall.low[axis])
    return points[kept], volume[kept]
