"""From a scene to points: walls sampled evenly, fluids cut from square or cubic lattices, refusals of the impossible.

Everything here happens once, on the host, in double precision, before a particle is made on a device.

Points are [x, y, z], with y = 0 in a 2-D scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpsph.kernels.smoothing import SMOOTHING
from warpsph.placement.bodies import Solid, place_bodies, refuse_behind, refuse_too_fast
from warpsph.placement.damping import refuse_long_zones
from warpsph.placement.doubts import doubts_of
from warpsph.placement.drawing import wall_surface
from warpsph.placement.dummies import NO_DUMMIES, Dummies, place_dummies
from warpsph.placement.fluids import Sites, fill_sites, shape_sites
from warpsph.placement.images import Edge, find_edges, find_images
from warpsph.placement.lattice import LATTICE_SLACK, joined, refuse_too_many
from warpsph.placement.origin import localised
from warpsph.placement.packing import pack
from warpsph.placement.sound import slow_sound
from warpsph.scene.scene import Scene
from warpsph.shapes.outline import Array
from warpsph.shapes.points import BLOCK, around, near

# ------------------------------------------------------------------------------------------------------------ placement


@dataclass(frozen=True)
class Placement:
    """Every point of a scene at the start, counted from its origin, fluids in the order of `scene.fluids`.

    Attributes:
        position: Fluid particles [m], shape [particle_count, 3].
        velocity: [m/s], shape [particle_count, 3].
        fluid: Index into `scene.fluids`, int32, shape [particle_count].
        initial_depth: Column of the own fluid that weighs what presses on a particle at rest [m], 0 where `hydrostatic`
            is off, [particle_count].
        volume: Of one particle of each fluid at its reference density [m3, in 2-D m2], shape [fluid_count]: a cell of
            the lattice in a fill, and in a shape its volume shared out, so that the mass is the mass of the drawing.
        wall_position: Points of all walls [m], set back from the walls as drawn, shape [wall_count, 3].
        wall_normal: Unit normals towards the fluid, 0 where there is fluid on both sides, shape [wall_count, 3].
        wall_before, wall_after: From each wall point to its neighbours on an outline [m], 0 where it ends, and
            everywhere in a 3-D scene, shape [wall_count, 3].
        wall_area: Area of wall that each point stands for [m2, in 2-D a length in m], shape [wall_count].
        dummies: Of the walls, where these are made of dummy particles; none elsewhere.
        sides: Side of each wall on which the fluid is, as `wet_side`.
        solids: The bodies in their places.
        ground: Height of the lowest point of the walls as drawn, or of the fluid where there are no walls [m].
        warnings: What is doubtful, a line each.
    """

    position: Array
    velocity: Array
    fluid: NDArray[np.int32]
    initial_depth: Array
    volume: Array
    wall_position: Array
    wall_normal: Array
    wall_before: Array
    wall_after: Array
    wall_area: Array
    dummies: Dummies
    sides: tuple[int, ...]
    solids: tuple[Solid, ...]
    ground: float
    warnings: tuple[str, ...]

    @property
    def counts(self) -> tuple[int, ...]:
        """How many particles each fluid has; the particles of one fluid follow each other."""
        ends = np.searchsorted(self.fluid, np.arange(len(self.volume) + 1, dtype=np.int32))
        return tuple(np.diff(ends).tolist())


@dataclass(frozen=True)
class Start:
    """What is kept of a placement when its points are on the device.

    Attributes:
        counts: Particles of each fluid.
        wall_count: Points of all walls.
        fluid_box, box: Lower and upper corner of the box around the particles, and around the wall points too [m].
        drop: How far the highest particle, or body that is free to, can fall [m].
        top_speed: The highest speed [m/s].
        sides, solids, ground, warnings: As in `Placement`.
    """

    counts: tuple[int, ...]
    wall_count: int
    fluid_box: tuple[Array, Array]
    box: tuple[Array, Array]
    drop: float
    top_speed: float
    sides: tuple[int, ...]
    solids: tuple[Solid, ...]
    ground: float
    warnings: tuple[str, ...]

    @classmethod
    def of(cls, placement: Placement) -> Start:
        """That of a placement."""
        return cls(
            counts=placement.counts,
            wall_count=len(placement.wall_position),
            fluid_box=around(placement.position),
            box=around(placement.wall_position, placement.position),
            drop=drop_height(placement),
            top_speed=top_speed(placement.velocity),
            sides=placement.sides,
            solids=placement.solids,
            ground=placement.ground,
            warnings=placement.warnings,
        )


def place(scene: Scene) -> Placement:
    """Sample the walls and set out the fluids of `scene`.

    Raises SceneError for what cannot be: an empty fluid, a shape on top of a wall, a fill that leaks, a corner too
    tight for its radius, a speed of sound too low for the drop.
    """
    scene = localised(scene)
    walls = [wall_surface(scene, i) for i in range(len(scene.walls))]
    refuse_too_many(scene, "walls", sum(one.area for one in walls) / scene.wall_spacing ** (scene.dimensions - 1))
    drawn = [one.sample(scene.wall_spacing)[0] for one in walls]
    solids = place_bodies(scene, drawn)
    refuse_too_fast(scene, solids)
    edges, _ = find_edges(scene)
    warnings: list[str] = []
    placed: list[Sites] = []
    for i, fluid in enumerate(scene.fluids):
        path = f"fluids[{i}].{'shape' if fluid.shape else 'fill'}"
        sites = (
            shape_sites(scene, path, fluid, walls, drawn, solids)
            if fluid.shape
            else fill_sites(scene, path, fluid, walls, drawn, solids, tuple(placed))
        )
        fitting = len(sites.position)
        if fluid.shape:
            sites = sites.apart_from([one.position for one in placed], (1.0 - LATTICE_SLACK) * scene.spacing)
        if not len(sites.position):
            taken = "every site of it is taken by an earlier fluid" if fitting else "not one particle fits in it"
            raise scene.error(path, f"{taken}, at a spacing of {scene.spacing:g} m")
        _refuse_beyond(scene, path, edges, sites.position)
        placed.append(sites)
        warnings += sites.warnings

    counts = [len(sites.position) for sites in placed]
    volumes = np.array([sites.volume for sites in placed])
    depth = joined([sites.depth * fluid.hydrostatic for fluid, sites in zip(scene.fluids, placed, strict=True)], (0,))
    position = joined([_jittered(scene, i, sites.position) for i, sites in enumerate(placed)])
    refuse_long_zones(scene, position)
    set_back = scene.wall_model.set_back * scene.spacing
    sides = [one.wet_side(position) for one in walls]
    refuse_behind(scene, solids, walls, sides)
    dummies = NO_DUMMIES
    if scene.wall_model.force == "dummy_particles":
        reach = SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
        cut = np.concatenate([sites.cut for sites in placed])
        dummies = place_dummies(scene, walls, sides, position[~cut], reach)
        stood = position
        position = pack(scene, placed, position, dummies, solids)
        depth += np.where(depth > 0.0, stood[:, 2] - position[:, 2], 0.0)
    ground = min((float(points[:, 2].min()) for points in drawn), default=float(position[:, 2].min()))
    warnings += doubts_of(scene, position, counts, walls, drawn, solids, edges, dummies.position)
    del drawn
    samples = [one.set_back(set_back, side).sample(scene.wall_spacing) for one, side in zip(walls, sides, strict=True)]
    for (_, normals, _), side in zip(samples, sides, strict=True):
        normals *= side
    ways = [one.ways_along(points) for one, (points, _, _) in zip(walls, samples, strict=True)]
    places, facing, areas = zip(*samples, strict=True) if walls else ((), (), ())
    before, after = zip(*ways, strict=True) if walls else ((), ())
    placement = Placement(
        position=position,
        velocity=_velocities(scene, position, counts),
        fluid=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        initial_depth=depth,
        volume=volumes,
        wall_position=joined(places),
        wall_normal=joined(facing),
        wall_before=joined(before),
        wall_after=joined(after),
        wall_area=joined(areas, (0,)),
        dummies=dummies,
        sides=tuple(sides),
        solids=tuple(solids),
        ground=ground - (0.0 if walls or not edges else 0.5 * scene.spacing),
        warnings=(),
    )
    if edges and walls:
        placement = _repeat_walls(scene, placement)
    warnings += slow_sound(scene, drop_height(placement), solids)
    return replace(placement, warnings=tuple(warnings))


def _velocities(scene: Scene, position: Array, counts: Sequence[int]) -> Array:
    """Velocity of each particle at the start [m/s], shape [n, 3]; `counts` are the particles of each fluid.

    Where all start alike it is one row that is seen n times, not to be written to.
    """
    given = np.array([u if len(u) == 3 else np.insert(u, 1, 0.0) for u in (fluid.velocity for fluid in scene.fluids)])
    if len(np.unique(given, axis=0)) == 1 and not any(fluid.shear_wave for fluid in scene.fluids):
        return np.broadcast_to(given[0] + 0.0, position.shape)
    velocity = np.repeat(given, counts, axis=0) + 0.0
    ends = np.cumsum(counts).tolist()
    for fluid, count, end in zip(scene.fluids, counts, ends, strict=True):
        if wave := fluid.shear_wave:
            mine = slice(end - count, end)
            velocity[mine, 0] += wave.speed * np.sin(
                2.0 * np.pi * (position[mine, 2] + scene.origin[2]) / wave.wavelength
            )
    return velocity


def _jittered(scene: Scene, index: int, sites: Array) -> Array:
    """Sites of a fluid off their lattice by its jitter, the same on every run, shape [n, 3]."""
    reach = scene.fluids[index].jitter * scene.spacing
    if not reach:
        return sites
    off = np.random.default_rng(index).uniform(-reach, reach, sites.shape)
    return sites + off * ([1.0, 0.0, 1.0] if scene.dimensions == 2 else 1.0)


def _refuse_beyond(scene: Scene, path: str, edges: Sequence[Edge], sites: Array) -> None:
    """Raise SceneError where a fluid reaches beyond a mirror or a periodic edge."""
    for edge in edges:
        inside = sites @ edge.normal - edge.offset
        if inside.min() < -LATTICE_SLACK * scene.spacing:
            lost = int(np.sum(inside < 0.0))
            words = f"{lost} of {len(sites)} particles lie beyond '{edge.name}', the farthest at "
            raise scene.error(path, words + scene.spot(sites[inside.argmin()]))


def _repeat_walls(scene: Scene, placement: Placement) -> Placement:
    """Walls go on beyond mirrors and periodic edges as their images; what was drawn beyond is left out."""
    points = placement.wall_position
    reach = 2.0 * SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
    edges, images = find_images(scene, reach, *around(points, placement.position))

    def inside(x: Array, slack: float) -> NDArray[np.bool_]:
        return np.all([x @ edge.normal - edge.offset >= -slack for edge in edges], axis=0)

    slack = LATTICE_SLACK * scene.spacing
    kept = np.flatnonzero(inside(points, slack))
    taken, turns, seen = [kept], [np.tile(np.eye(3), (len(kept), 1, 1))], [points[kept]]
    for image in images:
        copies = points[kept] @ image.rotation.T + image.translation
        fresh = inside(copies, reach) & ~near(copies, np.concatenate(seen), 0.1 * scene.wall_spacing)
        taken.append(kept[fresh])
        turns.append(np.tile(image.rotation, (int(fresh.sum()), 1, 1)))
        seen.append(copies[fresh])
    index, turn = np.concatenate(taken), np.concatenate(turns)

    def turned(vectors: Array) -> Array:
        return np.einsum("nij,nj->ni", turn, vectors[index])

    return replace(
        placement,
        wall_position=np.concatenate(seen),
        wall_normal=turned(placement.wall_normal),
        wall_before=turned(placement.wall_before),
        wall_after=turned(placement.wall_after),
        wall_area=placement.wall_area[index],
    )


def drop_height(placement: Placement) -> float:
    """How far the highest particle, or body that is free to, can fall [m]."""
    tops = [solid.samples[:, 2].max() for solid in placement.solids if solid.body.motion is None]
    return max(float(max([placement.position[:, 2].max(), *tops])) - placement.ground, 0.0)


def top_speed(velocity: Array) -> float:
    """The greatest length of any `velocity` [m/s], shape [n, 3]."""
    parts = range(0, len(velocity), BLOCK) if velocity.strides[0] else (0,)
    size = BLOCK if velocity.strides[0] else 1
    return max(float(np.linalg.norm(velocity[first : first + size], axis=1).max()) for first in parts)


def typical_speed(scene: Scene, start: Start) -> float:
    """A speed [m/s] for the colours of pictures: of a fall, or, where nothing falls, of the motions that are given."""
    given = [start.top_speed]
    given += [math.hypot(*image.mirror.velocity) for image in scene.images if image.mirror and image.mirror.velocity]
    return 0.7 * math.sqrt(2.0 * scene.gravity * start.drop) or max(given)
