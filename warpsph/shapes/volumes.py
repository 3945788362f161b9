"""Bodies of fluid as they are drawn, and the lattices that they are cut from.

Points are [x, y, z]. In a 2-D scene they have y = 0, and a drawing has no width: areas are for each metre across.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpsph.shapes.outline import Outline
from warpsph.shapes.points import Array, across, in_plane, in_space, inside_polygon, turned


@dataclass(frozen=True)
class Frame:
    """The coordinates of a lattice: its cells are unit cubes, turned by `angle` [degrees] in the x-z plane."""

    origin: Array
    angle: float
    spacing: float

    def cells(self, points: Array) -> Array:
        """Where `points` [m] lie in the lattice, shape [n, 3]."""
        return _turned(points - self.origin, -self.angle) / self.spacing

    def points(self, cells: Array) -> Array:
        """The places [m] that lie at `cells` in the lattice, shape [n, 3]."""
        return self.origin + _turned(cells * self.spacing, self.angle)


def _turned(points: Array, angle: float) -> Array:
    """Points [n, 3] turned by `angle` [degrees] in the x-z plane."""
    copies = points.copy()
    copies[:, [0, 2]] = turned(in_plane(points), math.radians(angle))
    return copies


@dataclass(frozen=True)
class Prism:
    """What lies inside a closed outline, from y to y [m]; in 2-D that is one spacing, around y = 0.

    `volume` is the volume of the drawing [m3], in 2-D its area [m2].
    """

    outline: Outline
    width: tuple[float, float]
    volume: float

    def first_corner(self) -> Array:
        """[m], shape [3]."""
        return in_space(self.outline.polygon()[:1], self.width[0])[0]

    def bounds(self, frame: Frame) -> tuple[Array, Array]:
        """The box around it in a lattice, shapes [3]."""
        corners = frame.cells(across(self.outline.polygon(), np.array(self.width)))
        return corners.min(axis=0), corners.max(axis=0)

    def holds(self, cells: Array, frame: Frame) -> NDArray[np.bool_]:
        """Whether it contains each of `cells` [n, 3] of a lattice, shape [n]."""
        border = frame.cells(in_space(self.outline.polygon()))
        low, high = ((np.array(self.width) - frame.origin[1]) / frame.spacing).tolist()
        is_within = (cells[:, 1] > low) & (cells[:, 1] < high)
        return is_within & inside_polygon(in_plane(cells), in_plane(border))

    def depth(self, points: Array) -> Array:
        """How far inside it each of `points` lies [m], shape [n]; 0 outside."""
        plane = in_plane(points)
        low, high = self.width
        to_side = np.minimum(points[:, 1] - low, high - points[:, 1])
        inside = np.flatnonzero(inside_polygon(plane, self.outline.polygon()) & (to_side > 0.0))
        depth = np.zeros(len(points))
        depth[inside] = np.minimum(self.outline.distance(plane[inside]), to_side[inside])
        return depth

    def roof(self, points: Array) -> Array:
        """Height of its first edge straight above each of `points` [m], shape [n]."""
        roof = np.full(len(points), np.inf)
        x, z = points[:, 0], points[:, 2]
        border = self.outline.polygon()
        for (ax, az), (bx, bz) in zip(border, np.roll(border, -1, axis=0), strict=True):
            if ax != bx:
                height = az + (x - ax) * (bz - az) / (bx - ax)
                over = ((ax > x) != (bx > x)) & (height >= z)
                roof[over] = np.minimum(roof, height)[over]
        return np.where(np.isfinite(roof), roof, z)


@dataclass(frozen=True)
class Sphere:
    """What lies inside a sphere."""

    center: Array
    radius: float

    @property
    def volume(self) -> float:
        """[m3]."""
        return 4.0 / 3.0 * math.pi * self.radius**3

    def first_corner(self) -> Array:
        """The lowest point [m], shape [3]."""
        return self.center - [0.0, 0.0, self.radius]

    def bounds(self, frame: Frame) -> tuple[Array, Array]:
        """The box around it in a lattice, shapes [3]."""
        center, reach = frame.cells(self.center[None])[0], self.radius / frame.spacing
        return center - reach, center + reach

    def holds(self, cells: Array, frame: Frame) -> NDArray[np.bool_]:
        """Whether it contains each of `cells` [n, 3] of a lattice, shape [n]."""
        return self.depth(frame.points(cells)) > 0.0

    def depth(self, points: Array) -> Array:
        """How far inside it each of `points` lies [m], shape [n]; 0 outside."""
        return np.maximum(self.radius - np.linalg.norm(points - self.center, axis=1), 0.0)

    def roof(self, points: Array) -> Array:
        """Height of its surface straight above each of `points` [m], shape [n]."""
        beside = ((points - self.center)[:, :2] ** 2).sum(axis=1)
        return self.center[2] + np.sqrt(np.maximum(self.radius**2 - beside, 0.0))
