"""From a scene to points: wall lines sampled evenly, fluids cut from square lattices, and refusals of what cannot be.

Everything here happens once, on the host, in double precision, before a particle is made on a device.

Plane points are [x, z]; what leaves in a `Placement` is [x, y, z] with y = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpsph.outline import Array, Line, Outline, closed_outline, wall_outline
from warpsph.scene import Fluid, Scene

# A point typed to five digits still rests on the slope that it was computed for. In spacings.
CLEARANCE_SLACK = 1e-3
# Sites of two fluids that share a lattice are one spacing apart but for rounding. In spacings.
LATTICE_SLACK = 1e-6
# More points than this are a slip of the spacing, not a scene: they would take tens of GB.
MOST_POINTS = 100_000_000


# ------------------------------------------------------------------------------------------------------------- lattices


def contains(polygon: Array, points: Array) -> NDArray[np.bool_]:
    """Whether each of `points` [n, 2] lies inside `polygon` [k, 2] by the even-odd rule, shape [n]."""
    inside = np.zeros(len(points), dtype=bool)
    x, z = points[:, 0], points[:, 1]
    for (ax, az), (bx, bz) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if az != bz:
            inside ^= ((az > z) != (bz > z)) & (x < ax + (z - az) * (bx - ax) / (bz - az))
    return inside


def near(points: Array, others: Array, reach: float) -> NDArray[np.bool_]:
    """Whether each of `points` [n, 2] is closer than `reach` [m] to any of `others` [k, 2], shape [n]."""
    found = np.zeros(len(points), dtype=bool)
    if not len(points) or not len(others):
        return found
    # Cells of edge `reach` numbered row by row with a margin of one, so that a neighbour is never a wrap-around.
    low = np.minimum(points.min(axis=0), others.min(axis=0))
    cell = np.floor((points - low) / reach).astype(np.int64) + 1
    other_cell = np.floor((others - low) / reach).astype(np.int64) + 1
    row = max(cell[:, 1].max(), other_cell[:, 1].max()) + 2
    other_key = other_cell[:, 0] * row + other_cell[:, 1]
    order = np.argsort(other_key, kind="stable")
    other_key, others = other_key[order], others[order]
    for step in (-row - 1, -row, -row + 1, -1, 0, 1, row - 1, row, row + 1):
        key = cell[:, 0] * row + cell[:, 1] + step
        first = np.searchsorted(other_key, key, side="left")
        count = np.searchsorted(other_key, key, side="right") - first
        for k in range(count.max()):
            rows = np.flatnonzero((count > k) & ~found)
            gap = points[rows] - others[first[rows] + k]
            found[rows] = np.einsum("ij,ij->i", gap, gap) < reach**2
    return found


def _turned(points: ArrayLike, angle: float) -> Array:
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return np.asarray(points, dtype=float) @ np.array([[c, s], [-s, c]])


def _cell_centres(scene: Scene, path: str, low: Array, high: Array) -> Array:
    """Centres of the unit cells that meet the rectangle from `low` to `high`, row by row, shape [n, 2]."""
    first, last = np.floor(low - 1e-9), np.ceil(high + 1e-9)
    _refuse_too_many(scene, path, float(np.prod(last - first)))
    x, z = (np.arange(a, b) + 0.5 for a, b in zip(first, last, strict=True))
    return np.stack([np.tile(x, len(z)), np.repeat(z, len(x))], axis=1)


def _refuse_too_many(scene: Scene, path: str, points: float) -> None:
    if points > MOST_POINTS:
        words = f"{scene.spacing:g} m is too fine: {path} would take {points:.2g} points, {MOST_POINTS:.0e} is the most"
        raise scene.error("spacing", words)


def _shape_sites(scene: Scene, path: str, fluid: Fluid, outlines: Sequence[Outline]) -> tuple[Array, Array, list[str]]:
    """Sites of a shape [n, 2] [m], the column of its own that presses on each [n] [m], and warnings."""
    shape, dx = fluid.shape, scene.spacing
    edge = closed_outline(shape)
    border = edge.polygon()
    angle = fluid.lattice.angle if fluid.lattice else 0.0
    origin = np.array(fluid.lattice.origin if fluid.lattice and fluid.lattice.origin else border[0])

    # In the frame of the lattice, in spacings, a site is a pair of halves. A site on the very edge counts as inside at
    # the low sides and as outside at the high ones, whatever the rounding: hence the nudge.
    drawn = _turned(border - origin, -angle) / dx
    cells = _cell_centres(scene, path, drawn.min(axis=0), drawn.max(axis=0))
    sites = origin + _turned(cells[contains(drawn, cells + LATTICE_SLACK)] * dx, angle)

    for wall, one in zip(scene.walls, outlines, strict=True):
        points = one.sample(scene.wall_spacing)[0]
        within = contains(border, points) & (edge.distance(points) > CLEARANCE_SLACK * dx)
        if within.any():
            x, z = points[within][0]
            raise scene.error(path, f"wall '{wall.name}' runs through it, at x = {x:.4g} m, z = {z:.4g} m")
    touching = np.flatnonzero(_distance(outlines, sites) < (fluid.clearance - CLEARANCE_SLACK) * dx)
    if len(touching):
        x, z = sites[touching[0]]
        words = f"{len(touching)} of {len(sites)} particles lie closer than {fluid.clearance:g} dx to a wall"
        raise scene.error(path, f"{words}, the first at x = {x:.4g} m, z = {z:.4g} m")

    warnings = []
    area = _shape_area(scene, fluid)
    excess = len(sites) * dx**2 / area - 1.0 if area else 0.0
    if len(sites) and abs(excess) > 0.05:
        more, lighter = ("more", "lighter") if excess > 0 else ("less", "heavier")
        words = f"{len(sites)} cells of the lattice cover {abs(excess):.1%} {more} than its area of {area:.4g} m2"
        warnings.append(str(scene.error(path, f"{words}; its particles are made {lighter}")))
    roof = _roof(border, sites)
    # On a slope the normal part of the weight presses across the normal depth: cos^2 of the vertical column.
    depth = (roof - sites[:, 1]) * math.cos(math.radians(angle)) ** 2
    density = scene.materials[fluid.material].density
    for other in scene.fluids:
        if other.fill:
            # Below the water line the water's weight comes on top.
            depth += scene.materials[other.material].density / density * np.maximum(other.fill.level - roof, 0.0)
    return sites, depth, warnings


def _shape_area(scene: Scene, fluid: Fluid) -> float:
    """Area of a fluid's shape [m2]."""
    if fluid.shape.disc:
        return math.pi * fluid.shape.disc.radius**2
    return _area(closed_outline(fluid.shape).polygon())


def _area(polygon: Array) -> float:
    """Area that a polygon [k, 2] encloses [m2]."""
    x, z = polygon.T
    return abs(float(np.sum(x * np.roll(z, -1) - z * np.roll(x, -1)))) / 2


def _roof(border: Array, sites: Array) -> Array:
    """Height of the first edge of `border` straight above each of `sites` [m], shape [n]."""
    roof = np.full(len(sites), np.inf)
    x, z = sites[:, 0], sites[:, 1]
    for (ax, az), (bx, bz) in zip(border, np.roll(border, -1, axis=0), strict=True):
        if ax != bx:
            height = az + (x - ax) * (bz - az) / (bx - ax)
            over = ((ax > x) != (bx > x)) & (height >= z)
            roof[over] = np.minimum(roof, height)[over]
    return np.where(np.isfinite(roof), roof, z)


def _fill_sites(scene: Scene, path: str, fluid: Fluid, outlines: Sequence[Outline]) -> tuple[Array, Array, list[str]]:
    """Sites of a fill [n, 2] [m], the depth of each below the level [n] [m], and warnings."""
    fill, dx = fluid.fill, scene.spacing
    bed = outlines[[wall.name for wall in scene.walls].index(fill.above)]
    low, high = fill.between or (-math.inf, math.inf)
    line = bed.sample(scene.wall_spacing)[0]
    wet = line[(line[:, 0] >= low - dx) & (line[:, 0] <= high + dx) & (line[:, 1] < fill.level)]
    if not len(wet):
        where = f" between {low:g} and {high:g} m" if fill.between else ""
        raise scene.error(path, f"'{fill.above}' is nowhere below the level {fill.level:g} m{where}")
    left, right = max(low, wet[:, 0].min()), min(high, wet[:, 0].max())
    floor = wet[:, 1].min()

    # Rows start half a spacing above the lowest bed. Columns start half a spacing off an upright end wall, the left
    # one if there are two, or else off the left limit.
    upright = [_stands_upright(outlines, x, fill.level) for x in (left, right)]
    start = right - math.ceil((right - left) / dx - LATTICE_SLACK) * dx if upright == [False, True] else left
    corner = np.array([start, floor])
    last = np.array([right, fill.level]) - LATTICE_SLACK * dx
    sites = corner + dx * _cell_centres(scene, path, np.zeros(2), (last - corner) / dx)
    sites = sites[np.all((sites > [left, floor]) & (sites < last), axis=1)]

    basin = bed.polygon()
    if not bed.closed:
        # The sky closes the path: straight up from both of its ends.
        sky = max(fill.level, basin[:, 1].max()) + dx
        basin = np.concatenate([basin, [[basin[-1, 0], sky], [basin[0, 0], sky]]])
    sites = sites[contains(basin, sites)]
    for obstacle in outlines:
        # The inside of an obstacle stays dry; a closed wall around the bed is no obstacle.
        if obstacle.closed and obstacle is not bed and not contains(obstacle.polygon(), line[[len(line) // 2]])[0]:
            sites = sites[~contains(obstacle.polygon(), sites)]
    sites = sites[_distance(outlines, sites) > (fluid.clearance - CLEARANCE_SLACK) * dx]
    _refuse_leak(scene, path, fluid, bed, outlines, sites)

    warnings = []
    for name, size in {"depth": fill.level - floor, **({"width": right - left} if all(upright) else {})}.items():
        if abs(size / dx - round(size / dx)) > 0.02:
            words = f"its {name} of {size:.4g} m is {size / dx:.2f} spacings; a whole number of them leaves no gap"
            warnings.append(str(scene.error(path, words)))
    return sites, fill.level - sites[:, 1], warnings


def _stands_upright(outlines: Sequence[Outline], x: float, level: float) -> bool:
    """Whether an upright straight leg of some wall stands in the fluid at `x`."""
    return any(
        isinstance(leg, Line)
        and np.allclose([leg.start[0], leg.end[0]], x, rtol=0.0, atol=1e-9)
        and min(leg.start[1], leg.end[1]) < level
        for one in outlines
        for leg in one.legs
    )


def _refuse_leak(
    scene: Scene, path: str, fluid: Fluid, bed: Outline, outlines: Sequence[Outline], sites: Array
) -> None:
    """Refuse a fill that stands beside the open space over an end of its bed."""
    dx, level = scene.spacing, fluid.fill.level
    ends = [] if bed.closed else [bed.legs[0].points(np.zeros(1))[0], bed.legs[-1].points(np.ones(1))[0]]
    for x, z in ends:
        heights = np.arange(z, level, 0.5 * dx)
        side = np.stack([np.full(len(heights), x), heights], axis=1)
        is_open = near(side, sites, 1.5 * dx) & (_distance(outlines, side) > dx)
        if is_open.any():
            words = f"it would leak at x = {x:g} m, z = {side[is_open][0, 1]:.4g} m"
            raise scene.error(path, f"{words}: '{fluid.fill.above}' ends there, below the level {level:g} m")


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
        volume: Of one particle of each fluid at its reference density [m2 in 2-D], shape [fluid_count]: a cell of the
            lattice in a fill, and in a shape its area shared out, so that the mass is that of the drawing.
        wall_position: Points of all walls [m], set back from the lines as drawn, shape [wall_count, 3].
        wall_normal: Unit normals towards the fluid, 0 where there is fluid on both sides, shape [wall_count, 3].
        wall_index: Index into `scene.walls`, int32, shape [wall_count].
        wall_length: Length of wall that each point stands for [m], shape [wall_count].
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
    wall_index: NDArray[np.int32]
    wall_length: Array
    ground: float
    warnings: tuple[str, ...]


def place(scene: Scene) -> Placement:
    """Sample the walls and set out the fluids of `scene`.

    Raises SceneError for what cannot be: an empty fluid, a shape on top of a wall, a fill that leaks, a corner too
    tight for its radius, a speed of sound too low for the drop.
    """
    outlines = [wall_outline(scene, i) for i in range(len(scene.walls))]
    _refuse_too_many(scene, "walls", sum(one.length for one in outlines) / scene.wall_spacing)
    warnings: list[str] = []
    placed: list[Array] = []
    depths: list[Array] = []
    volumes: list[float] = []
    for i, fluid in enumerate(scene.fluids):
        path = f"fluids[{i}].{'shape' if fluid.shape else 'fill'}"
        sites, depth, doubts = (
            _shape_sites(scene, path, fluid, outlines) if fluid.shape else _fill_sites(scene, path, fluid, outlines)
        )
        free = np.ones(len(sites), dtype=bool)
        for earlier in placed:
            free &= ~near(sites, earlier, (1.0 - LATTICE_SLACK) * scene.spacing)
        if not free.any():
            taken = "every site of it is taken by an earlier fluid" if len(sites) else "not one particle fits in it"
            raise scene.error(path, f"{taken}, at a spacing of {scene.spacing:g} m")
        placed.append(sites[free])
        depths.append(depth[free] * fluid.hydrostatic)
        volumes.append(_shape_area(scene, fluid) / len(sites) if fluid.shape else scene.spacing**2)
        warnings += doubts

    fluid_sites = np.concatenate(placed)
    set_back = scene.wall_model.set_back * scene.spacing
    sides = [_wet_side(one, fluid_sites) for one in outlines]
    samples = [
        one.shifted(-set_back * side).sample(scene.wall_spacing) for one, side in zip(outlines, sides, strict=True)
    ]
    drawn = np.concatenate([one.sample(scene.wall_spacing)[0] for one in outlines]) if outlines else fluid_sites
    counts = [len(sites) for sites in placed]
    nowhere = np.empty((0, 2))  # a scene may have no walls
    placement = Placement(
        position=_in_space(fluid_sites),
        velocity=_in_space(np.repeat([fluid.velocity for fluid in scene.fluids], counts, axis=0)),
        fluid=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        initial_depth=np.concatenate(depths),
        volume=np.array(volumes),
        wall_position=_in_space(np.concatenate([nowhere, *(points for points, _, _ in samples)])),
        wall_normal=_in_space(
            np.concatenate([nowhere, *(n * side for (_, n, _), side in zip(samples, sides, strict=True))])
        ),
        wall_index=np.repeat(np.arange(len(samples), dtype=np.int32), [len(points) for points, _, _ in samples]),
        wall_length=np.concatenate([np.empty(0), *(lengths for _, _, lengths in samples)]),
        ground=float(drawn[:, 1].min()),
        warnings=(),
    )
    warnings += _doubts(scene, placement, drawn) + _slow_sound(scene, drop_height(placement))
    return replace(placement, warnings=tuple(warnings))


def _wet_side(wall: Outline, sites: Array) -> int:
    """The side of a wall on which the fluid lies: 1 to the left of the way along it, -1 to the right, 0 both."""
    some = sites[:: max(1, len(sites) // 1000)]
    points, normals, _ = wall.sample(max(wall.length / 1000, 1e-9))
    nearest = np.argmin(((some[:, None] - points) ** 2).sum(axis=2), axis=1)
    is_left = np.einsum("ij,ij->i", some - points[nearest], normals[nearest]) > 0.0
    share = is_left.mean()
    return 1 if share > 0.98 else -1 if share < 0.02 else 0


def behind_walls(placement: Placement, position: Array) -> NDArray[np.bool_]:
    """Whether each particle at `position` [m], shape [n, 3], is on the far side of its nearest wall point, [n]."""
    behind = np.zeros(len(position), dtype=bool)
    for first in range(0, len(position), 1000):
        some = position[first : first + 1000]
        nearest = np.argmin(((some[:, None] - placement.wall_position) ** 2).sum(axis=2), axis=1)
        side = np.einsum("ij,ij->i", some - placement.wall_position[nearest], placement.wall_normal[nearest])
        behind[first : first + 1000] = side < 0.0
    return behind


def drop_height(placement: Placement) -> float:
    """How far the highest particle can fall [m]."""
    return max(float(placement.position[:, 2].max()) - placement.ground, 0.0)


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


def _doubts(scene: Scene, placement: Placement, drawn: Array) -> list[str]:
    """Warnings about what can be run but was hardly meant; `drawn` are points on the wall lines [m], shape [n, 2]."""
    doubts = []
    if scene.warm_up is None:
        for i, fluid in enumerate(scene.fluids):
            if fluid.hold:
                doubts.append(scene.error(f"fluids[{i}].hold", "there is no warm_up to hold it through"))
    if scene.walls:
        falling = _without_ground(placement.position[:, [0, 2]], drawn, scene.spacing)
        for i in np.unique(placement.fluid[falling]):
            lost = np.flatnonzero(falling & (placement.fluid == i))
            x, _, z = placement.position[lost[0]]
            words = f"{len(lost)} particles have no wall below them, the first at x = {x:.4g} m, z = {z:.4g} m"
            doubts.append(scene.error(f"fluids[{i}]", words))
        left, right = drawn[:, 0].min(), drawn[:, 0].max()
        for i, gauge in enumerate(scene.gauges):
            if not left <= gauge.x <= right:
                words = f"{gauge.x:g} m lies beyond the walls, which reach from {left:g} to {right:g} m"
                doubts.append(scene.error(f"gauges[{i}].x", words))
    return [str(doubt) for doubt in doubts]


def _without_ground(sites: Array, drawn: Array, spacing: float) -> NDArray[np.bool_]:
    """Whether no wall lies straight below each of `sites` [n, 2], to within one spacing, shape [n]."""
    left = drawn[:, 0].min()
    column = np.floor((drawn[:, 0] - left) / spacing).astype(np.int64)
    # One empty column more at either side, so that both neighbours of every column exist.
    lowest = np.full(column.max() + 3, np.inf)
    np.minimum.at(lowest, column + 1, drawn[:, 1])
    around = np.min([lowest[:-2], lowest[1:-1], lowest[2:]], axis=0)
    place = np.floor((sites[:, 0] - left) / spacing).astype(np.int64)
    beyond = (place < 0) | (place >= len(around))
    return beyond | (sites[:, 1] < around[np.clip(place, 0, len(around) - 1)])


def _in_space(plane: Array) -> Array:
    """Points or vectors [n, 2] of the x-z plane as [n, 3] with y = 0."""
    return np.insert(plane, 1, 0.0, axis=1)


def _round_up(value: float) -> float:
    """The next number of three digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.ceil(value / unit - 1e-9) * unit


def _distance(outlines: Sequence[Outline], points: Array) -> Array:
    """Distance from each of `points` to the nearest wall [m], shape [n]."""
    return np.min([np.full(len(points), np.inf), *(one.distance(points) for one in outlines)], axis=0)
