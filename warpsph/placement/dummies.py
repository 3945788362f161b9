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

import numpy as np
from numpy.typing import NDArray

from warpsph.scene.scene import Scene
from warpsph.shapes.layers import LEAST_GAP
from warpsph.shapes.points import Array, near
from warpsph.shapes.wall import Wall


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


def place_dummies(scene: Scene, walls: Sequence[Wall], sides: Sequence[int], fluid: Array, reach: float) -> Dummies:
    """The dummies of all walls.

    `sides` are the wall's sides with fluid, `fluid` its particles [m], shape [n, 3], `reach` the support of the
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
        points, volume = wall.layers(side, dx, count, others)
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


def _to_wall(wall: Wall, points: Array, dx: float) -> Array:
    """From each of `points` to the nearest point of a wall [m], shape [n, 3]: against the slope of the distance."""
    step = 1e-3 * dx
    ways = np.zeros_like(points)
    for axis in range(3):
        aside = np.zeros(3)
        aside[axis] = step
        ways[:, axis] = wall.distance(points - aside) - wall.distance(points + aside)
    length = np.linalg.norm(ways, axis=1)
    return ways * (wall.distance(points) / np.where(length > 0.0, length, 1.0))[:, None]


def layer_count(reach: float, dx: float) -> int:
    """How many layers fill a support of `reach` [m]."""
    return math.ceil(reach / dx - 1e-6)
