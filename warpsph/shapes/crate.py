"""A wall that is the faces of a box in space."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from warpsph.shapes.layers import SLACK, cells_between
from warpsph.shapes.points import BLOCK, Array, divide, inside_box, middles_between, nothing_at
from warpsph.shapes.wall import Wall, WallPart

FACES = ("left", "right", "front", "back", "bottom", "top")  # two for each axis, the low one first


@dataclass(frozen=True)
class Crate:
    """A wall that is the faces of a box in space, from `low` to `high` [m], but for those that are `open`."""

    low: Array
    high: Array
    open: frozenset[str]

    @property
    def outline(self) -> None:
        """None: it is drawn in space."""
        return None

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
        return nothing_at(points), nothing_at(points)

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

    def box(self) -> tuple[Array, Array]:
        """As of every `Wall`."""
        return self.low.copy(), self.high.copy()

    def layers(self, side: int, dx: float, count: int, others: Sequence[tuple[Wall, int]]) -> tuple[Array, Array]:
        """As of every `Wall`: cells of a lattice around the box, inside it where the fluid is outside."""
        axes = [
            cells_between(low, high, dx, count if side > 0 else 0)
            for low, high in zip(self.low, self.high, strict=True)
        ]
        # Most cells of a large box are far from all of its faces: those are never made.
        beyond = 0.0 if side > 0 else (count + 1.0) * dx
        near = [
            (middles < low + beyond) | (middles > high - beyond)
            for (middles, _), low, high in zip(axes, self.low, self.high, strict=True)
        ]
        cells = np.nonzero(near[0][:, None, None] | near[1][:, None] | near[2])
        points = np.stack([middles[k] for (middles, _), k in zip(axes, cells, strict=True)], axis=-1)
        volume = np.prod(np.stack([sizes[k] for (_, sizes), k in zip(axes, cells, strict=True)], axis=-1), axis=-1)
        kept = self.distance(points) < (count - 0.5 + SLACK) * dx
        if side > 0:
            kept = (self.distance(points) < (count + 0.25) * dx) & ~self.contains(points)
            for axis, end in product(range(3), range(2)):
                if (axis, end) not in self.sides():  # what lies beyond an open face is not behind the others
                    kept &= (points[:, axis] < self.high[axis]) if end else (points[:, axis] > self.low[axis])
        return points[kept], volume[kept]

    def pieces(self, spacing: float, low: Array, high: Array) -> WallPart:
        """As of every `Wall`, on each of its faces."""
        points, normals, areas = [], [], []
        for axis, end in self.sides():
            at = (self.low, self.high)[end][axis]
            ways = [other for other in range(3) if other != axis]
            cells = [middles_between(self.low[way], self.high[way], spacing, low[way], high[way]) for way in ways]
            (a, size_a), (b, size_b) = cells
            face = np.full((len(a) * len(b), 3), at)
            face[:, ways[0]], face[:, ways[1]] = np.repeat(a, len(b)), np.tile(b, len(a))
            normal = np.zeros_like(face)
            normal[:, axis] = 1 - 2 * end
            points.append(face)
            normals.append(normal)
            areas.append(np.outer(size_a, size_b).ravel() * (low[axis] <= at <= high[axis]))
        count = sum(map(len, points))
        return WallPart(np.concatenate(points), np.concatenate(normals), np.concatenate(areas), np.full(count, np.nan))

    def floors(self, x: float, y: float, side: int) -> list[float]:
        """As of every `Wall`."""
        within = self.low[0] <= x <= self.high[0] and self.low[1] <= y <= self.high[1]
        face = (2, 0) if side > 0 else (2, 1)
        return [float((self.low if side > 0 else self.high)[2])] if side and within and face in self.sides() else []
