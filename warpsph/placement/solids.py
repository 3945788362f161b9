"""The forms that a body can have: what each is as a solid, whatever it is drawn by.

Points are [x, y, z], with y = 0 in a 2-D scene. A refusal is a ValueError of one line, for the scene to put a
place before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from warpsph.bodies.body_set import rotation
from warpsph.placement.drawing import closed_outline, path_legs
from warpsph.placement.dummies import LEAST_GAP, layer_count
from warpsph.scene.bodies import BodyField
from warpsph.scene.scene import Scene
from warpsph.shapes.crate import Crate
from warpsph.shapes.mesh import (
    Mesh,
    ball_mass,
    box_mesh,
    contains,
    distance_to_mesh,
    is_deep,
    moved_in,
    read_mesh,
    solid_mass,
    sphere_mesh,
    stood_back,
)
from warpsph.shapes.outline import Line, Outline, counter_clockwise
from warpsph.shapes.points import Array, in_space, near, turned
from warpsph.shapes.sampling import Surface, pieces, surface_of_mesh, surface_of_outline
from warpsph.shapes.section import MassProperties, plane_mass
from warpsph.shapes.sheet import Sheet


class Form(Protocol):
    """A solid in its place.

    Attributes:
        outline: Its exact outline, counter-clockwise, for contact in 2-D.
        mesh: Its exact surface, for contact in 3-D.
        ball: Centre [m], shape [3], and radius [m] of a ball in contact.
    """

    outline: Outline | None
    mesh: Mesh | None
    ball: tuple[Array, float] | None

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside, shape [n]."""

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the surface [m], shape [n]: exact near it, rough far outside."""

    def mass(
        self,
        density: float | None,
        mass: float | None,
        centre: Sequence[float] | None,
        inertia: Any,
    ) -> MassProperties:
        """What it weighs: of an even `density` [kg/m3] or with a `mass` [kg], where these are not given by
        `centre` [m] and `inertia` [kg m2], as the scene draws it."""

    def samples(self, spacing: float) -> Array:
        """Points all over its surface, `spacing` [m] apart, shape [n, 3]."""

    def surface(self, set_back: float, spacing: float) -> Surface:
        """The points that push the fluid, `set_back` [m] inside of it and `spacing` [m] apart."""

    def dummies(self, spacing: float, support: float) -> Surface:
        """Dummy particles inside of it, `spacing` [m] apart, to the depth of the `support` [m] of the kernel."""

    def corners(self) -> tuple[Array, list[list[int]]]:
        """What is drawn: corners [m], shape [n, 3], and the faces between them; in 2-D one face, the outline."""


def form_of(scene: Scene, path: str, body: BodyField) -> Form:
    """The form of a body of a scene, in its place; `path` is where the body stands in the scene.

    Raises SceneError or ValueError for one that cannot be.
    """
    shape, at = body.shape, np.array(body.at or [0.0] * scene.dimensions)
    if scene.dimensions == 2:
        drawn = (
            Outline(path_legs(scene, f"{path}.shape.path", shape.path, closed=True), closed=True)
            if shape.path
            else closed_outline(shape)
        )
        return Flat(drawn, at, math.radians(body.angle))
    turn = _turn_in_space(body)
    if shape.box:
        return Box(np.array(shape.box.min), np.array(shape.box.max), turn, at)
    if shape.sphere:
        return Ball(shape.sphere.center, shape.sphere.radius, turn, at)
    return Faceted(read_mesh(shape.mesh.file, shape.mesh.scale), turn, at)


class Flat:
    """A form of the plane: what an outline encloses, a slice 1 m wide."""

    mesh: Mesh | None = None
    ball: tuple[Array, float] | None = None

    def __init__(self, drawn: Outline, at: Array, angle: float) -> None:
        """`drawn` is moved to `at` [m] and turned by `angle` [rad]."""
        self._at, self._angle = at, angle
        self.outline: Outline | None = counter_clockwise(drawn.moved(at, angle))
        self._sheet = Sheet(self.outline)

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """As of every `Form`."""
        return self._sheet.contains(points)

    def distance(self, points: Array) -> Array:
        """As of every `Form`, exact everywhere."""
        return self._sheet.distance(points)

    def mass(
        self, density: float | None, mass: float | None, centre: Sequence[float] | None, inertia: float | None
    ) -> MassProperties:
        """As of every `Form`."""
        where = None if centre is None else turned([centre], self._angle)[0] + self._at
        return plane_mass(self.outline, density=density, mass=mass, centre=where, inertia=inertia)

    def samples(self, spacing: float) -> Array:
        """As of every `Form`."""
        return in_space(self.outline.sample(spacing)[0])

    def surface(self, set_back: float, spacing: float) -> Surface:
        """As of every `Form`, with rows of points into its corners."""
        surface = surface_of_outline(_stood_back(self.outline, set_back), spacing)
        return _with_spines(surface, self.outline, set_back, spacing)

    def dummies(self, spacing: float, support: float) -> Surface:
        """As of every `Form`."""
        return _filled(*self._sheet.layers(-1, spacing, layer_count(support, spacing), ()))

    def corners(self) -> tuple[Array, list[list[int]]]:
        """As of every `Form`."""
        border = self.outline.polygon()
        kept = np.linalg.norm(border - np.roll(border, 1, axis=0), axis=1) > 1e-12  # a corner is the end of two legs
        corners = in_space(border[kept])
        return corners, [list(range(len(corners)))]


class Faceted:
    """A form in space that a mesh encloses."""

    outline: Outline | None = None
    ball: tuple[Array, float] | None = None

    def __init__(self, drawn: Mesh, turn: Array, at: Array) -> None:
        """`drawn` is turned by the matrix `turn`, shape [3, 3], and moved to `at` [m]."""
        self._turn, self._at = turn, at
        self.mesh: Mesh | None = Mesh(drawn.vertices @ turn.T + at, drawn.triangles)

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """As of every `Form`."""
        inside = np.all((points > self.mesh.vertices.min(axis=0)) & (points < self.mesh.vertices.max(axis=0)), axis=1)
        inside[inside] = contains(self.mesh, points[inside])
        return inside

    def distance(self, points: Array) -> Array:
        """As of every `Form`: from points farther off than a third of its size, to the box around it."""
        low, high = self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)
        gaps = np.linalg.norm(points - np.clip(points, low, high), axis=1)
        near = gaps < 0.33 * np.linalg.norm(high - low)
        gaps[near] = distance_to_mesh(self.mesh, points[near])
        return gaps

    def mass(
        self,
        density: float | None,
        mass: float | None,
        centre: Sequence[float] | None,
        inertia: Sequence[float] | None,
    ) -> MassProperties:
        """As of every `Form`."""
        given = {
            "density": density,
            "mass": mass,
            "centre": None if centre is None else self._turn @ np.array(centre) + self._at,
            "inertia": None if inertia is None else self._turn @ np.diag(inertia) @ self._turn.T,
        }
        return ball_mass(*self.ball, **given) if self.ball else solid_mass(self.mesh, **given)

    def samples(self, spacing: float) -> Array:
        """As of every `Form`."""
        return np.concatenate([self.mesh.vertices, pieces(self.mesh, spacing)[0]])

    def surface(self, set_back: float, spacing: float) -> Surface:
        """As of every `Form`."""
        return surface_of_mesh(stood_back(self.mesh, set_back), spacing)

    def dummies(self, spacing: float, support: float) -> Surface:
        """As of every `Form`: layers inside of its surface, the first one whole, the others where there is room."""
        points, volumes = np.empty((0, 3)), np.empty(0)
        for k in range(layer_count(support, spacing)):
            depth = (k + 0.5) * spacing
            inner = self._layer(k, depth)
            if inner is None:
                break
            layer = surface_of_mesh(inner, spacing)
            kept = ~near(layer.points, points, LEAST_GAP * spacing)
            if k:  # beyond the middle of a thin part they belong to its other side
                kept[kept] = self._is_deep(layer.points[kept], depth - 0.25 * spacing)
            points = np.concatenate([points, layer.points[kept]])
            volumes = np.concatenate([volumes, spacing * layer.shares[kept]])
        return _filled(points, volumes)

    def _layer(self, k: int, depth: float) -> Mesh | None:
        """The surface of layer `k`, `depth` [m] inside; None where there is nothing left, a ValueError in the first."""
        if k == 0:
            return stood_back(self.mesh, depth)
        inner = moved_in(self.mesh, depth)
        left = np.einsum("ij,ij->i", inner.areas, self.mesh.normals)
        if left.max() <= 1e-6 * np.linalg.norm(self.mesh.areas, axis=1).max():
            return None
        # Near the middle of a ball all of it is folds, of very many edges.
        return inner if left[left > 0.0].sum() > 0.5 * np.linalg.norm(inner.areas, axis=1).sum() else None

    def _is_deep(self, points: Array, depth: float) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside, `depth` [m] at least, shape [n]."""
        return is_deep(self.mesh, points, depth)

    def corners(self) -> tuple[Array, list[list[int]]]:
        """As of every `Form`."""
        return self.mesh.vertices, self.mesh.triangles.tolist()


class Ball(Faceted):
    """A ball, which is drawn by facets."""

    def __init__(self, center: Sequence[float], radius: float, turn: Array, at: Array) -> None:
        """Around `center` [m] as drawn."""
        super().__init__(sphere_mesh(center, radius), turn, at)
        self.ball = turn @ np.array(center) + at, radius

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """As of every `Form`."""
        return np.linalg.norm(points - self.ball[0], axis=1) < self.ball[1]

    def distance(self, points: Array) -> Array:
        """As of every `Form`, exact everywhere."""
        return np.abs(np.linalg.norm(points - self.ball[0], axis=1) - self.ball[1])

    def surface(self, set_back: float, spacing: float) -> Surface:
        """As of every `Form`."""
        if self.ball[1] <= set_back:
            raise ValueError(f"it is too small: the points that push the fluid stand {set_back:.3g} m inside of it")
        return surface_of_mesh(sphere_mesh(self.ball[0], self.ball[1] - set_back), spacing)

    def _layer(self, k: int, depth: float) -> Mesh | None:
        return sphere_mesh(self.ball[0], self.ball[1] - depth) if self.ball[1] > depth else None

    def _is_deep(self, points: Array, depth: float) -> NDArray[np.bool_]:
        return self.ball[1] - np.linalg.norm(points - self.ball[0], axis=1) >= depth


class Box(Faceted):
    """A box, whose points stand on lattices, as on the walls of a tank."""

    def __init__(self, low: Array, high: Array, turn: Array, at: Array) -> None:
        """From corner to corner [m] as drawn."""
        super().__init__(box_mesh(low, high), turn, at)
        self._low, self._high = low, high

    def samples(self, spacing: float) -> Array:
        """As of every `Form`."""
        return Crate(self._low, self._high, frozenset()).sample(spacing)[0] @ self._turn.T + self._at

    def surface(self, set_back: float, spacing: float) -> Surface:
        """As of every `Form`."""
        stood_back(self.mesh, set_back)  # refuses one that is too thin
        inner = Crate(self._low + set_back, self._high - set_back, frozenset())
        points, inward, shares = inner.sample(spacing)
        nothing = np.zeros_like(points)
        return Surface(points @ self._turn.T + self._at, -inward @ self._turn.T, shares, nothing, nothing)

    def dummies(self, spacing: float, support: float) -> Surface:
        """As of every `Form`."""
        drawn = Crate(self._low, self._high, frozenset())
        points, volumes = drawn.layers(-1, spacing, layer_count(support, spacing), ())
        return _filled(points @ self._turn.T + self._at, volumes)


def _filled(points: Array, volumes: Array) -> Surface:
    """Dummy particles as points of a surface: each has its volume for a share, and no normal."""
    nothing = np.zeros_like(points)
    return Surface(points, nothing, volumes, nothing, nothing)


def _stood_back(outline: Outline, distance: float) -> Outline:
    """The outline of the points that push the fluid, `distance` [m] inside of the drawing."""
    back = outline.offset(distance)
    for before, after in zip(outline.legs, back.legs, strict=True):
        if isinstance(before, Line):
            is_turned = (after.end - after.start) @ (before.end - before.start) <= 0.0
        else:
            is_turned = before.turn > 0.0 and before.radius <= distance
        if is_turned:
            x, z = 0.5 * (before.points(np.zeros(1)) + before.points(np.ones(1)))[0]
            raise ValueError(
                f"it is too thin or too small at x = {x:.4g} m, z = {z:.4g} m: "
                f"the points that push the fluid stand {distance:.3g} m inside of it"
            )
    return back


def _with_spines(surface: Surface, outline: Outline, distance: float, spacing: float) -> Surface:
    """`surface` with a row of points into each corner of the counter-clockwise `outline` up to 90 degrees.

    There the points that stand `distance` [m] inside of both faces leave a tip of distance / sin(angle / 2) without
    any, which particles could enter, at 90 degrees to a depth of 0.29 `distance` and no nearer to any point than where
    a face is: the row goes on along the middle until `distance` from the corner.
    """
    for i, after in enumerate(outline.legs):
        a, b = outline.legs[i - 1].normals(np.ones(1))[0], after.normals(np.zeros(1))[0]
        turn = math.atan2(a[0] * b[1] - a[1] * b[0], a @ b)  # to the left
        if turn < 0.5 * math.pi - 1e-6:
            continue
        middle = (a + b) / np.linalg.norm(a + b)
        bare = distance / math.sin(0.5 * (math.pi - turn))
        pieces = max(1, math.ceil((bare - distance) / spacing))
        along = np.linspace(bare, distance, pieces + 1)
        row = in_space(after.points(np.zeros(1)) + along[:, None] * middle)
        to_next = np.concatenate([np.diff(row, axis=0), np.zeros((1, 3))])[1:]
        surface = Surface(
            np.concatenate([surface.points, row[1:]]),
            np.concatenate([surface.normals, np.zeros((pieces, 3))]),  # fluid on both sides
            np.concatenate([surface.shares, np.zeros(pieces)]),
            np.concatenate([surface.before, -np.diff(row, axis=0)]),
            np.concatenate([surface.after, to_next]),
        )
    return surface


def _turn_in_space(body: BodyField) -> Array:
    """The matrix of the turn by which a drawing is put in its place, shape [3, 3]."""
    axis, half = axis_of(body.axis), math.radians(0.5 * body.angle)
    return rotation(np.append(math.sin(half) * axis / np.linalg.norm(axis), math.cos(half)))


def axis_of(axis: Sequence[float] | None) -> Array:
    """An axis of turning; without one, that about which x-z turns counter-clockwise as one looks at it."""
    return np.array([0.0, -1.0, 0.0] if axis is None else axis)
