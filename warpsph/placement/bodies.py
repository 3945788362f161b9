"""The bodies of a scene: from what is drawn to rigid bodies in their places, and refusals of those that cannot be.

Everything here happens once, on the host. Points are [x, y, z], with y = 0 in a 2-D scene, whose bodies are slices 1 m
wide. In the scene and the records angles, spins and torques of a 2-D body are counter-clockwise as one looks at the
x-z plane, which is from z to x, negative about y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpsph.bodies.body import PLANE_SHIFT, PLANE_TURN, Body
from warpsph.bodies.body_set import (
    ContactLeg,
    ContactPoints,
    contact_depth,
    contact_legs,
    contact_points,
    corners_at,
    edges_at,
    facet_legs,
    joined,
    rotation,
)
from warpsph.bodies.facets import crate_facets, sheet_edges
from warpsph.bodies.motion import Motion, read_table
from warpsph.bodies.wave_maker import WaveError, paddle_motion
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.placement.dummies import dummies_of_box, dummies_of_outline, layer_count
from warpsph.scene.bodies import Body as BodyField
from warpsph.scene.bodies import BodyMotion
from warpsph.scene.scene import Scene
from warpsph.scene.shapes import Solid as SolidField
from warpsph.shapes.mesh import (
    Mesh,
    ball_mass,
    box_mesh,
    distance_to_mesh,
    read_mesh,
    solid_mass,
    sphere_mesh,
    stood_back,
    winding_number,
)
from warpsph.shapes.outline import Line, Outline, closed_outline, counter_clockwise, path_legs
from warpsph.shapes.points import Array, in_space, spatial, turned
from warpsph.shapes.sampling import Surface, pieces, surface_of_mesh, surface_of_outline
from warpsph.shapes.section import plane_mass
from warpsph.shapes.surface import Crate, Sheet

# A corner typed to five digits still rests on the slope that it was computed for. In spacings.
TOUCH_SLACK = 1e-2
NOWHERE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Solid:
    """A body in its place at the start.

    Attributes:
        body: Its mass, motion and contact; the points of its surface stand back from what is drawn, as those of walls.
        drawn: What is drawn of it, in 2-D.
        mesh: The same in 3-D.
        samples: Points all over what is drawn, a wall's spacing apart [m], shape [n, 3].
    """

    body: Body
    drawn: Sheet | None
    mesh: Mesh | None
    samples: Array

    closed = True  # it has an inside, as a closed wall has

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside, shape [n]."""
        if self.drawn is not None:
            return self.drawn.contains(points)
        if self.body.ball:
            return np.linalg.norm(points - self.body.ball[0], axis=1) < self.body.ball[1]
        inside = np.all((points > self.mesh.vertices.min(axis=0)) & (points < self.mesh.vertices.max(axis=0)), axis=1)
        inside[inside] = winding_number(self.mesh, points[inside]) > 0.5
        return inside

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the surface [m], shape [n].

        Of a mesh, from points that lie outside of the box around it by more than a third of its size: to the box.
        """
        if self.drawn is not None:
            return self.drawn.distance(points)
        if self.body.ball:
            return np.abs(np.linalg.norm(points - self.body.ball[0], axis=1) - self.body.ball[1])
        low, high = self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)
        gaps = np.linalg.norm(points - np.clip(points, low, high), axis=1)
        near = gaps < 0.33 * np.linalg.norm(high - low)
        gaps[near] = distance_to_mesh(self.mesh, points[near])
        return gaps

    def corners(self) -> tuple[Array, list[list[int]]]:
        """What is drawn: corners about the centre of mass [m], shape [n, 3], and the faces between them.

        In 2-D there is one face, the outline.
        """
        if self.mesh is not None:
            return self.mesh.vertices - self.body.mass.centre, self.mesh.triangles.tolist()
        border = self.drawn.outline.polygon()
        kept = np.linalg.norm(border - np.roll(border, 1, axis=0), axis=1) > 1e-12  # a corner is the end of two legs
        corners = in_space(border[kept]) - self.body.mass.centre
        return corners, [list(range(len(corners)))]


def place_bodies(scene: Scene, drawn: Sequence[Array]) -> list[Solid]:
    """The bodies of `scene` where it puts them; `drawn` are points on each of its walls [m], shape [n, 3].

    Raises SceneError for a body that is impossible, in a wall, or in another body.
    """
    solids: list[Solid] = []
    for i, body in enumerate(scene.bodies):
        path = f"bodies[{i}]"
        solid = _solid(scene, path, body)
        for wall, points in zip(scene.walls, drawn, strict=True):
            if (spot := _overlap(scene, solid, points)) is not None:
                raise scene.error(f"{path}.shape", f"wall '{wall.name}' runs through it, at {scene.spot(spot)}")
        for other, earlier in zip(scene.bodies, solids, strict=False):
            spot = _overlap(scene, solid, earlier.samples)
            spot = _overlap(scene, earlier, solid.samples) if spot is None else spot
            if spot is not None:
                raise scene.error(f"{path}.shape", f"overlaps body '{other.name}', at {scene.spot(spot)}")
        solids.append(solid)
    _refuse_no_room(scene, solids, drawn)
    return solids


def _refuse_no_room(scene: Scene, solids: Sequence[Solid], drawn: Sequence[Array]) -> None:
    """Raises SceneError where a wall stands in the way of a paddle behind it."""
    if scene.wave_maker is None:
        return
    paddle = solids[-1]
    back = -float(paddle.body.motion.table.shift[:, 0].min())
    low, high = paddle.samples.min(axis=0), paddle.samples.max(axis=0)
    for wall, points in zip(scene.walls, drawn, strict=True):
        beside = np.all((points >= low)[:, 1:] & (points <= high)[:, 1:], axis=1) & (points[:, 2] > low[2])
        behind = points[beside & (points[:, 0] < low[0]), 0]
        if len(behind) and low[0] - behind.max() < back:
            room = low[0] - behind.max()
            words = f"its paddle goes {back:.3g} m back, and wall '{wall.name}' stands {room:.3g} m behind it"
            raise scene.error("wave_maker", words)


def refuse_behind(scene: Scene, solids: Sequence[Solid], walls: Sequence[Sheet | Crate], sides: Sequence[int]) -> None:
    """Raises SceneError for a body that lies behind a wall; `sides` are those of the walls on which the fluid is."""
    for wall, one, side in zip(scene.walls, walls, sides, strict=True) if solids else ():
        points, normals, _ = one.sample(scene.wall_spacing)
        for i, solid in enumerate(solids):
            if side and _is_behind(solid.body.mass.centre, points, side * normals):
                raise scene.error(f"bodies[{i}]", f"lies behind wall '{wall.name}'")


def refuse_too_fast(scene: Scene, solids: Sequence[Solid]) -> None:
    """Raises SceneError for a prescribed motion that is faster than sound in a fluid."""
    speeds = {fluid.material: scene.materials[fluid.material].sound_speed for fluid in scene.fluids}
    slowest = min(speeds, key=speeds.get)
    for i, solid in enumerate(solids):
        speed, row = top_speed(solid)
        if speed >= speeds[slowest]:
            motion = scene.bodies[i].motion
            place, words = f"bodies[{i}].motion", "moves"
            if motion.file:
                place, words = f"{place}.file", f"{motion.file}:{solid.body.motion.table.line[row]}: gets to this row"
            sound = f"sound in '{slowest}', {speeds[slowest]:g} m/s"
            raise scene.error(place, f"{words} with {speed:.3g} m/s, faster than {sound}")


def top_speed(solid: Solid) -> tuple[float, int]:
    """The greatest speed at which a prescribed motion moves a body [m/s], or 0; and the row before which it has it."""
    motion = solid.body.motion
    if motion is None:
        return 0.0, 0
    pivot = solid.body.mass.centre if motion.pivot is None else np.asarray(motion.pivot, float)
    return motion.top_speed(float(np.linalg.norm(solid.samples - pivot, axis=1).max()))


def contact_of_walls(
    scene: Scene, walls: Sequence[Sheet | Crate], sides: Sequence[int]
) -> tuple[list[ContactLeg], ContactPoints]:
    """The walls as contact sees them: as drawn, and free where the fluid is."""
    legs: list[ContactLeg] = []
    points: list[ContactPoints] = []
    depth = contact_depth(scene.smoothing_length)
    for wall, side in zip(walls, sides, strict=True):
        for way in (side,) if side else (1, -1):
            if isinstance(wall, Sheet):
                legs += contact_legs(wall.outline, way, depth, *([wall.width] if wall.width else []))
            if isinstance(wall, Sheet) and not wall.width:
                points.append(contact_points(wall.outline, way))
                continue
            found = sheet_edges(wall, way) if isinstance(wall, Sheet) else crate_facets(wall, way, depth)
            legs += facet_legs(found, depth)
            points += [corners_at(found.corners), edges_at(found.edges)]
    return legs, joined(points)


def _solid(scene: Scene, path: str, body: BodyField) -> Solid:
    """One body in its place."""
    set_back, angle = scene.wall_model.set_back * scene.spacing, math.radians(body.angle)
    at = np.array(body.at or [0.0] * scene.dimensions)
    given = {"density": body.density, "mass": body.mass}
    try:
        if scene.dimensions == 2:
            outline = counter_clockwise(_outline(scene, path, body.shape).moved(at, angle))
            centre = None if body.centre is None else turned([body.centre], angle)[0] + at
            mass = plane_mass(outline, **given, centre=centre, inertia=body.inertia)
            if scene.wall_model.force == "dummy_particles":
                surface = _filled(*dummies_of_outline(outline, scene.spacing, _support(scene)))
            else:
                surface = surface_of_outline(_stood_back(outline, set_back), scene.wall_spacing)
                surface = _with_spines(surface, outline, set_back, scene.wall_spacing)
            drawn, mesh, ball, samples = Sheet(outline), None, None, in_space(outline.sample(scene.wall_spacing)[0])
        else:
            outline, drawn = None, None
            turn = _turn_in_space(body)
            mesh, ball = _mesh(body.shape, turn, at)
            centre = None if body.centre is None else turn @ np.array(body.centre) + at
            inertia = None if body.inertia is None else turn @ np.diag(body.inertia) @ turn.T
            given |= {"centre": centre, "inertia": inertia}
            mass = ball_mass(*ball, **given) if ball else solid_mass(mesh, **given)
            surface, samples = _surface(scene, body.shape, mesh, ball, turn, at, set_back)
            if scene.wall_model.force == "dummy_particles":
                surface = _dummies_in_space(scene, body.shape, mesh, ball, turn, at)
        if not len(surface.points):
            raise ValueError(f"it is too thin for a spacing of {scene.spacing:g} m")
        free_shift, free_turn = _freedom(scene, body)
        return Solid(
            Body(
                body.name,
                mass,
                surface,
                outline,
                mesh,
                ball,
                velocity=spatial(body.velocity or NOWHERE),
                spin=body.spin if isinstance(body.spin, tuple) else (0.0, -(body.spin or 0.0), 0.0),
                free_shift=free_shift,
                free_turn=free_turn,
                motion=_motion(scene, path, body.motion) if body.motion else None,
                release=0.0 if body.hold else -math.inf,
                restitution=body.contact.restitution,
                static_friction=body.contact.static_friction,
                dynamic_friction=body.contact.dynamic_friction,
            ),
            drawn,
            mesh,
            samples,
        )
    except ValueError as error:
        counted = f" (counted from {scene.spot((0.0, 0.0, 0.0))})" if any(scene.origin) else ""
        raise scene.error(f"{path}.shape", f"{error}{counted}") from None


def _support(scene: Scene) -> float:
    """Of the smoothing kernel [m]."""
    return SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length


def _filled(points: Array, volumes: Array) -> Surface:
    """Dummy particles as points of a surface: each has its volume for a share, and no normal."""
    nothing = np.zeros_like(points)
    return Surface(points, nothing, volumes, nothing, nothing)


def _dummies_in_space(
    scene: Scene, shape: SolidField, mesh: Mesh, ball: tuple[Array, float] | None, turn: Array, at: Array
) -> Surface:
    """Dummies inside a shape: the lattice of a box, else layers inside of its surface."""
    dx, reach = scene.spacing, _support(scene)
    if shape.box:
        points, volumes = dummies_of_box(np.array(shape.box.min), np.array(shape.box.max), dx, reach)
        return _filled(points @ turn.T + at, volumes)
    layers = []
    for k in range(layer_count(reach, dx)):
        depth = (k + 0.5) * dx
        if ball is not None and ball[1] <= depth:
            break
        inner = stood_back(mesh, depth) if ball is None else sphere_mesh(ball[0], ball[1] - depth)
        layers.append(surface_of_mesh(inner, dx))
    return _filled(
        np.concatenate([layer.points for layer in layers]), dx * np.concatenate([layer.shares for layer in layers])
    )


def _outline(scene: Scene, path: str, shape: SolidField) -> Outline:
    if shape.path:
        return Outline(path_legs(scene, f"{path}.shape.path", shape.path, closed=True), closed=True)
    return closed_outline(shape)


def _stood_back(outline: Outline, distance: float) -> Outline:
    """The outline of the points that push the fluid, `distance` [m] inside of what is drawn."""
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


def _mesh(shape: SolidField, turn: Array, at: Array) -> tuple[Mesh, tuple[Array, float] | None]:
    """The surface of a shape in its place; and, of a sphere, centre and radius."""
    ball = None
    if shape.box:
        mesh = box_mesh(shape.box.min, shape.box.max)
    elif shape.sphere:
        mesh = sphere_mesh(shape.sphere.center, shape.sphere.radius)
        ball = turn @ np.array(shape.sphere.center) + at, shape.sphere.radius
    else:
        mesh = read_mesh(shape.mesh.file, shape.mesh.scale)
    return Mesh(mesh.vertices @ turn.T + at, mesh.triangles), ball


def _surface(
    scene: Scene,
    shape: SolidField,
    mesh: Mesh,
    ball: tuple[Array, float] | None,
    turn: Array,
    at: Array,
    set_back: float,
) -> tuple[Surface, Array]:
    """The points that push the fluid, `set_back` [m] inside of what is drawn, and points all over that [m]."""
    if shape.box:
        stood_back(mesh, set_back)  # refuses one that is too thin
        # On a lattice, as the walls of a tank.
        low, high = np.array(shape.box.min), np.array(shape.box.max)
        drawn, inner = Crate(low, high, frozenset()), Crate(low + set_back, high - set_back, frozenset())
        points, inward, shares = inner.sample(scene.wall_spacing)
        nothing = np.zeros_like(points)
        surface = Surface(points @ turn.T + at, -inward @ turn.T, shares, nothing, nothing)
        return surface, drawn.sample(scene.wall_spacing)[0] @ turn.T + at
    samples = np.concatenate([mesh.vertices, pieces(mesh, scene.wall_spacing)[0]])
    if ball is None:
        return surface_of_mesh(stood_back(mesh, set_back), scene.wall_spacing), samples
    if ball[1] <= set_back:
        raise ValueError(f"it is too small: the points that push the fluid stand {set_back:.3g} m inside of it")
    return surface_of_mesh(sphere_mesh(ball[0], ball[1] - set_back), scene.wall_spacing), samples


def _motion(scene: Scene, path: str, motion: BodyMotion) -> Motion:
    table = None
    if motion.kind == "waves":
        try:
            return paddle_motion(scene.wave_maker, scene.run.end_time, scene.gravity)
        except WaveError as error:
            raise scene.error(f"wave_maker.{error.field}", str(error)) from None
    if motion.file:
        try:
            rows = read_table(motion.file)
        except ValueError as error:
            raise scene.error(f"{path}.motion.file", str(error)) from None
        table = rows
    return Motion(
        motion.kind,
        direction=spatial(motion.shift or NOWHERE),
        turn=math.radians(motion.turn),
        axis=_axis(motion.axis),
        pivot=None if motion.pivot is None else spatial(motion.pivot),
        begin=motion.begin,
        period=motion.period or 1.0,
        phase=math.radians(motion.phase),
        table=table,
    )


def _freedom(scene: Scene, body: BodyField) -> tuple[Array, Array]:
    """1 for each axis along which and about which the body is free."""
    in_space = (1.0, 1.0, 1.0)
    shifts, turns = (PLANE_SHIFT, PLANE_TURN) if scene.dimensions == 2 else (in_space, in_space)
    along, about = ("x", "y", "z"), ("turn_x", "angle" if scene.dimensions == 2 else "turn_y", "turn_z")
    return _unless(shifts, along, body.locked), _unless(turns, about, body.locked)


def _unless(free: Sequence[float], ways: Sequence[str], locked: Sequence[str]) -> Array:
    """`free` with 0 for each of the `ways` that are locked."""
    return np.array([one * (way not in locked) for one, way in zip(free, ways, strict=True)])


def _overlap(scene: Scene, solid: Solid, points: Array) -> Array | None:
    """The first of `points` that lies in `solid`, and not just on its surface; None where there is none."""
    inside = points[solid.contains(points)]
    deep = inside[solid.distance(inside) > TOUCH_SLACK * scene.spacing] if len(inside) else inside
    return deep[0] if len(deep) else None


def _is_behind(centre: Array, points: Array, normals: Array) -> bool:
    """Whether the wall point that is nearest to `centre` has it straight behind."""
    arm = centre - points[np.argmin(((points - centre) ** 2).sum(axis=1))]
    nearest = normals[np.argmin(((points - centre) ** 2).sum(axis=1))]
    return bool(arm @ nearest < -0.7 * np.linalg.norm(arm))


def _turn_in_space(body: BodyField) -> Array:
    """The matrix of the turn by which a drawing is put in its place, shape [3, 3]."""
    axis, half = _axis(body.axis), math.radians(0.5 * body.angle)
    return rotation([*(math.sin(half) * axis / np.linalg.norm(axis)), math.cos(half)])


def _axis(axis: Sequence[float] | None) -> Array:
    """An axis of turning; without one, that about which x-z turns counter-clockwise as one looks at it."""
    return np.array([0.0, -1.0, 0.0] if axis is None else axis)
