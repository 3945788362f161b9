"""The bodies of a scene: from drawings to rigid bodies in their places, and refusals of impossible bodies.

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
from warpsph.bodies.contact_geometry import ContactLegs, ContactPoints, contact_depth, contact_of, joined
from warpsph.bodies.motion import Motion, read_table
from warpsph.bodies.wave_maker import WaveError, paddle_motion
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.placement.solids import Form, axis_of, form_of
from warpsph.scene.bodies import BodyField, BodyMotion
from warpsph.scene.scene import Scene
from warpsph.scene.shapes import SolidField
from warpsph.shapes.points import Array, around, spatial
from warpsph.shapes.wall import Wall

# A corner typed to five digits still rests on the slope that it was computed for. In spacings.
TOUCH_SLACK = 1e-2
NOWHERE = (0.0, 0.0, 0.0)

# A body wider than the walls by so much, or so far away from them, is a slip of the unit or of the place.
MOST_OF_ROOM = 5.0
# Points of a body, each with lists of its own.
MOST_POINTS = 3e6


@dataclass(frozen=True)
class Solid:
    """A body in its place at the start.

    Attributes:
        body: Its mass, motion and contact; the points of its surface stand back from the drawing, as in walls.
        form: What is drawn of it.
        samples: Points all over the drawing, a wall's spacing apart [m], shape [n, 3].
    """

    body: Body
    form: Form
    samples: Array

    closed = True  # it has an inside, as a closed wall has

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Whether each of `points` lies inside, shape [n]."""
        return self.form.contains(points)

    def distance(self, points: Array) -> Array:
        """Distance from each of `points` to the surface [m], shape [n]; far outside as of `Form.distance`."""
        return self.form.distance(points)

    def corners(self) -> tuple[Array, list[list[int]]]:
        """What is drawn: corners about the centre of mass [m], shape [n, 3], and the faces between them.

        In 2-D there is one face, the outline.
        """
        corners, faces = self.form.corners()
        return corners - self.body.mass.centre, faces


def place_bodies(scene: Scene, drawn: Sequence[Array]) -> list[Solid]:
    """The bodies of `scene` where it puts them; `drawn` are points on each of its walls [m], shape [n, 3].

    Raises SceneError for a body that is impossible, in a wall, or in another body.
    """
    solids: list[Solid] = []
    boxes: list[tuple[Array, Array]] = []
    for i, body in enumerate(scene.bodies):
        path = f"bodies[{i}]"
        solid = _solid(scene, path, body, around(*drawn) if drawn else None)
        for wall, points in zip(scene.walls, drawn, strict=True):
            if (spot := _overlap(scene, solid, points)) is not None:
                raise scene.error(f"{path}.shape", f"wall '{wall.name}' runs through it, at {scene.spot(spot)}")
        low, high = around(solid.samples)
        for other, earlier, (its_low, its_high) in zip(scene.bodies, solids, boxes, strict=False):
            if np.any((low > its_high + scene.spacing) | (high < its_low - scene.spacing)):
                continue  # as most of many are
            spot = _overlap(scene, solid, earlier.samples)
            spot = _overlap(scene, earlier, solid.samples) if spot is None else spot
            # Where two bodies lie just in each other, every place on one's surface is on the other's.
            spot = _overlap(scene, earlier, solid.body.surface.points) if spot is None else spot
            if spot is not None:
                raise scene.error(f"{path}.shape", f"overlaps body '{other.name}', at {scene.spot(spot)}")
        solids.append(solid)
        boxes.append((low, high))
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


def refuse_behind(scene: Scene, solids: Sequence[Solid], walls: Sequence[Wall], sides: Sequence[int]) -> None:
    """Raises SceneError for a body that lies behind a wall; `sides` are the sides on which walls have the fluid."""
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
    scene: Scene, walls: Sequence[Wall], sides: Sequence[int]
) -> tuple[list[ContactLegs], ContactPoints]:
    """The walls as contact sees them: as drawn, and free where the fluid is."""
    legs: list[ContactLegs] = []
    points: list[ContactPoints] = []
    depth = contact_depth(scene.smoothing_length)
    for wall, side in zip(walls, sides, strict=True):
        for way in (side,) if side else (1, -1):
            found, touching = contact_of(wall, way, depth)
            legs, points = legs + found, points + touching
    return legs, joined(points)


def _refuse_misplaced(scene: Scene, shape: SolidField, form: Form, room: tuple[Array, Array] | None) -> None:
    """Raises ValueError for a body in another unit or in another place, and for one of too many points.

    `room` is around the walls: lower and upper corner [m].
    """
    corners = form.mesh.vertices if form.mesh else np.insert(form.outline.polygon(), 1, 0.0, axis=1)
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = float((high - low).max())
    if room:
        wide = float((room[1] - room[0]).max())
        scale = shape.mesh.scale if shape.mesh else 1.0
        if size > MOST_OF_ROOM * wide:
            hint = f"; millimetres? scale: {1e-3 * scale:g}" if shape.mesh else ""
            raise ValueError(f"it is {size:.3g} m wide, and the walls {wide:.3g} m{hint}")
        gap = float(np.linalg.norm(np.maximum(np.maximum(low - room[1], room[0] - high), 0.0)))
        if gap > MOST_OF_ROOM * max(wide, size):
            words = f"{gap:.3g} m from the walls, around {scene.spot(0.5 * (low + high))}"
            raise ValueError(f"it lies {words}; 'at' puts it elsewhere")
    if shape.mesh and size < 2.0 * scene.spacing:
        hint = f"; another unit? scale: {1e3 * shape.mesh.scale:g}"
        raise ValueError(f"it is {size:.3g} m wide, less than two spacings{hint}")
    area = float(np.linalg.norm(form.mesh.areas, axis=1).sum()) if form.mesh else form.outline.length
    if (points := area / scene.wall_spacing ** (scene.dimensions - 1)) > MOST_POINTS:
        unit = "m2" if form.mesh else "m"
        raise ValueError(
            f"its surface of {area:.3g} {unit} would take {points:.2g} points; {MOST_POINTS:.0e} is the most"
        )


def _solid(scene: Scene, path: str, body: BodyField, room: tuple[Array, Array] | None) -> Solid:
    """One body in its place; `room` is around the walls: lower and upper corner [m]."""
    set_back, spacing = scene.wall_model.set_back * scene.spacing, scene.wall_spacing
    try:
        form = form_of(scene, path, body)
        _refuse_misplaced(scene, body.shape, form, room)
        mass = form.mass(body.density, body.mass, body.centre, body.inertia)
        if scene.wall_model.force == "dummy_particles":
            surface = form.dummies(scene.spacing, _support(scene))
        else:
            surface = form.surface(set_back, spacing)
        if not len(surface.points):
            raise ValueError(f"it is too thin for a spacing of {scene.spacing:g} m")
        free_shift, free_turn = _freedom(scene, body)
        return Solid(
            Body(
                body.name,
                mass,
                surface,
                form.outline,
                form.mesh,
                form.ball,
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
            form,
            form.samples(spacing),
        )
    except ValueError as error:
        counted = f" (counted from {scene.spot((0.0, 0.0, 0.0))})" if any(scene.origin) else ""
        raise scene.error(f"{path}.shape", f"{error}{counted}") from None


def _support(scene: Scene) -> float:
    """Of the smoothing kernel [m]."""
    return SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length


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
        axis=axis_of(motion.axis),
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
