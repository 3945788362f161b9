"""From the fields of a scene to shapes: outlines of whatever is drawn in the x-z plane, walls and fluids in space."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from warpsph.scene.boundaries import WallField
from warpsph.scene.scene import Scene
from warpsph.scene.shapes import Corner, Shape, SolidField
from warpsph.shapes.crate import Crate
from warpsph.shapes.outline import Bend, Leg, Line, Outline
from warpsph.shapes.points import Array
from warpsph.shapes.sheet import Sheet
from warpsph.shapes.volumes import Prism, Sphere
from warpsph.shapes.wall import Wall


def wall_surface(scene: Scene, index: int) -> Wall:
    """`scene.walls[index]` in space.

    Raises SceneError for a path that cannot be drawn.
    """
    wall = scene.walls[index]
    if scene.dimensions == 3 and wall.box:
        return Crate(np.array(wall.box.min), np.array(wall.box.max), frozenset(wall.box.open or ()))
    return Sheet(wall_outline(scene, index), wall.width)


def solid(scene: Scene, shape: Shape) -> Prism | Sphere:
    """`shape` in space."""
    if shape.sphere:
        return Sphere(np.array(shape.sphere.center), shape.sphere.radius)
    outline = closed_outline(shape)
    area = math.pi * shape.disc.radius**2 if shape.disc else _area(outline.polygon())
    if scene.dimensions == 2:
        return Prism(outline, (-0.5 * scene.spacing, 0.5 * scene.spacing), area)
    box = shape.box
    width = (box.min[1], box.max[1]) if box and not shape.width else shape.width
    assert width, "a shape in space is a box or has a width"
    return Prism(outline, width, area * (width[1] - width[0]))


def wall_outline(scene: Scene, index: int) -> Outline:
    """The exact line of `scene.walls[index]`.

    Raises SceneError for a path that stands still, or a corner that is too tight for its radius.
    """
    wall = scene.walls[index]
    if wall.path:
        return Outline(path_legs(scene, f"walls[{index}].path", wall.path, wall.closed), wall.closed)
    if wall.arc:
        start, end = math.radians(wall.arc.start), math.radians(wall.arc.end)
        return Outline((Bend(np.array(wall.arc.center), wall.arc.radius, start, end - start),), closed=False)
    return closed_outline(wall)


def closed_outline(part: WallField | Shape | SolidField) -> Outline:
    """The exact outline of a box, a disc or a polygon in the x-z plane; boxes and discs run counter-clockwise from the
    bottom."""
    if part.disc:
        return Outline((Bend(np.array(part.disc.center), part.disc.radius, -0.5 * math.pi, 2 * math.pi),), closed=True)
    if part.box:
        (left, *_, low), (right, *_, high) = part.box.min, part.box.max
        corners = np.array([[left, low], [right, low], [right, high], [left, high]])
    else:
        assert not isinstance(part, WallField), "a wall that is closed is a box, a disc or a path"
        corners = np.array(part.polygon)
    return Outline(tuple(Line(a, b) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)), closed=True)


def path_legs(scene: Scene, where: str, path: Sequence[Corner | Sequence[float]], closed: bool) -> tuple[Leg, ...]:
    """Straight legs between the points of a path, with an arc at every rounded corner; `where` it stands in the scene.

    Raises SceneError for a path that stands still, or a corner that is too tight for its radius.
    """
    stops = [point if isinstance(point, Corner) else Corner(at=point, radius=0.0) for point in path]
    corners = np.array([stop.at for stop in stops])
    count = len(stops)
    ways = np.roll(corners, -1, axis=0) - corners  # way i leads from corner i to the next
    reach = np.linalg.norm(ways, axis=1)
    ways_count = count if closed else count - 1
    for i in range(ways_count):
        if reach[i] == 0.0:
            raise scene.error(f"{where}[{(i + 1) % count}]", "is the same place as the point before it")
    along = ways / np.where(reach, reach, 1.0)[:, None]

    # How much of its two legs each rounded corner takes: the tangent length, radius times tan(half the turn).
    turns, taken = np.zeros(count), np.zeros(count)
    for i, stop in enumerate(stops):
        if stop.radius > 0.0:
            a, b = along[i - 1], along[i]
            turn = math.atan2(a[0] * b[1] - a[1] * b[0], a @ b)
            if abs(turn) > math.pi - 1e-6:
                raise scene.error(f"{where}[{i}]", "turns straight back, which no arc can round")
            if abs(turn) > 1e-9:
                turns[i], taken[i] = turn, stop.radius * abs(math.tan(turn / 2))
    for i in range(ways_count):
        j = (i + 1) % count
        if taken[i] + taken[j] > reach[i] * (1 + 1e-12):
            tight, other = (j, i) if taken[j] >= taken[i] else (i, j)
            most = stops[tight].radius * max(reach[i] - taken[other], 0.0) / taken[tight]
            raise scene.error(
                f"{where}[{tight}].radius",
                f"{stops[tight].radius:g} m takes {taken[tight]:.3g} m of a leg with {reach[i] - taken[other]:.3g} m "
                f"to spare; {most:.3g} m is the most",
            )

    legs: list[Leg] = []
    for i in range(count):
        if turns[i] != 0.0:
            left = np.array([-along[i - 1][1], along[i - 1][0]]) * math.copysign(1.0, turns[i])
            center = corners[i] - taken[i] * along[i - 1] + stops[i].radius * left
            legs.append(Bend(center, stops[i].radius, math.atan2(-left[1], -left[0]), turns[i]))
        j = (i + 1) % count
        if i < ways_count and reach[i] - taken[i] - taken[j] > 1e-9 * reach[i]:
            legs.append(Line(corners[i] + taken[i] * along[i], corners[j] - taken[j] * along[i]))
    return tuple(legs)


def _area(polygon: Array) -> float:
    """Area that a polygon [k, 2] encloses [m2]."""
    x, z = polygon.T
    return abs(float(np.sum(x * np.roll(z, -1) - z * np.roll(x, -1)))) / 2
