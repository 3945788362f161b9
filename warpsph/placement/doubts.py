"""What can be run but was hardly meant, told as warnings with the number that would do."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from warpsph.placement.bodies import Solid
from warpsph.placement.images import Edge
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError
from warpsph.shapes.outline import Array
from warpsph.shapes.points import BLOCK, around, near
from warpsph.shapes.wall import Wall

# A gauge reads the volume fraction, which a wall or a body cuts off within this many spacings.
GAUGE_REACH = 1.5
# Water of fewer rows of particles has no inside.
LEAST_ROWS = 5
# Lighter than this is no liquid, heavier no gas [kg/m3].
LIGHTEST_LIQUID = 25.0
# What is drawn has a dummy particle within so many spacings, but for the tips of sharp corners.
BARE = 2.0
# Steps of a fixed length may be this long, over h / c: a leapfrog step goes unstable at some 0.5.
FIXED_STEP = 0.4
# The bed is looked for in at most so many columns.
MOST_COLUMNS = 20_000_000


def doubts_of(
    scene: Scene,
    position: Array,
    counts: Sequence[int],
    walls: Sequence[Wall],
    drawn: Sequence[Array],
    solids: Sequence[Solid],
    edges: Sequence[Edge],
    dummies: Array,
) -> list[str]:
    """Warnings about what can be run but was hardly meant.

    `position` [m], shape [n, 3], are all particles, `counts` how many each fluid has; `drawn` are points on each of the
    `walls` [m], shape [n, 3], `dummies` the dummy particles of all walls [m], shape [n, 3].
    """
    ends = np.cumsum(counts).tolist()
    sites = [position[end - count : end] for count, end in zip(counts, ends, strict=True)]
    found = [
        *_units(scene),
        *_of_schemes(scene),
        *_of_fluids(scene, sites, drawn),
        *_of_tables(scene, solids),
        *(_bare(scene, walls, drawn, solids, dummies) if scene.wall_model.force == "dummy_particles" else ()),
        *_of_gauges(scene, position, walls, drawn, solids, edges),
        *(_out_of_sight(scene, *around(*drawn)) if scene.walls else ()),
    ]
    return [str(doubt) for doubt in found]


def _units(scene: Scene) -> Iterator[SceneError]:
    """Densities in another unit."""
    used = {fluid.material for fluid in scene.fluids}
    given = {f"materials.{name}": scene.materials[name].density for name in scene.materials if name in used}
    given |= {f"bodies[{i}]": body.density for i, body in enumerate(scene.bodies) if body.density}
    for path, density in given.items():
        if 0.5 <= density < LIGHTEST_LIQUID:
            words = f"{density:g} kg/m3 is a gas's; if it is in g/cm3, {1000.0 * density:g} is meant"
            yield scene.error(f"{path}.density", words)


def _of_schemes(scene: Scene) -> Iterator[SceneError]:
    """Shifting of water that sloshes, to which it gives energy; fixed steps longer than sound allows."""
    fluids = {fluid.material for fluid in scene.fluids}
    if scene.run.time_step is not None:
        c = max(scene.materials[one].sound_speed for one in fluids)
        longest = FIXED_STEP * scene.smoothing_length / c
        if scene.run.time_step > longest:
            words = f"{scene.run.time_step:g} s is too long for sound of {c:g} m/s"
            yield scene.error("run.time_step", f"{words}, and the run may blow up; {longest:.2g} s would do")
    if scene.shifting.model != "none" and not all(scene.materials[one].viscosity for one in fluids):
        words = (
            "in a fluid without a viscosity of its own it adds energy: two thirds of what a tank that sloshes converts"
        )
        yield scene.error("shifting.model", f"{words}, within 6 s; none leaves it alone")


def _of_fluids(scene: Scene, sites: Sequence[Array], drawn: Sequence[Array]) -> Iterator[SceneError]:
    """A fluid that nobody holds, that falls for ever, that is too shallow, or that lies in two basins."""
    for i, fluid in enumerate(scene.fluids):
        if fluid.hold and scene.warm_up is None:
            yield scene.error(f"fluids[{i}].hold", "there is no warm_up to hold it through")
    ground = _lowest_walls(drawn, scene.spacing) if scene.walls else None
    for i, (fluid, mine) in enumerate(zip(scene.fluids, sites, strict=True)):
        if ground:
            lost, first = count_of(mine, lambda some: _without_ground(some, *ground))
            if lost:
                words = f"{lost} particles have no wall below them, the first at {scene.spot(mine[first])}"
                yield scene.error(f"fluids[{i}]", words)
        if fluid.fill is None:
            continue
        depth = fluid.fill.level - (float(mine[:, 2].min()) - 0.5 * scene.spacing)
        if depth < (LEAST_ROWS - 0.1) * scene.spacing:
            least = depth / LEAST_ROWS
            words = f"its depth of {depth:.3g} m is {depth / scene.spacing:.1f} rows of particles"
            yield scene.error(f"fluids[{i}].fill", f"{words}; {LEAST_ROWS} are the least, with spacing={least:.3g}")
        basins = _basins(mine[:, 0], scene.spacing)
        if len(basins) > 1:
            x = scene.origin[0]
            places = " and ".join(f"from {a + x:.4g} to {b + x:.4g} m" for a, b in basins[:3])
            words = f"fills {len(basins)} basins, {places}; if one is meant, 'between' tells which"
            yield scene.error(f"fluids[{i}].fill", words)


def _basins(x: Array, spacing: float) -> list[tuple[float, float]]:
    """From where to where [m] water stands without a gap along the flume; `x` [m] are its particles."""
    columns = np.unique(np.round(x / spacing).astype(np.int64))
    first = np.flatnonzero(np.diff(columns, prepend=columns[0] - 9) > 2)
    last = np.append(first[1:], len(columns)) - 1
    return [(float(columns[a] * spacing), float(columns[b] * spacing)) for a, b in zip(first, last, strict=True)]


def _of_tables(scene: Scene, solids: Sequence[Solid]) -> Iterator[SceneError]:
    """A table that begins elsewhere than where its body is drawn."""
    for i, solid in enumerate(solids):
        table = solid.body.motion.table if solid.body.motion else None
        for name, value in zip("xyz", table.first if table else (), strict=False):
            if value:
                words = f"its first row has {name} = {value:g} m, from which it is counted: the body starts as drawn"
                yield scene.error(f"bodies[{i}].motion.file", words)


def _bare(
    scene: Scene, walls: Sequence[Wall], drawn: Sequence[Array], solids: Sequence[Solid], dummies: Array
) -> Iterator[SceneError]:
    """A closed wall or a body with a part so thin that no dummy particle has room in it: fluid goes through.

    Raises SceneError for a wall in which there is none at all.
    """
    reach = BARE * scene.spacing
    for i, (wall, points) in enumerate(zip(walls, drawn, strict=True)):
        bare = points[~near(points, dummies, reach)] if wall.closed else points[:0]
        if len(bare):
            error = _too_thin(scene, f"walls[{i}]", f"'{scene.walls[i].name}'", bare[0])
            if len(bare) == len(points):
                raise error
            yield error
    for i, solid in enumerate(solids):
        bare = solid.samples[~near(solid.samples, solid.body.surface.points, reach)]
        if len(bare):
            yield _too_thin(scene, f"bodies[{i}].shape", "it", bare[0])


def _too_thin(scene: Scene, path: str, what: str, place: Array) -> SceneError:
    words = f"{what} is thinner than a spacing at {scene.spot(place)}, where fluid goes through it"
    return scene.error(path, f"{words}; {scene.spacing:g} m is the least that holds")


def _out_of_sight(scene: Scene, low: Array, high: Array) -> Iterator[SceneError]:
    """Probes, lines and views beyond the walls, which lie from `low` to `high` [m]; and waves beyond the end."""
    along = "xz" if scene.dimensions == 2 else "xyz"
    # Water may rise above the walls, and be seen there: only x and y count.
    reached = {f"probes[{i}].at": [probe.at] for i, probe in enumerate(scene.probes) if not probe.body}
    reached |= {f"overtopping[{i}]": [gate.start, gate.end] for i, gate in enumerate(scene.overtopping)}
    ranges = [
        (path, axis, [point[along.index(axis)] for point in points])
        for path, points in reached.items()
        for axis in along[:-1]
    ]
    ranges += [(f"output.view.{axis}", axis, seen) for axis in along if (seen := getattr(scene.output.view, axis))]
    for path, axis, ends in ranges:
        k = "xyz".index(axis)
        if max(ends) < low[k] - 1e-9 or min(ends) > high[k] + 1e-9:
            first, last = (x + scene.origin[k] for x in (low[k], high[k]))
            yield scene.error(path, f"sees nothing: along {axis} the walls reach from {first:.12g} to {last:.12g} m")
    if scene.wave_maker and scene.wave_maker.begin >= scene.run.end_time:
        begin, end = scene.wave_maker.begin, scene.run.end_time
        yield scene.error("wave_maker.begin", f"it begins at {begin:g} s, and the run ends at {end:g} s")


def _of_gauges(
    scene: Scene,
    position: Array,
    walls: Sequence[Wall],
    drawn: Sequence[Array],
    solids: Sequence[Solid],
    edges: Sequence[Edge],
) -> Iterator[SceneError]:
    """A gauge that sees no fluid, or only a part of it."""
    low, high = around(*drawn) if scene.walls else around(position)
    for i, gauge in enumerate(scene.gauges):
        x, reach = np.array([gauge.x, gauge.y or 0.0, 0.0]), 2.0 * scene.smoothing_length
        for edge in edges:
            if abs(edge.normal[2]) < 1e-9 and x @ edge.normal - edge.offset < reach:
                words = f"stands closer than 2 h = {reach:.3g} m to '{edge.name}', beyond which it sees no fluid"
                yield scene.error(f"gauges[{i}]", words)
        beyond = False
        for axis, place in {0: gauge.x, 1: gauge.y or 0.0}.items() if scene.walls else ():
            if not low[axis] <= place <= high[axis]:
                beyond = True
                first, last, here = (x + scene.origin[axis] for x in (low[axis], high[axis], place))
                words = f"{here:.12g} m lies beyond the walls, which reach from {first:.12g} to {last:.12g} m"
                yield scene.error(f"gauges[{i}].{'xy'[axis]}", words)
        if beyond:
            continue
        if words := _cut_off(scene, x, position, walls, solids):
            step = 0.25 * scene.spacing
            for away in (sign * k * step for k in range(1, 200) for sign in (1.0, -1.0)):
                there = x + np.array([away, 0.0, 0.0])
                if low[0] <= there[0] <= high[0] and not _cut_off(scene, there, position, walls, solids):
                    words += f"; x = {there[0] + scene.origin[0]:.5g} m is free"
                    break
            yield scene.error(f"gauges[{i}].x", words)


def _cut_off(scene: Scene, x: Array, position: Array, walls: Sequence[Wall], solids: Sequence[Solid]) -> str:
    """By what the surface is cut off where a gauge stands at `x` [m], shape [3]; nothing where it is not."""
    dx = scene.spacing
    near = np.all(np.abs(position[:, :2] - x[:2]) < 2.0 * dx, axis=1)
    if near.any():
        top = float(position[near, 2].max())
    else:  # a body may be where there is no fluid for it
        around_it = np.all(np.abs(position[:, :2] - x[:2]) < 100.0 * dx, axis=1)
        if not around_it.any():
            return ""
        top = float(position[around_it, 2].max())
    column = np.array([[x[0], x[1], z] for z in top - dx * np.arange(0.0, 3.0)])
    for solid in solids:
        if solid.contains(column).any():
            return f"stands in body '{solid.body.name}'"
    if not near.any():
        return ""
    for name, one in [*((f"wall '{w.name}'", one) for w, one in zip(scene.walls, walls, strict=True))] + [
        (f"body '{solid.body.name}'", solid) for solid in solids
    ]:
        gap = float(one.distance(column[:1])[0])
        if gap < (GAUGE_REACH - 0.01) * dx:
            return f"stands {gap / dx:.2g} spacings off {name}; {GAUGE_REACH:g} are needed to see all of the surface"
    return ""


def _lowest_walls(drawn: Sequence[Array], spacing: float) -> tuple[Array, Array, float]:
    """A corner of a square lattice [m], shape [2], the lowest wall in and around each column of it, and its width [m].

    One column more stands on every side, so that all neighbours of every column exist.
    """
    corner = np.min([points[:, :2].min(axis=0) for points in drawn], axis=0)
    farthest = np.max([points[:, :2].max(axis=0) for points in drawn], axis=0)
    # Walls far apart have a lattice between them that is mostly empty.
    extent = (farthest - corner) / spacing
    spacing *= max(1.0, float(np.prod(np.maximum(extent, 1.0))) / MOST_COLUMNS)
    lowest = np.full(np.floor((farthest - corner) / spacing).astype(np.int64) + 3, np.inf)
    for points in drawn:
        for begin in range(0, len(points), BLOCK):
            some = points[begin : begin + BLOCK]
            column = np.floor((some[:, :2] - corner) / spacing).astype(np.int64)
            np.minimum.at(lowest, tuple(column.T + 1), some[:, 2])
    wide, deep = np.array(lowest.shape) - 2
    return corner, np.min([lowest[i : i + wide, k : k + deep] for i in range(3) for k in range(3)], axis=0), spacing


def _without_ground(sites: Array, corner: Array, lowest: Array, spacing: float) -> NDArray[np.bool_]:
    """Whether no wall lies straight below each of `sites` [n, 3], to within one spacing, shape [n].

    `corner` and `lowest` are as `_lowest_walls` gives them.
    """
    place = np.floor((sites[:, :2] - corner) / spacing).astype(np.int64)
    beyond = np.any((place < 0) | (place >= lowest.shape), axis=1)
    i, k = np.clip(place, 0, np.array(lowest.shape) - 1).T
    return beyond | (sites[:, 2] < lowest[i, k])


def count_of(points: Array, what: Callable[[Array], NDArray[np.bool_]]) -> tuple[int, int]:
    """For how many of `points` [n, 3] something is so, and for which first, block by block; (0, -1) for none."""
    total, first = 0, -1
    for begin in range(0, len(points), BLOCK):
        so = np.flatnonzero(what(points[begin : begin + BLOCK]))
        if len(so):
            total, first = total + len(so), first if total else begin + int(so[0])
    return total, first


def distance(walls: Sequence[Wall | Solid], points: Array) -> Array:
    """Distance from each of `points` [n, 3] to the nearest wall [m], shape [n]."""
    least = np.full(len(points), np.inf)
    for one in walls:
        np.minimum(least, one.distance(points), out=least)
    return least
