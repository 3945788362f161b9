"""Sites of fluids: cells of a square or cubic lattice, and what stands in for those that a wall cuts.

Points are [x, y, z], with y = 0 in a 2-D scene.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from warpsph.placement.bodies import Solid
from warpsph.placement.doubts import count_of, distance
from warpsph.placement.drawing import solid
from warpsph.placement.lattice import (
    CLEARANCE_SLACK,
    LATTICE_SLACK,
    cell_centres,
    joined,
)
from warpsph.scene.fluids import Fill, FluidField
from warpsph.scene.scene import Scene
from warpsph.scene.schemes import TRAITS
from warpsph.shapes.points import BLOCK, Array, around, inside_box, near
from warpsph.shapes.volumes import Frame
from warpsph.shapes.wall import Wall

# A cell that a wall cuts is felt out along so many lines each way.
PROBES = {False: 16, True: 12}  # in a plane, in space
PROBED_AT_ONCE = 1 << 10
# A cell that is so nearly whole, or so nearly dry, is not cut.
WHOLE = 0.98


@dataclass(frozen=True)
class Sites:
    """Where the particles of one fluid stand.

    Attributes:
        position: [m], shape [n, 3].
        depth: The column of its own that presses on each [m], shape [n].
        volume: Of each [m3, in 2-D m2], so that all of them have the volume of the drawing.
        cut: Those in cells that a wall cuts, which stand in disorder, shape [n].
        mirrors: Planes that close a fill off where there is no wall, its level first: a normal and an offset [m] each.
        holds: Whether each of some points [n, 3] lies in the fluid as drawn, shape [n].
        warnings: What is doubtful, a line each.
    """

    position: Array
    depth: Array
    volume: float
    cut: NDArray[np.bool_]
    mirrors: tuple[tuple[Array, float], ...]
    holds: Callable[[Array], NDArray[np.bool_]]
    warnings: tuple[str, ...]

    def apart_from(self, others: Sequence[Array], reach: float) -> Sites:
        """Those that are not nearer than `reach` [m] to any of `others`, each of shape [k, 3]."""
        free = np.ones(len(self.position), dtype=bool)
        for points in others:
            free &= ~near(self.position, points, reach)
        if free.all():
            return self
        return replace(self, position=self.position[free], depth=self.depth[free], cut=self.cut[free])


def shape_sites(
    scene: Scene, path: str, fluid: FluidField, walls: Sequence[Wall], drawn: Sequence[Array], solids: Sequence[Solid]
) -> Sites:
    """Sites of a shape: cells of its lattice whose centres lie in it."""
    assert fluid.shape, "a fluid is a fill or has a shape"
    dx, body = scene.spacing, solid(scene, fluid.shape)
    angle = fluid.lattice.angle if fluid.lattice else 0.0
    origin = body.first_corner()
    if fluid.lattice and fluid.lattice.origin:
        origin[[0, 2] if scene.dimensions == 2 else [0, 1, 2]] = fluid.lattice.origin

    # In the frame of the lattice a site is a triple of halves. A site on the very edge counts as inside at the low
    # sides and as outside at the high ones, whatever the rounding: hence the nudge.
    frame = Frame(origin, angle, dx)
    slabs = cell_centres(scene, path, *body.bounds(frame))
    sites = joined([frame.points(cells[body.holds(cells + LATTICE_SLACK, frame)]) for cells in slabs])

    for wall, points in zip(scene.walls, drawn, strict=True):
        within, first = count_of(points, lambda some: body.depth(some) > CLEARANCE_SLACK * dx)
        if within:
            raise scene.error(path, f"wall '{wall.name}' runs through it, at {scene.spot(points[first])}")
    touching, first = count_of(sites, lambda some: distance(walls, some) < (fluid.clearance - CLEARANCE_SLACK) * dx)
    if touching:
        words = f"{touching} of {len(sites)} particles lie closer than {fluid.clearance:g} dx to a wall"
        raise scene.error(path, f"{words}, the first at {scene.spot(sites[first])}")
    for one in solids:
        touching, first = count_of(sites, partial(_touches, one, reach=(0.5 - CLEARANCE_SLACK) * dx))
        if touching:
            words = f"body '{one.body.name}' lies in it or within half a spacing of it"
            raise scene.error(path, f"{words}, at {scene.spot(sites[first])}")

    warnings = []
    excess = len(sites) * dx**scene.dimensions / body.volume - 1.0 if body.volume else 0.0
    if len(sites) and abs(excess) > 0.05 and not TRAITS[scene.scheme].shares_mass:
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
    volume, whole = body.volume / max(len(sites), 1), np.zeros(len(sites), dtype=bool)
    return Sites(sites, depth, volume, whole, (), lambda points: body.depth(points) > 0.0, tuple(warnings))


@dataclass(frozen=True)
class _Basin:
    """The box that a fill lies in, and the lattice that fits in it.

    Attributes:
        lowest, last: Its lower and upper corner [m], shape [3].
        start: Lower corner of the first cell [m], shape [3].
        size: Of a cell [m], shape [3].
        wet_bed: Points of the bed below the level [m], shape [n, 3].
    """

    lowest: Array
    last: Array
    start: Array
    size: Array
    wet_bed: Array

    @classmethod
    def of(cls, scene: Scene, path: str, fill: Fill, walls: Sequence[Wall], bed: Array) -> _Basin:
        """Between the level, the lowest of the points `bed`, and upright ends. Raises SceneError where it is dry."""
        dx = scene.spacing
        low, high = fill.between or (-math.inf, math.inf)
        wet = bed[(bed[:, 0] >= low - dx) & (bed[:, 0] <= high + dx) & (bed[:, 2] < fill.level)]
        if not len(wet):
            x, _, z = scene.origin
            where = f" between {low + x:.12g} and {high + x:.12g} m" if fill.between else ""
            raise scene.error(path, f"'{fill.above}' is nowhere below the level {fill.level + z:.12g} m{where}")
        left, right = max(low, wet[:, 0].min()), min(high, wet[:, 0].max())
        front, back = (wet[:, 1].min(), wet[:, 1].max()) if scene.dimensions == 3 else (-0.5 * dx, 0.5 * dx)
        floor = wet[:, 2].min()

        # Rows start on the lowest bed, columns at an upright end wall, the left one if there are two, or else at the
        # left limit. Cells are stretched a little where that makes a whole number of them fit.
        upright = [any(one.is_upright(x, fill.level) for one in walls) for x in (left, right)]
        # On a slope the last point of the wall below the level stands up to a spacing from the shore.
        left, right = (left if upright[0] else max(low, left - dx)), (right if upright[1] else min(high, right + dx))
        fits = np.array([all(upright), True, True])
        pieces = (np.array([right, back, fill.level]) - [left, front, floor]) / dx
        size = np.where(fits, pieces / np.maximum(np.round(pieces), 1.0), 1.0) * dx
        start = right - math.ceil((right - left) / dx - LATTICE_SLACK) * dx if upright == [False, True] else left
        lowest, last = np.array([left, front, floor]), np.array([right, back, fill.level])
        return cls(lowest, last, np.array([start, front, floor]), size, wet)


def _touches(solid: Solid, points: Array, reach: float) -> NDArray[np.bool_]:
    """Whether each of `points` lies in a body or within `reach` [m] of it, shape [n]."""
    return solid.contains(points) | (solid.distance(points) < reach)


def fill_sites(
    scene: Scene,
    path: str,
    fluid: FluidField,
    walls: Sequence[Wall],
    drawn: Sequence[Array],
    solids: Sequence[Solid],
    earlier: Sequence[Sites],
) -> Sites:
    """Sites of a fill: cells of a lattice that fits between its level and the lowest bed, and between upright ends.

    Walls of dummy particles may cut cells, and then `earlier` fluids do too; the fullest of these count, as many as
    hold the water that is drawn. Walls that push keep cells away by the fluid's clearance.
    """
    fill, has_dummies = fluid.fill, scene.wall_model.force == "dummy_particles"
    assert fill, "a fluid is a fill or has a shape"
    index = [wall.name for wall in scene.walls].index(fill.above)
    basin = _Basin.of(scene, path, fill, walls, drawn[index])
    is_wet = _wetness(scene, basin, index, walls, drawn, solids, earlier if has_dummies else ())
    sites, share, wet_cells = _filled_cells(scene, path, basin, fluid.clearance, [*walls, *solids], earlier, is_wet)
    if has_dummies:
        fullest = np.sort(np.argsort(-share, kind="stable")[: round(wet_cells)])
        sites, share = sites[fullest], share[fullest]
    _refuse_leak(scene, path, fill, walls[index], walls, sites)
    cell = float(np.prod(basin.size[[0, 2] if scene.dimensions == 2 else [0, 1, 2]]))
    cut = (share < WHOLE) & has_dummies
    mirrors = _mirrors(scene.spacing, fill, basin, [*walls, *solids])
    volume = wet_cells * cell / max(len(sites), 1)
    return Sites(sites, fill.level - sites[:, 2], volume, cut, mirrors, is_wet, ())


def _wetness(
    scene: Scene,
    basin: _Basin,
    index: int,
    walls: Sequence[Wall],
    outlines: Sequence[Array],
    solids: Sequence[Solid],
    earlier: Sequence[Sites],
) -> Callable[[Array], NDArray[np.bool_]]:
    """A function that tells which of some points [n, 3] lie in the fill above wall number `index`, shape [n]."""
    bed, dx = walls[index], scene.spacing
    # The inside of an obstacle stays dry; a closed wall around the bed is no obstacle.
    closed = [(one, points) for one, points in zip(walls, outlines, strict=True) if one.closed and one is not bed]
    dry: list[tuple[Wall | Solid, tuple[Array, Array]]] = [
        (one, one.box()) for one, points in closed if not _is_around(one, points, outlines[index], basin, dx)
    ]
    dry += [(one, around(one.samples)) for one in solids]  # bodies displace it

    def is_wet(points: Array) -> NDArray[np.bool_]:
        inside = inside_box(points, basin.lowest, basin.last)
        inside[inside] = bed.carries(points[inside], basin.last[2])
        low, high = around(points) if len(points) else (basin.last, basin.lowest)
        for one, (its_low, its_high) in dry:
            if np.all((its_low - dx <= high) & (its_high + dx >= low)):  # of many most are elsewhere
                inside[inside] = ~one.contains(points[inside])
        for other in earlier:
            inside[inside] = ~other.holds(points[inside])
        return inside

    return is_wet


def _filled_cells(
    scene: Scene,
    path: str,
    basin: _Basin,
    clearance: float,
    solids: Sequence[Wall | Solid],
    earlier: Sequence[Sites],
    is_wet: Callable[[Array], NDArray[np.bool_]],
) -> tuple[Array, Array, float]:
    """Where particles of a fill may stand [m], shape [n, 3], the wet share of each cell, [n], and how many cells
    the water is worth; `solids` and dummies cut cells, `earlier` fluids keep them."""
    dx, size, has_dummies = scene.spacing, basin.size, scene.wall_model.force == "dummy_particles"
    edge = 0.5 * math.sqrt(scene.dimensions) * size.max()
    slack = LATTICE_SLACK * dx
    sides = [(-0.5, 0.5), (-0.5, 0.5) if scene.dimensions == 3 else (0.0,), (-0.5, 0.5)]
    corners = (1.0 - LATTICE_SLACK) * size * np.array(list(product(*sides)))
    low, high = basin.lowest + 0.5 * size - slack, basin.last - 0.5 * size + slack
    parts, shares, wet_cells = [], [], 0.0
    for cells in cell_centres(scene, path, np.zeros(3), (basin.last - basin.start - slack) / size):
        sites = basin.start + size * cells
        off = distance(solids, sites)
        is_cut = (off < edge) | np.any((sites < low) | (sites > high), axis=1)
        for other in earlier:
            beside = near(sites, other.position, dx - slack)
            if has_dummies:
                is_cut |= beside
            else:
                sites, off, is_cut = sites[~beside], off[~beside], is_cut[~beside]
        share = is_wet(sites).astype(float)
        # A wall that only touches a cell with wet corners leaves it whole, as all along the walls of a box.
        whole = is_cut & (off > 0.5 * size.max() - slack)
        for to_corner in corners:
            whole[whole] = is_wet(sites[whole] + to_corner)
        kept = (share > 0.0) & (off > (clearance - CLEARANCE_SLACK) * dx)
        for some in np.array_split(np.flatnonzero(is_cut), 1 + int(is_cut.sum()) // PROBED_AT_ONCE):
            share[some], middle = _wet_part(sites[some], whole[some], size, scene.dimensions == 3, is_wet)
            if has_dummies:
                sites[some] = np.where(share[some, None] < WHOLE, middle, sites[some])
        wet_cells += float(share.sum())
        if has_dummies:
            kept = share > 1.0 - WHOLE
        parts.append(sites[kept])
        shares.append(share[kept])
    return joined(parts), joined(shares, (0,)), wet_cells


def _refuse_leak(scene: Scene, path: str, fill: Fill, bed: Wall, walls: Sequence[Wall], sites: Array) -> None:
    """Raise SceneError where the bed of a fill ends below its level, with water beside it and no wall."""
    openings = bed.openings(fill.level, 0.5 * scene.spacing)
    is_open = near(openings, sites, 1.5 * scene.spacing) & (distance(walls, openings) > scene.spacing)
    if is_open.any():
        words = f"it would leak at {scene.spot(openings[is_open][0])}: '{fill.above}' ends there, below the level"
        raise scene.error(path, f"{words} {fill.level + scene.origin[2]:.12g} m")


def _mirrors(dx: float, fill: Fill, basin: _Basin, solids: Sequence[Wall | Solid]) -> tuple[tuple[Array, float], ...]:
    """The planes that close a fill off, a normal and an offset [m] each: its level, and limits without a wall."""
    mirrors = [(np.array([0.0, 0.0, 1.0]), fill.level)]
    (left, front, floor), (right, back, _) = basin.lowest, basin.last
    upwards = np.linspace(floor, fill.level, 21)
    for x in fill.between or ():
        plane = np.stack([np.full(21, x), np.full(21, 0.5 * (front + back)), upwards], axis=1)
        if left <= x <= right and np.median(distance(solids, plane)) > dx:
            mirrors.append((np.array([1.0, 0.0, 0.0]), x))
    return tuple(mirrors)


def _is_around(wall: Wall, points: Array, bed: Array, basin: _Basin, dx: float) -> bool:
    """Whether a closed wall, with `points` on it, stands around the `bed` of a basin.

    An obstacle may stand on the very middle of the bed, but does not reach from end to end of it.
    """
    wet = basin.wet_bed
    reaches = (points.min(axis=0) < wet.min(axis=0) + dx) & (points.max(axis=0) > wet.max(axis=0) - dx)
    return bool(reaches[:2].all() and wall.contains(bed[[len(bed) // 2]])[0])


def _wet_part(
    sites: Array,
    whole: NDArray[np.bool_],
    size: Array,
    in_space: bool,
    is_wet: Callable[[Array], NDArray[np.bool_]],
) -> tuple[Array, Array]:
    """Which share of the cells around `sites` [n, 3] is wet, shape [n], and the middle of it [m], shape [n, 3].

    Cells that are known to be `whole` [n] are not felt out.
    """
    probes = PROBES[in_space]
    line = (np.arange(probes) + 0.5) / probes - 0.5
    lines = [line, line if in_space else [0.0], line]
    raster = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    # Each cell is felt out on a raster of its own, or a wall along the lattice would be off by the same in all of them.
    shift = np.random.default_rng(0).uniform(size=(len(sites), 1, 3)) * [1.0, float(in_space), 1.0]
    share, middle = np.ones(len(sites)), sites.copy()
    points = sites[~whole, None] + size * ((raster + shift[~whole] + 0.5) % 1.0 - 0.5)
    wet = is_wet(points.reshape(-1, 3)).reshape(points.shape[:2])
    count = wet.sum(axis=1)
    share[~whole] = count / len(raster)
    middle[~whole] = np.einsum("np,npk->nk", wet, points) / np.maximum(count, 1)[:, None]
    return share, middle
