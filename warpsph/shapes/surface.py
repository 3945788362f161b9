"""Walls and bodies of fluid in space: an outline of the x-z plane across a width, the faces of a box, a ball.

Points are [x, y, z]. In a 2-D scene they have y = 0, and what is drawn has no width: areas are for each metre of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from warpsph.shapes.outline import Array, Line, Outline
from warpsph.shapes.points import BLOCK, in_plane, in_space, inside_box, turned
from warpsph.shapes.points import around as around  # for model and place, until they ask points for it

FACES = ("left", "right", "front", "back", "bottom", "top")  # two for each axis, the low one first


def contains(polygon: Array, points: Array) -> NDArray[np.bool_]:
    """Whether each of `points` [n, 2] lies inside `polygon` [k, 2] by the even-odd rule, shape [n]."""
    inside = np.zeros(len(points), dtype=bool)
    x, z = points[:, 0], points[:, 1]
    for (ax, az), (bx, bz) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if az != bz:
            with np.errstate(over="ignore"):  # of a side that is next to level: which part of it counts, one cannot say
                inside ^= ((az > z) != (bz > z)) & (x < ax + (z - az) * (bx - ax) / (bz - az))
    return inside


def divide(low: float, high: float, spacing: float) -> tuple[Array, Array]:
    """Stations from `low` to `high`, both included and at most `spacing` apart, and the length of each [m]."""
    pieces = max(1, math.ceil((high - low) / spacing - 1e-9))
    share = np.full(pieces + 1, (high - low) / pieces)
    share[[0, -1]] /= 2
    return np.linspace(low, high, pieces + 1), share


def _across(plane: Array, stations: Array) -> Array:
    """Points of the x-z plane [n, 2], once at each of the stations along y [k], shape [k n, 3]."""
    return np.concatenate([np.empty((0, 3)), *(in_space(plane, y) for y in stations)])


def _nothing(points: Array) -> Array:
    """A row of zeros that is seen as many times as there are points, not to be written to, shape [n, 3]."""
    return np.broadcast_to(np.zeros(3), points.shape)


# --------------------------------------------------------------------------------------------------------------- walls


@dataclass(frozen=True)
class Sheet:
    """A wall drawn in the x-z plane: an outline, and how far it reaches along y [m]; None in a 2-D scene."""

    outline: Outline
    width: tuple[float, float] | None = None

    @property
    def closed(self) -> bool:
        """Whether it has an inside."""
        return self.outline.closed

    @property
    def area(self) -> float:
        """[m2], in 2-D the length [m]."""
        return self.outline.length * (self.width[1] - self.width[0] if self.width else 1.0)

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the wall [m], shape [n]."""
        in_outline = self.outline.distance(in_plane(points))
        return np.hypot(in_outline, self._beside(points)) if self.width else in_outline

    def _beside(self, points: Array) -> Array:
        """How far each of `points` lies beyond the width [m], shape [n]; 0 in 2-D."""
        low, high = self.width or (-math.inf, math.inf)
        return np.maximum(np.maximum(low - points[:, 1], points[:, 1] - high), 0.0)

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside a closed outline, shape [n]."""
        return contains(self.outline.polygon(), in_plane(points)) & (self._beside(points) == 0.0)

    def carries(self, points: Array, level: float) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside a closed wall, or above an open one and between its ends, shape [n]."""
        if self.closed:
            return self.contains(points)
        # The sky closes an open outline: straight up from both of its ends, beyond the level.
        basin = self.outline.polygon()
        sky = max(level, basin[:, 1].max()) + self.outline.length
        basin = np.concatenate([basin, [[basin[-1, 0], sky], [basin[0, 0], sky]]])
        return contains(basin, in_plane(points)) & (self._beside(points) == 0.0)

    def openings(self, level: float, spacing: float) -> Array:
        """Points [n, 3] all over the places where water at `level` would run out, `spacing` [m] apart."""
        plane: list[Array] = [np.empty((0, 2))]
        if not self.closed:
            legs = self.outline.legs
            for x, z in (legs[0].points(np.zeros(1))[0], legs[-1].points(np.ones(1))[0]):
                heights = np.arange(z, level, spacing)
                plane.append(np.stack([np.full(len(heights), x), heights], axis=1))
        if not self.width:
            return in_space(np.concatenate(plane))
        low, high = self.outline.polygon().min(axis=0), self.outline.polygon().max(axis=0)
        x, z = np.arange(low[0], high[0], spacing), np.arange(low[1], level, spacing)
        side = np.stack([np.tile(x, len(z)), np.repeat(z, len(x))], axis=1)
        side = side[self.carries(in_space(side, self.width[0]), level)]
        ends = _across(np.concatenate(plane), divide(*self.width, spacing)[0])
        return np.concatenate([ends, _across(side, np.array(self.width))])

    def is_upright(self, x: float, level: float) -> bool:
        """Whether a straight upright leg stands at `x`, with its foot below `level`."""
        return any(
            isinstance(leg, Line)
            and np.allclose([leg.start[0], leg.end[0]], x, rtol=0.0, atol=1e-9)
            and min(leg.start[1], leg.end[1]) < level
            for leg in self.outline.legs
        )

    def wet_side(self, sites: Array) -> int:
        """The side on which the fluid lies: 1 to the left of the way along the outline, -1 to the right, 0 both."""
        some = in_plane(sites[:: max(1, len(sites) // 1000)])
        points, normals, _ = self.outline.sample(max(self.outline.length / 1000, 1e-9))
        nearest = np.argmin(((some[:, None] - points) ** 2).sum(axis=2), axis=1)
        share = (np.einsum("ij,ij->i", some - points[nearest], normals[nearest]) > 0.0).mean()
        return 1 if share > 0.98 else -1 if share < 0.02 else 0

    def set_back(self, distance: float, side: int) -> Sheet:
        """The parallel wall `distance` [m] behind, seen from `side`; it reaches as far beyond its width."""
        width = (self.width[0] - distance, self.width[1] + distance) if self.width else None
        return Sheet(self.outline.offset(-distance * side), width)

    def sample(self, spacing: float) -> tuple[Array, Array, Array]:
        """Points at most `spacing` [m] apart, on a lattice across the width.

        Returns points [m, 3], their unit normals to the left of the way along [m, 3], and the area that each stands
        for [m2, in 2-D m], shape [m].
        """
        points, normals, lengths = self.outline.sample(spacing)
        if not self.width:
            return in_space(points), in_space(normals), lengths
        stations, shares = divide(*self.width, spacing)
        areas = np.outer(shares, lengths).ravel()
        return _across(points, stations), np.tile(in_space(normals), (len(stations), 1)), areas

    def ways_along(self, points: Array) -> tuple[Array, Array]:
        """From each of `points` that `sample` gave to the one before and to the one after it on the outline [m], each
        of shape [m, 3]; 0 where the outline ends, and on a wall with a width, along which there is no one way."""
        if self.width:
            return _nothing(points), _nothing(points)
        before, after = np.roll(points, 1, axis=0) - points, np.roll(points, -1, axis=0) - points
        if not self.closed:
            before[0] = after[-1] = 0.0
        return before, after

    def lines(self) -> list[Array]:
        """What is drawn of it, seen from the side: polylines of the x-z plane [m], each of shape [k, 2]."""
        corners = self.outline.polygon()
        return [np.concatenate([corners, corners[:1]]) if self.closed else corners]

    def faces(self) -> Array:
        """Four-cornered faces [m], shape [k, 4, 3]; none in 2-D."""
        if not self.width:
            return np.empty((0, 4, 3))
        (line,) = self.lines()
        line = line[np.append(True, np.any(np.diff(line, axis=0) != 0.0, axis=1))]
        near, far = (in_space(line, y) for y in self.width)
        return np.stack([near[:-1], near[1:], far[1:], far[:-1]], axis=1)


@dataclass(frozen=True)
class Crate:
    """A wall that is the faces of a box in space, from `low` to `high` [m], but for those that are `open`."""

    low: Array
    high: Array
    open: frozenset[str]

    @property
    def closed(self) -> bool:
        """Whether it has an inside."""
        return not self.open

    @property
    def area(self) -> float:
        """[m2]."""
        size = self.high - self.low
        return sum(float(np.prod(np.delete(size, axis))) for axis, _ in self.sides())

    def sides(self) -> list[tuple[int, int]]:
        """Axis and end (0 low, 1 high) of each face that is there."""
        return [divmod(index, 2) for index, name in enumerate(FACES) if name not in self.open]

    def _rectangle(self, axis: int, end: int) -> tuple[Array, Array]:
        """Lower and upper corner of a face [m]."""
        low, high = self.low.copy(), self.high.copy()
        low[axis] = high[axis] = (low, high)[end][axis]
        return low, high

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the wall [m], shape [n]."""
        least = np.full(len(points), np.inf)
        for side in self.sides():
            squares = np.zeros(len(points))
            for x, low, high in zip(points.T, *self._rectangle(*side), strict=True):
                gap = x - np.clip(x, low, high)
                squares += gap * gap
            np.minimum(least, squares, out=least)
        return np.sqrt(least)

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside the box, shape [n]."""
        return inside_box(points, self.low, self.high)

    def carries(self, points: Array, level: float) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside the box, or above it where it has no top, shape [n]."""
        high = self.high.copy()
        if "top" in self.open:
            high[2] = math.inf
        return inside_box(points, self.low, high)

    def openings(self, level: float, spacing: float) -> Array:
        """Points [n, 3] all over the places where water at `level` would run out, `spacing` [m] apart."""
        places = [np.empty((0, 3))]
        for axis, end in product(range(3), range(2)):
            is_open = (axis, end) not in self.sides()
            low, high = self._rectangle(axis, end)
            if axis < 2:
                # Through a side that is missing, or over the rim of one that is there.
                low[2], high[2] = (low[2] if is_open else high[2]), level
            if (axis == 2 and (end == 1 or not is_open)) or np.any(high < low):
                continue
            x, y, z = (divide(a, b, spacing)[0] if b > a else np.array([a]) for a, b in zip(low, high, strict=True))
            places.append(np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3))
        return np.concatenate(places)

    def is_upright(self, x: float, level: float) -> bool:
        """Whether an end face stands at `x`, with its foot below `level`."""
        ends = [(self.low, self.high)[end][0] for axis, end in self.sides() if axis == 0]
        return self.low[2] < level and any(abs(x - end) < 1e-9 for end in ends)

    def wet_side(self, sites: Array) -> int:
        """The side on which the fluid lies: 1 on the inner side of every face, -1 outside, 0 both."""
        inside = np.ones(len(sites), dtype=bool)
        for axis, end in self.sides():
            inside &= (sites[:, axis] < self.high[axis]) if end else (sites[:, axis] > self.low[axis])
        share = inside.mean()
        return 1 if share > 0.98 else -1 if share < 0.02 else 0

    def set_back(self, distance: float, side: int) -> Crate:
        """The box whose faces lie `distance` [m] behind, seen from `side`; at an open end they reach farther by it."""
        # A box narrower than twice the distance keeps a trace of itself rather than turning inside out.
        most = 0.49 * (self.high - self.low)
        low, high = self.low.copy(), self.high.copy()
        for axis, end in product(range(3), range(2)):
            is_there = (axis, end) in self.sides()
            outward = max(side * distance, -most[axis]) if is_there else distance
            (low, high)[end][axis] += outward if end else -outward
        return Crate(low, high, self.open)

    def sample(self, spacing: float) -> tuple[Array, Array, Array]:
        """Points at most `spacing` [m] apart, on one lattice for all faces; those of an edge or a corner once.

        Returns points [m, 3], their unit normals into the box [m, 3] (halfway between the faces at an edge), and the
        area that each stands for [m2], shape [m].
        """
        stations, shares = zip(*(divide(a, b, spacing) for a, b in zip(self.low, self.high, strict=True)), strict=True)
        last = [len(axis) - 1 for axis in stations]
        sides = self.sides()
        # Sites in a layer: all of it where there is a bottom or a top, and the ring of the faces around elsewhere.
        y, x = (axis.ravel() for axis in np.meshgrid(np.arange(last[1] + 1), np.arange(last[0] + 1), indexing="ij"))
        on_ring = np.zeros(len(x), dtype=bool)
        for axis, end in sides:
            if axis < 2:
                on_ring |= (x, y)[axis] == (0, last[axis])[end]
        ring = x[on_ring], y[on_ring]
        layers = [(x, y) if (2, end) in sides else ring for end in (0, 1)]
        height = max(1, BLOCK // max(len(ring[0]), 1))
        blocks = [(layers[0], 0, 1)]
        blocks += [(ring, k, min(k + height, last[2])) for k in range(1, last[2], height)]
        blocks.append((layers[1], last[2], last[2] + 1))
        count = sum(len(layer[0]) * (end - begin) for layer, begin, end in blocks)
        points, normals, areas = np.empty((count, 3)), np.zeros((count, 3)), np.zeros(count)
        done = 0
        for layer, begin, end in blocks:
            site = [np.tile(axis, end - begin) for axis in layer]
            site.append(np.repeat(np.arange(begin, end), len(layer[0])))
            mine = slice(done, done + len(site[0]))
            done = mine.stop
            for axis in range(3):
                points[mine, axis] = stations[axis][site[axis]]
            for axis, side in sides:
                on = np.flatnonzero(site[axis] == (0, last[axis])[side])
                along, across = (shares[other][site[other][on]] for other in range(3) if other != axis)
                normals[mine, axis][on] += 1 - 2 * side
                areas[mine][on] += along * across
            normals[mine] /= np.linalg.norm(normals[mine], axis=1)[:, None]
        return points, normals, areas

    def ways_along(self, points: Array) -> tuple[Array, Array]:
        """0 for each of `points` that `sample` gave, twice, shape [m, 3]: a face runs in no one way."""
        return _nothing(points), _nothing(points)

    def lines(self) -> list[Array]:
        """What is drawn of it, seen from the side: its end faces, bottom and top, each of shape [2, 2] [m]."""
        return [np.stack(self._rectangle(*side))[:, [0, 2]] for side in self.sides() if side[0] != 1]

    def faces(self) -> Array:
        """Four-cornered faces [m], shape [k, 4, 3]."""
        faces = []
        for axis, end in self.sides():
            low, high = self._rectangle(axis, end)
            along = np.delete(np.arange(3), axis)[0]
            a, b = low.copy(), high.copy()
            a[along], b[along] = high[along], low[along]
            faces.append([low, a, high, b])
        return np.array(faces)


# -------------------------------------------------------------------------------------------------------------- fluids


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

    `volume` is that of the drawing [m3], in 2-D its area [m2].
    """

    outline: Outline
    width: tuple[float, float]
    volume: float

    def first_corner(self) -> Array:
        """[m], shape [3]."""
        return in_space(self.outline.polygon()[:1], self.width[0])[0]

    def bounds(self, frame: Frame) -> tuple[Array, Array]:
        """The box around it in a lattice, shapes [3]."""
        corners = frame.cells(_across(self.outline.polygon(), np.array(self.width)))
        return corners.min(axis=0), corners.max(axis=0)

    def holds(self, cells: Array, frame: Frame) -> NDArray[np.bool_]:
        """Whether it contains each of `cells` [n, 3] of a lattice, shape [n]."""
        border = frame.cells(in_space(self.outline.polygon()))
        low, high = ((np.array(self.width) - frame.origin[1]) / frame.spacing).tolist()
        is_within = (cells[:, 1] > low) & (cells[:, 1] < high)
        return is_within & contains(in_plane(border), in_plane(cells))

    def depth(self, points: Array) -> Array:
        """How far inside it each of `points` lies [m], shape [n]; 0 outside."""
        plane = in_plane(points)
        low, high = self.width
        to_side = np.minimum(points[:, 1] - low, high - points[:, 1])
        inside = np.flatnonzero(contains(self.outline.polygon(), plane) & (to_side > 0.0))
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
