"""A wall that is drawn in the x-z plane: an outline across a width, or in a 2-D scene without one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpsph.shapes.layers import LEAST_GAP, SLACK, cells_between, signed_distance, spread
from warpsph.shapes.outline import Line, Outline
from warpsph.shapes.points import (
    Array,
    across,
    divide,
    in_plane,
    in_space,
    inside_polygon,
    middles_between,
    near,
    nothing_at,
)
from warpsph.shapes.wall import Wall, WallPart


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
        return inside_polygon(in_plane(points), self.outline.polygon()) & (self._beside(points) == 0.0)

    def carries(self, points: Array, level: float) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside a closed wall, or above an open one and between its ends, shape [n]."""
        if self.closed:
            return self.contains(points)
        # The sky closes an open outline: straight up from both of its ends, beyond the level.
        basin = self.outline.polygon()
        sky = max(level, basin[:, 1].max()) + self.outline.length
        basin = np.concatenate([basin, [[basin[-1, 0], sky], [basin[0, 0], sky]]])
        return inside_polygon(in_plane(points), basin) & (self._beside(points) == 0.0)

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
        ends = across(np.concatenate(plane), divide(*self.width, spacing)[0])
        return np.concatenate([ends, across(side, np.array(self.width))])

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
        return across(points, stations), np.tile(in_space(normals), (len(stations), 1)), areas

    def ways_along(self, points: Array) -> tuple[Array, Array]:
        """From each of `points` that `sample` gave to the one before and to the one after it on the outline [m], each
        of shape [m, 3]; 0 where the outline ends, and on a wall with a width, along which there is no one way."""
        if self.width:
            return nothing_at(points), nothing_at(points)
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

    def box(self) -> tuple[Array, Array]:
        """As of every `Wall`."""
        x, z = self.outline.polygon().T
        y = self.width or (0.0, 0.0)
        return np.array([x.min(), y[0], z.min()]), np.array([x.max(), y[1], z.max()])

    def layers(self, side: int, dx: float, count: int, others: Sequence[tuple[Wall, int]]) -> tuple[Array, Array]:
        """As of every `Wall`: parallels of its outline, which meet anew at its corners."""
        outline, met = self._extended(dx, count, others)
        plane, lengths = np.empty((0, 2)), np.empty(0)
        for k in range(count):
            depth = (k + 0.5) * dx
            sites, shares = spread(outline.offset(-depth * side), dx)
            distance = outline.distance(sites)
            # What is nearer belongs to another part of the wall, and what is farther is the far end of a corner.
            kept = (distance > depth - SLACK * dx) & (distance < (count + 0.25) * dx)
            beyond = self.outline.distance(sites) > distance + SLACK * dx  # behind what was added
            for other, its_side in met:
                kept &= ~beyond | (signed_distance(other, sites) * its_side < SLACK * dx)
            kept &= ~near(in_space(sites), in_space(plane), LEAST_GAP * dx)
            plane, lengths = np.concatenate([plane, sites[kept]]), np.concatenate([lengths, shares[kept]])
        if not self.width:
            return in_space(plane), dx * lengths
        stations, breadths = cells_between(*self.width, dx, count)
        points = np.concatenate([in_space(plane, y) for y in stations])
        return points, np.outer(breadths, dx * lengths).ravel()

    def _extended(
        self, dx: float, count: int, others: Sequence[tuple[Wall, int]]
    ) -> tuple[Outline, list[tuple[Outline, int]]]:
        """The outline, longer by its layers at each end that stands on another wall, and the outlines
        of those walls with their sides.

        Else the corner behind two walls that meet would be left empty.
        """
        legs = list(self.outline.legs)
        met: list[tuple[Outline, int]] = []
        for end in () if self.closed else (0, 1):
            leg = legs[-end]
            point, normal = leg.points(np.full(1, float(end)))[0], leg.normals(np.full(1, float(end)))[0]
            beyond = point + count * dx * np.array([normal[1], -normal[0]]) * (1.0 if end else -1.0)
            for other, side in others:
                if other.outline is not None and other.outline.distance(point[None])[0] < 0.5 * dx:
                    legs = [*legs, Line(point, beyond)] if end else [Line(beyond, point), *legs]
                    met.append((other.outline, side))
                    break
        return Outline(tuple(legs), self.closed), met

    def pieces(self, spacing: float, low: Array, high: Array) -> WallPart:
        """As of every `Wall`, along its legs."""
        points, normals, lengths, along, gone = [], [], [], [], 0.0
        for leg in self.outline.legs:
            count = max(1, math.ceil(leg.length / spacing - 1e-9))
            middles = (np.arange(count) + 0.5) / count
            places = leg.points((np.arange(8 * count) + 0.5) / (8 * count))
            inside = np.all((places >= low[[0, 2]]) & (places <= high[[0, 2]]), axis=1).reshape(count, 8)
            points.append(leg.points(middles))
            normals.append(leg.normals(middles))
            lengths.append(leg.length / count * inside.mean(axis=1))
            along.append(gone + leg.length * middles)
            gone += leg.length
        plane, normal, length, station = map(np.concatenate, (points, normals, lengths, along))
        if not self.width:
            return WallPart(in_space(plane), in_space(normal), length, station)
        y, width = middles_between(*self.width, spacing, low[1], high[1])
        return WallPart(
            np.concatenate([in_space(plane, one) for one in y]),
            np.tile(in_space(normal), (len(y), 1)),
            np.outer(width, length).ravel(),
            np.tile(station, len(y)),
        )

    def floors(self, x: float, y: float, side: int) -> list[float]:
        """As of every `Wall`."""
        if self.width and not self.width[0] <= y <= self.width[1]:
            return []
        return _carrying(self.outline.polygon(), x, side)


def _carrying(line: Array, x: float, side: int) -> list[float]:
    """Heights at which a polyline [k, 2] runs below fluid at x, which is on its left (1) or on its right (-1) [m]."""
    (ax, az), (bx, bz) = line[:-1].T, line[1:].T
    way = side * (bx - ax)
    # The left of a leg that runs along x is above it.
    crossed = (np.minimum(ax, bx) <= x) & (x <= np.maximum(ax, bx)) & (way > 0.0)
    share = (x - ax[crossed]) / (bx - ax)[crossed]
    return (az[crossed] + share * (bz - az)[crossed]).tolist()
