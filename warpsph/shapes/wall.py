"""What a wall is, however it is drawn.

Points are [x, y, z]. In a 2-D scene they have y = 0, and a drawing has no width: areas are for each metre across.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from warpsph.shapes.outline import Outline
from warpsph.shapes.points import Array


@dataclass(frozen=True)
class WallPart:
    """Points over a part of a wall.

    Attributes:
        points: [m], shape [n, 3].
        normals: Unit normals towards the fluid, 0 where there is fluid on both sides, shape [n, 3].
        areas: That each stands for [m2, in 2-D m], shape [n].
        along: How far along the outline of the wall each lies [m], shape [n]; not a number on a box in space.
    """

    points: Array
    normals: Array
    areas: Array
    along: Array


class Wall(Protocol):
    """A wall in its place."""

    @property
    def outline(self) -> Outline | None:
        """Its line, where it is drawn in the x-z plane."""

    @property
    def closed(self) -> bool:
        """Whether it has an inside."""

    @property
    def area(self) -> float:
        """[m2], in 2-D the length [m]."""

    def box(self) -> tuple[Array, Array]:
        """Lower and upper corner of the box around it [m], each of shape [3]."""

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the wall [m], shape [n]."""

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside a closed wall, shape [n]."""

    def carries(self, points: Array, level: float) -> NDArray[np.bool_]:
        """Whether each of `points` lies where fluid up to a `level` [m] would rest on the wall, shape [n]."""

    def openings(self, level: float, spacing: float) -> Array:
        """Points [n, 3] all over the places where water at `level` would run out, `spacing` [m] apart."""

    def is_upright(self, x: float, level: float) -> bool:
        """Whether a straight upright part of it stands at `x` [m], with its foot below `level` [m]."""

    def wet_side(self, sites: Array) -> int:
        """The side on which fluid at `sites` lies: 1 on the left of the way along it, or inside, -1 else, 0 both."""

    def set_back(self, distance: float, side: int) -> Wall:
        """The parallel wall `distance` [m] behind, seen from `side`."""

    def sample(self, spacing: float) -> tuple[Array, Array, Array]:
        """Points at most `spacing` [m] apart [m, 3], their unit normals [m, 3], to the side that counts as 1, and the
        area that each stands for [m2, in 2-D m], shape [m]."""

    def ways_along(self, points: Array) -> tuple[Array, Array]:
        """From each of `points` that `sample` gave to the one before and to the one after it [m], each of shape [m, 3];
        0 where there is none."""

    def layers(self, side: int, dx: float, count: int, others: Sequence[tuple[Wall, int]]) -> tuple[Array, Array]:
        """Points in `count` layers, `dx` [m] apart, behind the wall as seen from `side`, the first half a `dx` deep.

        `others` are the other walls of the scene with their sides, which it may meet. Returns points [m], shape [n, 3],
        and the volume that each fills [m3, in 2-D m2], shape [n].
        """

    def pieces(self, spacing: float, low: Array, high: Array) -> WallPart:
        """The middles of pieces of about `spacing` [m], with the area of each in the box from `low` to `high` [m]."""

    def floors(self, x: float, y: float, side: int) -> list[float]:
        """Heights [m] at which it may carry fluid at (x, y) [m], which is on its `side`: a lid carries none."""

    def lines(self) -> list[Array]:
        """What is drawn of it, seen from the side: polylines of the x-z plane [m], each of shape [k, 2]."""

    def faces(self) -> Array:
        """Four-cornered faces [m], shape [k, 4, 3]; none in 2-D."""
