"""From a scene to points: walls sampled evenly, fluids cut from square or cubic lattices, refusals of what cannot be.

Everything here happens once, on the host, in double precision, before a particle is made on a device.

Points are [x, y, z], with y = 0 in a 2-D scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpsph.kernels.smoothing import SMOOTHING
from warpsph.placement.bodies import Solid, place_bodies, refuse_behind, refuse_too_fast
from warpsph.placement.damping import refuse_long_zones
from warpsph.placement.doubts import count_of, distance, doubts_of, slow_sound
from warpsph.placement.drawing import solid, wall_surface
from warpsph.placement.dummies import NO_DUMMIES, Dummies, place_dummies
from warpsph.placement.images import Edge, find_edges, find_images
from warpsph.placement.origin import localised
from warpsph.scene.fluids import Fluid
from warpsph.scene.scene import Scene
from warpsph.shapes.outline import Array
from warpsph.shapes.points import near
from warpsph.shapes.surface import BLOCK, Crate, Frame, Sheet, around, inside_box

Wall = Sheet | Crate

# A point typed to five digits still rests on the slope that it was computed for. In spacings.
CLEARANCE_SLACK = 1e-3
# Sites of two fluids that share a lattice are one spacing apart but for rounding. In spacings.
LATTICE_SLACK = 1e-6
# More points than this are a slip of the spacing, not a scene: they would take tens of GB.
MOST_POINTS = 100_000_000


# ------------------------------------------------------------------------------------------------------------- lattices


def _cell_centres(scene: Scene, path: str, low: Array, high: Array) -> Iterator[Array]:
    """Centres of the unit cells that meet the box from `low` to `high`, row by row, in slabs of shape [n, 3]."""
    first, last = np.floor(low + 1e-9), np.ceil(high - 1e-9)
    _refuse_too_many(scene, path, float(np.prod(np.maximum(last - first, 0.0))))
    x, y, z = (np.arange(a, b) + 0.5 for a, b in zip(first, last, strict=True))
    rows = max(1, BLOCK // max(len(x), 1))  # as many whole rows as a block holds, and as many whole layers
    layers = max(1, rows // max(len(y), 1))
    for k in range(0, len(z), layers):
        for j in range(0, len(y), rows):
            grid = np.meshgrid(z[k : k + layers], y[j : j + rows], x, indexing="ij")
            yield np.stack(grid[::-1], axis=-1).reshape(-1, 3)


def _joined(parts: Sequence[Array], shape: tuple[int, ...] = (0, 3)) -> Array:
    """All `parts` end to end, without a copy where there is one; empty, of `shape`, where there is none."""
    if len(parts) == 1:
        return parts[0]
    return np.concatenate([np.empty(shape), *parts])


def _refuse_too_many(scene: Scene, path: str, points: float) -> None:
    if points > MOST_POINTS:
        words = f"{scene.spacing:g} m is too fine: {path} would take {points:.2g} points, {MOST_POINTS:.0e} is the most"
        raise scene.error("spacing", words)


def _shape_sites(
    scene: Scene, path: str, fluid: Fluid, walls: Sequence[Wall], drawn: Sequence[Array], solids: Sequence[Solid]
) -> tuple[Array, Array, list[str]]:
    """Sites of a shape [n, 3] [m], the column of its own that presses on each [n] [m], and warnings."""
    dx, body = scene.spacing, solid(scene, fluid.shape)
    angle = fluid.lattice.angle if fluid.lattice else 0.0
    origin = body.first_corner()
    if fluid.lattice and fluid.lattice.origin:
        origin[[0, 2] if scene.dimensions == 2 else [0, 1, 2]] = fluid.lattice.origin

    # In the frame of the lattice a site is a triple of halves. A site on the very edge counts as inside at the low
    # sides and as outside at the high ones, whatever the rounding: hence the nudge.
    frame = Frame(origin, angle, dx)
    slabs = _cell_centres(scene, path, *body.bounds(frame))
    sites = _joined([frame.points(cells[body.holds(cells + LATTICE_SLACK, frame)]) for cells in slabs])

    for wall, points in zip(scene.walls, drawn, strict=True):
        within, first = count_of(points, lambda some: body.depth(some) > CLEARANCE_SLACK * dx)
        if within:
            raise scene.error(path, f"wall '{wall.name}' runs through it, at {scene.spot(points[first])}")
    touching, first = count_of(sites, lambda some: distance(walls, some) < (fluid.clearance - CLEARANCE_SLACK) * dx)
    if touching:
        words = f"{touching} of {len(sites)} particles lie closer than {fluid.clearance:g} dx to a wall"
        raise scene.error(path, f"{words}, the first at {scene.spot(sites[first])}")
    for one in solids:
        touching, first = count_of(
            sites, lambda some, one=one: one.contains(some) | (one.distance(some) < (0.5 - CLEARANCE_SLACK) * dx)
        )
        if touching:
            words = f"body '{one.body.name}' lies in it or within half a spacing of it"
            raise scene.error(path, f"{words}, at {scene.spot(sites[first])}")

    warnings = []
    excess = len(sites) * dx**scene.dimensions / body.volume - 1.0 if body.volume else 0.0
    if len(sites) and abs(excess) > 0.05:
        more, lighter = ("more", "lighter") if excess > 0 else ("less", "heavier")
        size = f"{'area' if scene.dimensions == 2 else 'volume'} of {body.volume:.4g} m{scene.dimensions}"
        words = f"{len(sites)} cells of the lattice cover {abs(excess):.1%} {more} than its {size}"
        warnings.append(str(scene.error(path, f"{words}; its particles are made {lighter}")))
    depth = np.empty(len(sites))
    density = scene.materials[fluid.material].density
    for begin in range(0, len(sites), BLOCK):
        some = sites[begin : begin + BLOCK]
        roof = body.roof(some)
        # On a slope the normal part of the weight presses across the normal depth: cos^2 of the vertical column.
        column = (roof - some[:, 2]) * math.cos(math.radians(angle)) ** 2
        for other in scene.fluids:
            if other.fill:
                # Below the water line the water's weight comes on top.
                column += scene.materials[other.material].density / density * np.maximum(other.fill.level - roof, 0.0)
        depth[begin : begin + BLOCK] = column
    return sites, depth, warnings


def _fill_sites(
    scene: Scene, path: str, fluid: Fluid, walls: Sequence[Wall], drawn: Sequence[Array], solids: Sequence[Solid]
) -> tuple[Array, Array, list[str]]:
    """Sites of a fill [n, 3] [m], the depth of each below the level [n] [m], and warnings."""
    fill, dx = fluid.fill, scene.spacing
    index = [wall.name for wall in scene.walls].index(fill.above)
    bed, drawn = walls[index], drawn[index]
    low, high = fill.between or (-math.inf, math.inf)
    wet = drawn[(drawn[:, 0] >= low - dx) & (drawn[:, 0] <= high + dx) & (drawn[:, 2] < fill.level)]
    if not len(wet):
        x, _, z = scene.origin
        where = f" between {low + x:.12g} and {high + x:.12g} m" if fill.between else ""
        raise scene.error(path, f"'{fill.above}' is nowhere below the level {fill.level + z:.12g} m{where}")
    left, right = max(low, wet[:, 0].min()), min(high, wet[:, 0].max())
    front, back = (wet[:, 1].min(), wet[:, 1].max()) if scene.dimensions == 3 else (-0.5 * dx, 0.5 * dx)
    floor = wet[:, 2].min()

    # Rows start half a spacing above the lowest bed, and half a spacing off the front. Columns start half a spacing off
    # an upright end wall, the left one if there are two, or else off the left limit.
    upright = [any(one.is_upright(x, fill.level) for one in walls) for x in (left, right)]
    start = right - math.ceil((right - left) / dx - LATTICE_SLACK) * dx if upright == [False, True] else left
    corner = np.array([start, front, floor])
    last = np.array([right, back, fill.level]) - LATTICE_SLACK * dx
    # The inside of an obstacle stays dry; a closed wall around the bed is no obstacle.
    middle = drawn[[len(drawn) // 2]]
    dry = [one for one in walls if one.closed and one is not bed and not one.contains(middle)[0]]
    parts = []
    for cells in _cell_centres(scene, path, np.zeros(3), (last - corner) / dx):
        sites = corner + dx * cells
        sites = sites[inside_box(sites, np.array([left, front, floor]), last)]
        sites = sites[bed.carries(sites, fill.level)]
        for one in [*dry, *solids]:  # bodies displace it
            sites = sites[~one.contains(sites)]
        parts.append(sites[distance([*walls, *solids], sites) > (fluid.clearance - CLEARANCE_SLACK) * dx])
    sites = _joined(parts)

    openings = bed.openings(fill.level, 0.5 * dx)
    is_open = near(openings, sites, 1.5 * dx) & (distance(walls, openings) > dx)
    if is_open.any():
        words = f"it would leak at {scene.spot(openings[is_open][0])}"
        raise scene.error(
            path, f"{words}: '{fill.above}' ends there, below the level {fill.level + scene.origin[2]:.12g} m"
        )

    warnings = []
    sizes = {"depth": fill.level - floor}
    if all(upright):
        sizes["width" if scene.dimensions == 2 else "length"] = right - left
    if scene.dimensions == 3:
        sizes["width"] = back - front
    for name, size in sizes.items():
        if abs(size / dx - round(size / dx)) > 0.02:
            words = f"its {name} of {size:.4g} m is {size / dx:.2f} spacings; a whole number of them leaves no gap"
            warnings.append(str(scene.error(path, words)))
    return sites, fill.level - sites[:, 2], warnings


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
            the lattice in a fill, and in a shape its volume shared out, so that the mass is that of the drawing.
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
        """How many particles each fluid has; those of one fluid follow each other."""
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
    _refuse_too_many(scene, "walls", sum(one.area for one in walls) / scene.wall_spacing ** (scene.dimensions - 1))
    drawn = [one.sample(scene.wall_spacing)[0] for one in walls]
    solids = place_bodies(scene, drawn)
    refuse_too_fast(scene, solids)
    edges, _ = find_edges(scene)
    warnings: list[str] = []
    placed: list[Array] = []
    depths: list[Array] = []
    volumes: list[float] = []
    for i, fluid in enumerate(scene.fluids):
        path = f"fluids[{i}].{'shape' if fluid.shape else 'fill'}"
        sites, depth, doubts = (
            _shape_sites(scene, path, fluid, walls, drawn, solids)
            if fluid.shape
            else _fill_sites(scene, path, fluid, walls, drawn, solids)
        )
        all_count = len(sites)
        for earlier in placed:
            free = ~near(sites, earlier, (1.0 - LATTICE_SLACK) * scene.spacing)
            if not free.all():
                sites, depth = sites[free], depth[free]
        if not len(sites):
            taken = "every site of it is taken by an earlier fluid" if all_count else "not one particle fits in it"
            raise scene.error(path, f"{taken}, at a spacing of {scene.spacing:g} m")
        _refuse_beyond(scene, path, edges, sites)
        placed.append(sites)
        depths.append(depth if fluid.hydrostatic else np.zeros(len(sites)))
        cell = scene.spacing**scene.dimensions
        volumes.append(solid(scene, fluid.shape).volume / all_count if fluid.shape else cell)
        warnings += doubts

    counts = [len(sites) for sites in placed]
    position = _joined([_jittered(scene, i, sites) for i, sites in enumerate(placed)])
    del placed, sites, depth
    refuse_long_zones(scene, position)
    set_back = scene.wall_model.set_back * scene.spacing
    sides = [one.wet_side(position) for one in walls]
    refuse_behind(scene, solids, walls, sides)
    dummies = NO_DUMMIES
    if scene.wall_model.force == "dummy_particles":
        reach = SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
        dummies = place_dummies(scene, walls, sides, position, reach)
    ground = min((float(points[:, 2].min()) for points in drawn), default=float(position[:, 2].min()))
    warnings += doubts_of(scene, position, counts, walls, drawn, solids, edges)
    del drawn
    samples = [one.set_back(set_back, side).sample(scene.wall_spacing) for one, side in zip(walls, sides, strict=True)]
    for (_, normals, _), side in zip(samples, sides, strict=True):
        normals *= side
    ways = [one.ways_along(points) for one, (points, _, _) in zip(walls, samples, strict=True)]
    points, normals, areas = zip(*samples, strict=True) if walls else ((), (), ())
    before, after = zip(*ways, strict=True) if walls else ((), ())
    placement = Placement(
        position=position,
        velocity=_velocities(scene, position, counts),
        fluid=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        initial_depth=_joined(depths, (0,)),
        volume=np.array(volumes),
        wall_position=_joined(points),
        wall_normal=_joined(normals),
        wall_before=_joined(before),
        wall_after=_joined(after),
        wall_area=_joined(areas, (0,)),
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
    given = [
        fluid.velocity if len(fluid.velocity) == 3 else np.insert(fluid.velocity, 1, 0.0) for fluid in scene.fluids
    ]
    if len(np.unique(given, axis=0)) == 1 and not any(fluid.shear_wave for fluid in scene.fluids):
        return np.broadcast_to(np.array(given[0]) + 0.0, position.shape)
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
    """A speed [m/s] for the colours of pictures: that of a fall, or, where nothing falls, of what is given to move."""
    given = [start.top_speed]
    given += [math.hypot(*image.mirror.velocity) for image in scene.images if image.mirror and image.mirror.velocity]
    return 0.7 * math.sqrt(2.0 * scene.gravity * start.drop) or max(given)
