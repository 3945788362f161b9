"""From a scene to points: walls sampled evenly, fluids cut from square or cubic lattices, refusals of what cannot be.

Everything here happens once, on the host, in double precision, before a particle is made on a device.

Points are [x, y, z], with y = 0 in a 2-D scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from warpsph.kernels.smoothing import SMOOTHING
from warpsph.placement.bodies import Solid, place_bodies, refuse_behind
from warpsph.placement.images import Edge, find_edges, find_images
from warpsph.scene.fluids import Fluid
from warpsph.scene.scene import Scene
from warpsph.shapes.outline import Array
from warpsph.shapes.surface import Crate, Frame, Sheet, solid, wall_surface

Wall = Sheet | Crate

# A point typed to five digits still rests on the slope that it was computed for. In spacings.
CLEARANCE_SLACK = 1e-3
# Sites of two fluids that share a lattice are one spacing apart but for rounding. In spacings.
LATTICE_SLACK = 1e-6
# More points than this are a slip of the spacing, not a scene: they would take tens of GB.
MOST_POINTS = 100_000_000


# ------------------------------------------------------------------------------------------------------------- lattices


def near(points: Array, others: Array, reach: float) -> NDArray[np.bool_]:
    """Whether each of `points` [n, 3] is closer than `reach` [m] to any of `others` [k, 3], shape [n]."""
    found = np.zeros(len(points), dtype=bool)
    if not len(points) or not len(others):
        return found
    # Cells of edge `reach` numbered row by row with a margin of one, so that a neighbour is never a wrap-around.
    low = np.minimum(points.min(axis=0), others.min(axis=0))
    cell = np.floor((points - low) / reach).astype(np.int64) + 1
    other_cell = np.floor((others - low) / reach).astype(np.int64) + 1
    _, *rows = np.maximum(cell.max(axis=0), other_cell.max(axis=0)) + 2
    weight = np.array([math.prod(rows[axis:]) for axis in range(len(rows) + 1)])
    other_key = other_cell @ weight
    order = np.argsort(other_key, kind="stable")
    other_key, others = other_key[order], others[order]
    for step in product((-1, 0, 1), repeat=len(weight)):
        key = (cell + step) @ weight
        first = np.searchsorted(other_key, key, side="left")
        count = np.searchsorted(other_key, key, side="right") - first
        for k in range(count.max()):
            rows = np.flatnonzero((count > k) & ~found)
            gap = points[rows] - others[first[rows] + k]
            found[rows] = np.einsum("ij,ij->i", gap, gap) < reach**2
    return found


def _cell_centres(scene: Scene, path: str, low: Array, high: Array) -> Array:
    """Centres of the unit cells that meet the box from `low` to `high`, row by row, shape [n, 3]."""
    first, last = np.floor(low + 1e-9), np.ceil(high - 1e-9)
    _refuse_too_many(scene, path, float(np.prod(last - first)))
    x, y, z = (np.arange(a, b) + 0.5 for a, b in zip(first, last, strict=True))
    return np.stack(np.meshgrid(z, y, x, indexing="ij")[::-1], axis=-1).reshape(-1, 3)


def _refuse_too_many(scene: Scene, path: str, points: float) -> None:
    if points > MOST_POINTS:
        words = f"{scene.spacing:g} m is too fine: {path} would take {points:.2g} points, {MOST_POINTS:.0e} is the most"
        raise scene.error("spacing", words)


def _spot(scene: Scene, point: Array) -> str:
    """Where a point is, in words."""
    axes = "xz" if scene.dimensions == 2 else "xyz"
    return ", ".join(f"{axis} = {point['xyz'.index(axis)]:.4g} m" for axis in axes)


def _shape_sites(
    scene: Scene, path: str, fluid: Fluid, walls: Sequence[Wall], solids: Sequence[Solid]
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
    cells = _cell_centres(scene, path, *body.bounds(frame))
    sites = frame.points(cells[body.holds(cells + LATTICE_SLACK, frame)])

    for wall, one in zip(scene.walls, walls, strict=True):
        points = one.sample(scene.wall_spacing)[0]
        within = body.depth(points) > CLEARANCE_SLACK * dx
        if within.any():
            raise scene.error(path, f"wall '{wall.name}' runs through it, at {_spot(scene, points[within][0])}")
    touching = np.flatnonzero(_distance(walls, sites) < (fluid.clearance - CLEARANCE_SLACK) * dx)
    if len(touching):
        words = f"{len(touching)} of {len(sites)} particles lie closer than {fluid.clearance:g} dx to a wall"
        raise scene.error(path, f"{words}, the first at {_spot(scene, sites[touching[0]])}")
    for one in solids:
        touching = np.flatnonzero(one.contains(sites) | (one.distance(sites) < (0.5 - CLEARANCE_SLACK) * dx))
        if len(touching):
            words = f"body '{one.body.name}' lies in it or within half a spacing of it"
            raise scene.error(path, f"{words}, at {_spot(scene, sites[touching[0]])}")

    warnings = []
    excess = len(sites) * dx**scene.dimensions / body.volume - 1.0 if body.volume else 0.0
    if len(sites) and abs(excess) > 0.05:
        more, lighter = ("more", "lighter") if excess > 0 else ("less", "heavier")
        size = f"{'area' if scene.dimensions == 2 else 'volume'} of {body.volume:.4g} m{scene.dimensions}"
        words = f"{len(sites)} cells of the lattice cover {abs(excess):.1%} {more} than its {size}"
        warnings.append(str(scene.error(path, f"{words}; its particles are made {lighter}")))
    roof = body.roof(sites)
    # On a slope the normal part of the weight presses across the normal depth: cos^2 of the vertical column.
    depth = (roof - sites[:, 2]) * math.cos(math.radians(angle)) ** 2
    density = scene.materials[fluid.material].density
    for other in scene.fluids:
        if other.fill:
            # Below the water line the water's weight comes on top.
            depth += scene.materials[other.material].density / density * np.maximum(other.fill.level - roof, 0.0)
    return sites, depth, warnings


def _fill_sites(
    scene: Scene, path: str, fluid: Fluid, walls: Sequence[Wall], solids: Sequence[Solid]
) -> tuple[Array, Array, list[str]]:
    """Sites of a fill [n, 3] [m], the depth of each below the level [n] [m], and warnings."""
    fill, dx = fluid.fill, scene.spacing
    bed = walls[[wall.name for wall in scene.walls].index(fill.above)]
    low, high = fill.between or (-math.inf, math.inf)
    drawn = bed.sample(scene.wall_spacing)[0]
    wet = drawn[(drawn[:, 0] >= low - dx) & (drawn[:, 0] <= high + dx) & (drawn[:, 2] < fill.level)]
    if not len(wet):
        where = f" between {low:g} and {high:g} m" if fill.between else ""
        raise scene.error(path, f"'{fill.above}' is nowhere below the level {fill.level:g} m{where}")
    left, right = max(low, wet[:, 0].min()), min(high, wet[:, 0].max())
    front, back = (wet[:, 1].min(), wet[:, 1].max()) if scene.dimensions == 3 else (-0.5 * dx, 0.5 * dx)
    floor = wet[:, 2].min()

    # Rows start half a spacing above the lowest bed, and half a spacing off the front. Columns start half a spacing off
    # an upright end wall, the left one if there are two, or else off the left limit.
    upright = [any(one.is_upright(x, fill.level) for one in walls) for x in (left, right)]
    start = right - math.ceil((right - left) / dx - LATTICE_SLACK) * dx if upright == [False, True] else left
    corner = np.array([start, front, floor])
    last = np.array([right, back, fill.level]) - LATTICE_SLACK * dx
    sites = corner + dx * _cell_centres(scene, path, np.zeros(3), (last - corner) / dx)
    sites = sites[np.all((sites > [left, front, floor]) & (sites < last), axis=1)]

    sites = sites[bed.carries(sites, fill.level)]
    for obstacle in walls:
        # The inside of an obstacle stays dry; a closed wall around the bed is no obstacle.
        if obstacle.closed and obstacle is not bed and not obstacle.contains(drawn[[len(drawn) // 2]])[0]:
            sites = sites[~obstacle.contains(sites)]
    for one in solids:
        sites = sites[~one.contains(sites)]  # displaced
    sites = sites[_distance([*walls, *solids], sites) > (fluid.clearance - CLEARANCE_SLACK) * dx]

    openings = bed.openings(fill.level, 0.5 * dx)
    is_open = near(openings, sites, 1.5 * dx) & (_distance(walls, openings) > dx)
    if is_open.any():
        words = f"it would leak at {_spot(scene, openings[is_open][0])}"
        raise scene.error(path, f"{words}: '{fill.above}' ends there, below the level {fill.level:g} m")

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
    """Every point of a scene at the start, fluids in the order of `scene.fluids`.

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
    sides: tuple[int, ...]
    solids: tuple[Solid, ...]
    ground: float
    warnings: tuple[str, ...]


def place(scene: Scene) -> Placement:
    """Sample the walls and set out the fluids of `scene`.

    Raises SceneError for what cannot be: an empty fluid, a shape on top of a wall, a fill that leaks, a corner too
    tight for its radius, a speed of sound too low for the drop.
    """
    walls = [wall_surface(scene, i) for i in range(len(scene.walls))]
    _refuse_too_many(scene, "walls", sum(one.area for one in walls) / scene.wall_spacing ** (scene.dimensions - 1))
    solids = place_bodies(scene, walls)
    edges, _ = find_edges(scene)
    warnings: list[str] = []
    placed: list[Array] = []
    depths: list[Array] = []
    volumes: list[float] = []
    for i, fluid in enumerate(scene.fluids):
        path = f"fluids[{i}].{'shape' if fluid.shape else 'fill'}"
        sites, depth, doubts = (
            _shape_sites(scene, path, fluid, walls, solids)
            if fluid.shape
            else _fill_sites(scene, path, fluid, walls, solids)
        )
        free = np.ones(len(sites), dtype=bool)
        for earlier in placed:
            free &= ~near(sites, earlier, (1.0 - LATTICE_SLACK) * scene.spacing)
        if not free.any():
            taken = "every site of it is taken by an earlier fluid" if len(sites) else "not one particle fits in it"
            raise scene.error(path, f"{taken}, at a spacing of {scene.spacing:g} m")
        _refuse_beyond(scene, path, edges, sites)
        placed.append(sites[free])
        depths.append(depth[free] * fluid.hydrostatic)
        cell = scene.spacing**scene.dimensions
        volumes.append(solid(scene, fluid.shape).volume / len(sites) if fluid.shape else cell)
        warnings += doubts

    position = np.concatenate([_jittered(scene, i, sites) for i, sites in enumerate(placed)])
    set_back = scene.wall_model.set_back * scene.spacing
    sides = [one.wet_side(position) for one in walls]
    refuse_behind(scene, solids, walls, sides)
    samples = [one.set_back(set_back, side).sample(scene.wall_spacing) for one, side in zip(walls, sides, strict=True)]
    drawn = np.concatenate([one.sample(scene.wall_spacing)[0] for one in walls]) if walls else position
    velocity = [
        fluid.velocity if len(fluid.velocity) == 3 else np.insert(fluid.velocity, 1, 0.0) for fluid in scene.fluids
    ]
    counts = [len(sites) for sites in placed]
    ways = [one.ways_along(points) for one, (points, _, _) in zip(walls, samples, strict=True)]
    nowhere = np.empty((0, 3))  # a scene may have no walls
    placement = Placement(
        position=position,
        velocity=np.repeat(velocity, counts, axis=0) + _waves(scene, position, counts),
        fluid=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        initial_depth=np.concatenate(depths),
        volume=np.array(volumes),
        wall_position=np.concatenate([nowhere, *(points for points, _, _ in samples)]),
        wall_normal=np.concatenate([nowhere, *(n * side for (_, n, _), side in zip(samples, sides, strict=True))]),
        wall_before=np.concatenate([nowhere, *(before for before, _ in ways)]),
        wall_after=np.concatenate([nowhere, *(after for _, after in ways)]),
        wall_area=np.concatenate([np.empty(0), *(areas for _, _, areas in samples)]),
        sides=tuple(sides),
        solids=tuple(solids),
        ground=float(drawn[:, 2].min()) - (0.0 if walls or not edges else 0.5 * scene.spacing),
        warnings=(),
    )
    if edges and walls:
        placement = _repeat_walls(scene, placement)
    warnings += _doubts(scene, placement, drawn, edges) + _slow_sound(scene, drop_height(placement))
    return replace(placement, warnings=tuple(warnings))


def _waves(scene: Scene, position: Array, counts: Sequence[int]) -> Array:
    """Velocity of the shear waves at each place, shape [n, 3]; `counts` are the particles of each fluid."""
    velocity = np.zeros_like(position)
    for fluid, mine in zip(scene.fluids, np.split(np.arange(len(position)), np.cumsum(counts)[:-1]), strict=True):
        if wave := fluid.shear_wave:
            velocity[mine, 0] = wave.speed * np.sin(2.0 * np.pi * position[mine, 2] / wave.wavelength)
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
            raise scene.error(path, words + _spot(scene, sites[inside.argmin()]))


def _repeat_walls(scene: Scene, placement: Placement) -> Placement:
    """Walls go on beyond mirrors and periodic edges as their images; what was drawn beyond is left out."""
    points = placement.wall_position
    reach = 2.0 * SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
    everything = np.concatenate([points, placement.position])
    edges, images = find_images(scene, reach, everything.min(axis=0), everything.max(axis=0))

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


def behind_walls(placement: Placement, position: Array) -> NDArray[np.bool_]:
    """Whether each particle at `position` [m], shape [n, 3], is on the far side of its nearest wall point, [n]."""
    behind = np.zeros(len(position), dtype=bool)
    count = max(1, 4_000_000 // max(len(placement.wall_position), 1))  # at a time, for the sake of memory
    for first in range(0, len(position), count):
        some = position[first : first + count]
        nearest = np.argmin(((some[:, None] - placement.wall_position) ** 2).sum(axis=2), axis=1)
        side = np.einsum("ij,ij->i", some - placement.wall_position[nearest], placement.wall_normal[nearest])
        behind[first : first + count] = side < 0.0
    return behind


def drop_height(placement: Placement) -> float:
    """How far the highest particle, or body that is free to, can fall [m]."""
    tops = [solid.samples[:, 2].max() for solid in placement.solids if solid.body.motion is None]
    return max(float(max([placement.position[:, 2].max(), *tops])) - placement.ground, 0.0)


def typical_speed(scene: Scene, placement: Placement) -> float:
    """A speed [m/s] for the colours of pictures: that of a fall, or, where nothing falls, of what is given to move."""
    given = [float(np.linalg.norm(placement.velocity, axis=1).max())]
    given += [math.hypot(*image.mirror.velocity) for image in scene.images if image.mirror and image.mirror.velocity]
    return 0.7 * math.sqrt(2.0 * scene.gravity * drop_height(placement)) or max(given)


def _slow_sound(scene: Scene, drop: float) -> list[str]:
    """Warnings about every material whose speed of sound is low for a fall through `drop` [m].

    Density strays by about the square of the Mach number: 4 % at a fifth of the speed of sound, 1 % at a tenth.
    Raises SceneError below five times that speed, unless the scene allows "low_sound_speed".
    """
    warnings = []
    for name, material in scene.materials.items():
        starts = [math.hypot(*fluid.velocity) for fluid in scene.fluids if fluid.material == name]
        if not starts:
            continue
        starts += [math.hypot(*body.velocity) for body in scene.bodies if body.velocity]
        speed = math.sqrt(2.0 * scene.gravity * drop + max(starts) ** 2)
        if material.sound_speed >= 7.0 * speed:
            continue
        is_refused = material.sound_speed < 5.0 * speed
        least = _round_up(5.0 * speed)
        error = scene.error(
            f"materials.{name}.sound_speed",
            f"{material.sound_speed:g} m/s is {'too ' if is_refused else ''}low for a drop of {drop:.3g} m"
            f"{f' begun at {max(starts):.3g} m/s' if max(starts) else ''}; "
            f"at least {least:g} m/s is needed (and {2 * least:g} advised)",
        )
        if is_refused and "low_sound_speed" not in scene.allow:
            raise error
        warnings.append(str(error))
    return warnings


def _doubts(scene: Scene, placement: Placement, drawn: Array, edges: Sequence[Edge]) -> list[str]:
    """Warnings about what can be run but was hardly meant; `drawn` are points on the walls [m], shape [n, 3]."""
    doubts = []
    if scene.warm_up is None:
        for i, fluid in enumerate(scene.fluids):
            if fluid.hold:
                doubts.append(scene.error(f"fluids[{i}].hold", "there is no warm_up to hold it through"))
    for i, gauge in enumerate(scene.gauges):
        x, reach = np.array([gauge.x, gauge.y or 0.0, 0.0]), 2.0 * scene.smoothing_length
        for edge in edges:
            if abs(edge.normal[2]) < 1e-9 and x @ edge.normal - edge.offset < reach:
                words = f"stands closer than 2 h = {reach:.3g} m to '{edge.name}', beyond which it sees no fluid"
                doubts.append(scene.error(f"gauges[{i}]", words))
    if scene.walls:
        falling = _without_ground(placement.position, drawn, scene.spacing)
        for i in np.unique(placement.fluid[falling]):
            lost = np.flatnonzero(falling & (placement.fluid == i))
            first = _spot(scene, placement.position[lost[0]])
            words = f"{len(lost)} particles have no wall below them, the first at {first}"
            doubts.append(scene.error(f"fluids[{i}]", words))
        low, high = drawn.min(axis=0), drawn.max(axis=0)
        for i, gauge in enumerate(scene.gauges):
            for axis, place in {0: gauge.x, 1: gauge.y or 0.0}.items():
                if not low[axis] <= place <= high[axis]:
                    reach = f"which reach from {low[axis]:g} to {high[axis]:g} m"
                    doubts.append(
                        scene.error(f"gauges[{i}].{'xy'[axis]}", f"{place:g} m lies beyond the walls, {reach}")
                    )
    return [str(doubt) for doubt in doubts]


def _without_ground(sites: Array, drawn: Array, spacing: float) -> NDArray[np.bool_]:
    """Whether no wall lies straight below each of `sites` [n, 3], to within one spacing, shape [n]."""
    corner = drawn[:, :2].min(axis=0)
    column = np.floor((drawn[:, :2] - corner) / spacing).astype(np.int64)
    # One empty column more on every side, so that all neighbours of every column exist.
    lowest = np.full(column.max(axis=0) + 3, np.inf)
    np.minimum.at(lowest, tuple(column.T + 1), drawn[:, 2])
    wide, deep = np.array(lowest.shape) - 2
    around = np.min([lowest[i : i + wide, k : k + deep] for i in range(3) for k in range(3)], axis=0)
    place = np.floor((sites[:, :2] - corner) / spacing).astype(np.int64)
    beyond = np.any((place < 0) | (place >= [wide, deep]), axis=1)
    i, k = np.clip(place, 0, [wide - 1, deep - 1]).T
    return beyond | (sites[:, 2] < around[i, k])


def _round_up(value: float) -> float:
    """The next number of three digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.ceil(value / unit - 1e-9) * unit


def _distance(walls: Sequence[Wall | Solid], points: Array) -> Array:
    """Distance from each of `points` [n, 3] to the nearest wall [m], shape [n]."""
    return np.min([np.full(len(points), np.inf), *(one.distance(points) for one in walls)], axis=0)
