"""Exact outlines of walls and shapes: straight legs and arcs end to end, and points spread evenly along them.

A clearance or a length is taken from the drawing, not from its samples. Plane points are [x, z].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpsph.shapes.points import Array, turned, unit


@dataclass(frozen=True)
class Line:
    """A straight leg of an outline, from `start` to `end` [m]."""

    start: Array
    end: Array

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.linalg.norm(self.end - self.start))

    def points(self, fractions: Array) -> Array:
        """Points at `fractions` of the length [m], shape [n, 2]."""
        return self.start + fractions[:, None] * (self.end - self.start)

    def normals(self, fractions: Array) -> Array:
        """Unit normals to the left of the way from start to end, shape [n, 2]."""
        along = (self.end - self.start) / self.length
        return np.tile([-along[1], along[0]], (len(fractions), 1))

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the leg [m], shape [n]."""
        along = (self.end - self.start) / self.length
        foot = np.clip((points - self.start) @ along, 0.0, self.length)
        x, z = (points[:, axis] - self.start[axis] - foot * along[axis] for axis in (0, 1))
        return np.sqrt(x * x + z * z)


@dataclass(frozen=True)
class Bend:
    """A leg that is an arc of a circle, from angle `start` through `turn` (positive counter-clockwise) [rad]."""

    center: Array
    radius: float
    start: float
    turn: float

    @property
    def length(self) -> float:
        """[m]."""
        return self.radius * abs(self.turn)

    def _outward(self, fractions: Array) -> Array:
        angle = self.start + fractions * self.turn
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def points(self, fractions: Array) -> Array:
        """Points at `fractions` of the length [m], shape [n, 2]."""
        return self.center + self.radius * self._outward(fractions)

    def normals(self, fractions: Array) -> Array:
        """Unit normals to the left of the way from start to end, shape [n, 2]."""
        return -math.copysign(1.0, self.turn) * self._outward(fractions)

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the leg [m], shape [n]."""
        arm = points - self.center
        swept = np.mod(math.copysign(1.0, self.turn) * (np.arctan2(arm[:, 1], arm[:, 0]) - self.start), 2 * math.pi)
        to_circle = np.abs(np.linalg.norm(arm, axis=1) - self.radius)
        first, last = self.points(np.array([0.0, 1.0]))
        to_ends = np.minimum(np.linalg.norm(points - first, axis=1), np.linalg.norm(points - last, axis=1))
        return np.where(swept <= abs(self.turn), to_circle, to_ends)


Leg = Line | Bend


@dataclass(frozen=True)
class Outline:
    """The exact line of a wall or around a shape: legs end to end, closed or open."""

    legs: tuple[Leg, ...]
    closed: bool

    @property
    def length(self) -> float:
        """[m]."""
        return sum(leg.length for leg in self.legs)

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the line [m], shape [n]."""
        least = np.full(len(points), np.inf)
        for leg in self.legs:
            np.minimum(least, leg.distance(points), out=least)
        return least

    def polygon(self) -> Array:
        """Corners [m, 2] of the outline, arcs in steps of half a degree, for telling the inside from the outside."""
        corners = []
        for leg in self.legs:
            pieces = 1 if isinstance(leg, Line) else math.ceil(abs(leg.turn) / math.radians(0.5))
            corners.append(leg.points(np.linspace(0.0, 1.0, pieces + 1)))
        return np.concatenate(corners)

    def moved(self, by: ArrayLike, angle: float = 0.0) -> Outline:
        """The same outline turned counter-clockwise about the origin by `angle` [rad], then moved `by` [x, z] [m]."""
        by = np.asarray(by, float)
        legs: list[Leg] = []
        for leg in self.legs:
            if isinstance(leg, Line):
                legs.append(Line(turned(leg.start, angle) + by, turned(leg.end, angle) + by))
            else:
                legs.append(Bend(turned(leg.center, angle) + by, leg.radius, leg.start + angle, leg.turn))
        return Outline(tuple(legs), self.closed)

    def offset(self, distance: float) -> Outline:
        """The parallel outline `distance` [m] to the left; straight legs meet anew at their corners."""
        legs: list[Leg] = []
        for leg in self.legs:
            if isinstance(leg, Line):
                way = distance * leg.normals(np.zeros(1))[0]
                legs.append(Line(leg.start + way, leg.end + way))
            else:
                # An arc narrower than the distance keeps a trace of itself rather than turning inside out.
                radius = max(leg.radius - math.copysign(1.0, leg.turn) * distance, 0.01 * leg.radius)
                legs.append(Bend(leg.center, radius, leg.start, leg.turn))
        joints = [(i, i + 1) for i in range(len(legs) - 1)] + [(len(legs) - 1, 0)] * self.closed
        for i, j in joints:
            a, b = legs[i], legs[j]
            if isinstance(a, Line) and isinstance(b, Line):
                ways = np.stack([a.end - a.start, b.start - b.end], axis=1)
                if abs(np.linalg.det(ways)) > 1e-9 * a.length * b.length:
                    corner = a.start + np.linalg.solve(ways, b.end - a.start)[0] * (a.end - a.start)
                    legs[i], legs[j] = Line(a.start, corner), Line(corner, b.end)
        return Outline(tuple(legs), self.closed)

    def sample(self, spacing: float) -> tuple[Array, Array, Array]:
        """Points at most `spacing` [m] apart, evenly along each leg; the joints of legs are points, once each.

        Returns points [m, 2], their unit normals to the left of the way along [m, 2] (halfway between the legs at a
        corner), and the length of line that each stands for [m], which add up to the length of the outline.
        """
        points, normals, lengths = [], [], []
        for leg in self.legs:
            pieces = max(1, math.ceil(leg.length / spacing - 1e-9))
            fractions = np.linspace(0.0, 1.0, pieces + 1)
            points.append(leg.points(fractions))
            normals.append(leg.normals(fractions))
            share = np.full(pieces + 1, leg.length / pieces)
            share[[0, -1]] /= 2
            lengths.append(share)
        # A joint belongs to two legs: the later one's first point is merged into the earlier one's last.
        joints = [(i, i + 1) for i in range(len(self.legs) - 1)] + [(len(self.legs) - 1, 0)] * self.closed
        for before, after in joints:
            normals[before][-1] = unit(normals[before][-1] + normals[after][0], otherwise=normals[before][-1])
            lengths[before][-1] += lengths[after][0]
        first = [1 if self.closed or i > 0 else 0 for i in range(len(self.legs))]

        def joined(arrays: list[Array]) -> Array:
            return np.concatenate([a[k:] for a, k in zip(arrays, first, strict=True)])

        return joined(points), joined(normals), joined(lengths)


def counter_clockwise(outline: Outline) -> Outline:
    """The same closed outline with its inside on the left."""
    x, z = outline.polygon().T
    doubled = np.sum(x * np.roll(z, -1) - z * np.roll(x, -1))
    return outline if doubled > 0.0 else reversed_outline(outline)


def reversed_outline(outline: Outline) -> Outline:
    """The same outline the other way round."""
    legs: list[Leg] = []
    for leg in reversed(outline.legs):
        if isinstance(leg, Line):
            legs.append(Line(leg.end, leg.start))
        else:
            legs.append(Bend(leg.center, leg.radius, leg.start + leg.turn, -leg.turn))
    return Outline(tuple(legs), outline.closed)


def box_outline(low: Sequence[float], high: Sequence[float], angle: float = 0.0) -> Outline:
    """The outline of a box from corner `low` to corner `high` [x, z] [m], turned about its centre by `angle` [rad]."""
    (left, bottom), (right, top) = low, high
    corners = np.array([[left, bottom], [right, bottom], [right, top], [left, top]], float)
    return polygon_outline(turned(corners, angle, corners.mean(axis=0)))


def polygon_outline(corners: ArrayLike) -> Outline:
    """The closed outline through `corners` [m], shape [n, 2]."""
    corners = np.asarray(corners, float)
    return Outline(tuple(Line(a, b) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)), closed=True)
