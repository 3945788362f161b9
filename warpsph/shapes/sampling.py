"""Points spread evenly over the surface of a shape: along an outline, or over a mesh.

Everything here happens once, on the host, in double precision. Nothing is drawn by chance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpsph.shapes.mesh import Mesh, edges_of
from warpsph.shapes.outline import Outline, counter_clockwise
from warpsph.shapes.points import Array, in_space, unit

# An edge where the surface turns by more than this is an edge of the shape; points are set along it.
SHARP = math.radians(25.0)
# A mesh is sampled through pieces of at most this share of the spacing.
PIECE = 0.45
# Area of the cell of a point, in squares of the spacing: between a hexagonal and a square lattice.
CELL = 0.92
# Moves to the middle of its cell: distances to the nearest point then vary by 10 % on a box, 8 % on a sphere.
RELAXATIONS = 15
# A piece of that length at most takes up about a fifth of its square; where there are so many more, some are joined.
MOST_SPLIT = 20.0
MOST_PIECES = 20_000_000
# The normal where faces turn straight back, and there is no direction halfway between them.
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Surface:
    """Points spread over the surface of a shape, in the coordinates in which the shape was given, [x, y, z].

    Attributes:
        points: [m], shape [n, 3].
        normals: Unit vectors out of the shape, halfway between the faces at an edge, shape [n, 3].
        shares: What of the surface each point stands for [m2], or of the outline [m], shape [n].
        before, after: From each point to the one before and after it along an outline [m], shape [n, 3]; 0 on a mesh.
    """

    points: Array
    normals: Array
    shares: Array
    before: Array
    after: Array


def surface_of_outline(outline: Outline, spacing: float) -> Surface:
    """Points at most `spacing` [m] apart on a closed outline, evenly along each leg, corners included."""
    points, inward, shares = counter_clockwise(outline).sample(spacing)
    points = in_space(points)
    return Surface(
        points=points,
        normals=in_space(-inward),
        shares=shares,
        before=np.roll(points, 1, axis=0) - points,
        after=np.roll(points, -1, axis=0) - points,
    )


def surface_of_mesh(mesh: Mesh, spacing: float) -> Surface:
    """Points about `spacing` [m] apart on the surface; corners and sharp edges have points of their own.

    Corners and edges are fixed; the other points are spread along a curve that fills space, and then moved to the
    middle of the surface that is nearest to them (Lloyd 1982). Nothing is drawn by chance. The shares [m2] are the
    areas nearest to each point and add up to the area of the mesh.

    Raises ValueError where the spacing is too fine for the mesh.
    """
    sizes = np.linalg.norm(mesh.areas, axis=1)
    total = float(sizes.sum())
    if total / (PIECE * spacing) ** 2 > MOST_PIECES:
        raise ValueError(f"a spacing of {spacing:g} m is too fine for a surface of {total:.3g} m2")
    middles, areas, of_triangle = pieces(mesh, PIECE * spacing)
    facing = mesh.normals
    piece_normals = facing[of_triangle]
    if len(middles) * (PIECE * spacing) ** 2 > MOST_SPLIT * total:
        middles, areas, piece_normals = _gathered(middles, areas, piece_normals, spacing)

    fixed, fixed_normals = _feature_points(mesh, facing, spacing)
    free = max(round(total / (CELL * spacing**2)) - len(fixed), 0 if len(fixed) else 1)
    order = np.argsort(along_curve(middles, spacing), kind="stable")
    along = np.cumsum(areas[order]) / total
    chosen = order[np.searchsorted(along, (np.arange(free) + 0.5) / max(free, 1))]
    points = np.concatenate([fixed, middles[chosen]])
    normals = np.concatenate([fixed_normals, piece_normals[chosen]])

    movable = np.arange(len(points)) >= len(fixed)
    for _ in range(RELAXATIONS):
        owner = _nearest(middles, piece_normals, points, normals, spacing)
        weight = _sums(owner, areas, len(points))
        centre = np.stack([_sums(owner, areas * x, len(points)) for x in middles.T], axis=1)
        has_area = movable & (weight > 0.0)
        centre[has_area] /= weight[has_area, None]
        # Back onto the surface: onto the plane of the piece that is nearest to the middle.
        gap = np.linalg.norm(middles - centre[owner], axis=1)
        sorted_by_gap = np.lexsort((gap, owner))
        owners, first = np.unique(owner[sorted_by_gap], return_index=True)
        nearest = np.full(len(points), -1)
        nearest[owners] = sorted_by_gap[first]
        n = piece_normals[nearest[has_area]]
        off = np.einsum("ij,ij->i", centre[has_area] - middles[nearest[has_area]], n)
        points[has_area] = centre[has_area] - off[:, None] * n
        normals[has_area] = n
    owner = _nearest(middles, piece_normals, points, normals, spacing)
    shares = _sums(owner, areas, len(points))
    kept = shares > 0.0
    nothing = np.zeros((int(kept.sum()), 3))
    return Surface(points[kept], normals[kept], shares[kept], nothing, nothing)


def pieces(mesh: Mesh, longest: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Middles [m], areas [m2] and triangles of pieces no longer than `longest` [m]: longest edges are halved."""
    corners, of_triangle = mesh.corners, np.arange(len(mesh.triangles))
    done = []
    while len(corners):
        lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        is_short = lengths.max(axis=1) <= longest
        done.append((corners[is_short], of_triangle[is_short]))
        corners, of_triangle, lengths = corners[~is_short], of_triangle[~is_short], lengths[~is_short]
        # Turned so that the longest edge is that from the first corner to the second.
        turn = (np.argmax(lengths, axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(corners, turn[:, :, None], axis=1), 1, 0)
        middle = 0.5 * (a + b)
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        of_triangle = np.tile(of_triangle, 2)
    corners, of_triangle = (np.concatenate(arrays) for arrays in zip(*done, strict=True))
    a, b, c = np.moveaxis(corners, 1, 0)
    return corners.mean(axis=1), 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1), of_triangle


def _gathered(middles: Array, areas: Array, normals: Array, spacing: float) -> tuple[Array, Array, Array]:
    """Pieces of a mesh much finer than `spacing` [m] joined, where they share a cell and face about one way.

    Middles [m], areas [m2] and normals of fewer pieces, about a quarter of the spacing wide.
    """
    facing = 2 * np.argmax(np.abs(normals), axis=1)
    facing += np.take_along_axis(normals, facing[:, None] // 2, axis=1)[:, 0] > 0.0
    _, of_piece = np.unique(6 * along_curve(middles, spacing) + facing, return_inverse=True)
    area = np.maximum(np.bincount(of_piece, areas), 1e-300)
    middle, way = (
        np.stack([np.bincount(of_piece, areas * x) for x in vectors.T], axis=1) / area[:, None]
        for vectors in (middles, normals)
    )
    return middle, area, way / np.maximum(np.linalg.norm(way, axis=1), 1e-300)[:, None]


def _feature_points(mesh: Mesh, facing: Array, spacing: float) -> tuple[Array, Array]:
    """Points [m] at corners and evenly along sharp edges, and their normals: halfway between the faces."""
    directed, triangle = edges_of(mesh)
    order = np.lexsort((directed.max(axis=1), directed.min(axis=1)))
    pairs = order.reshape(-1, 2)  # the two directed edges of each edge are neighbours now
    cosine = np.einsum("ij,ij->i", facing[triangle[pairs[:, 0]]], facing[triangle[pairs[:, 1]]])
    sharp = pairs[cosine < math.cos(SHARP)]
    ends = directed[sharp[:, 0]]
    between = facing[triangle[sharp[:, 0]]] + facing[triangle[sharp[:, 1]]]

    points: list[Array] = []
    normals: list[Array] = []
    at_corner: dict[int, list[int]] = {}
    for edge, (a, b) in enumerate(ends.tolist()):
        at_corner.setdefault(a, []).append(edge)
        at_corner.setdefault(b, []).append(edge)
    corners = {v for v, edges in at_corner.items() if _is_corner(mesh, v, edges, ends)}
    for v in sorted(corners):
        around = {t for edge in at_corner[v] for t in triangle[sharp[edge]].tolist()}
        points.append(mesh.vertices[v])
        normals.append(unit(facing[sorted(around)].sum(axis=0), UP))
    for path, is_loop in _paths(ends, at_corner, corners):
        places = mesh.vertices[[v for v, _ in path]]
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
        count = max(1, math.ceil(lengths[-1] / spacing - 1e-9))
        stops = np.arange(0 if is_loop else 1, count) * lengths[-1] / count
        along = np.clip(np.searchsorted(lengths, stops, side="right") - 1, 0, len(path) - 2)
        points += list(np.stack([np.interp(stops, lengths, x) for x in places.T], axis=1))
        normals += [unit(between[path[i + 1][1]], UP) for i in along]
    return np.array(points).reshape(-1, 3), np.array(normals).reshape(-1, 3)


def _is_corner(mesh: Mesh, vertex: int, edges: list[int], ends: NDArray[np.int64]) -> bool:
    """Whether sharp edges end, branch or turn sharply at a vertex."""
    if len(edges) != 2:
        return True
    others = [ends[e].sum() - vertex for e in edges]
    a, b = (unit(mesh.vertices[other] - mesh.vertices[vertex], UP) for other in others)
    return float(a @ b) > -math.cos(SHARP)


def _paths(
    ends: NDArray[np.int64], at_corner: dict[int, list[int]], corners: set[int]
) -> Iterator[tuple[list[tuple[int, int]], bool]]:
    """Sharp edges joined from corner to corner, or to loops: (vertex, edge that leads to it), and whether a loop."""
    is_left = np.ones(len(ends), dtype=bool)
    starts = [(v, edge) for v in sorted(corners) for edge in at_corner[v]]
    for v, edge in starts + [(int(ends[e, 0]), e) for e in range(len(ends))]:
        if not is_left[edge]:
            continue
        path = [(v, -1)]
        while True:
            is_left[edge] = False
            v = int(ends[edge].sum() - v)
            path.append((v, edge))
            onward = [e for e in at_corner[v] if is_left[e]]
            if v in corners or not onward:
                break
            edge = onward[0]
        yield path, path[0][0] == path[-1][0] and path[0][0] not in corners


def along_curve(points: Array, spacing: float) -> NDArray[np.int64]:
    """Places along Morton's curve, whose cells are a quarter of the spacing wide, shape [n]."""
    cells = ((points - points.min(axis=0)) / (0.25 * spacing)).astype(np.int64)
    key = np.zeros(len(points), np.int64)
    for bit in range(20):
        for axis in range(3):
            key |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return key


def _sums(owner: NDArray[np.int64], weights: Array, count: int) -> Array:
    """The sum of the weights of each of so many owners, shape [count]."""
    return np.bincount(owner, weights, count).astype(float, copy=False)


def _nearest(places: Array, place_normals: Array, points: Array, normals: Array, spacing: float) -> NDArray[np.int64]:
    """The nearest of `points` on the same side of the shape, for each of `places`, shape [n]."""
    cell = 1.5 * spacing
    low = np.minimum(places.min(axis=0), points.min(axis=0))
    place_cell = np.floor((places - low) / cell).astype(np.int64) + 1
    point_cell = np.floor((points - low) / cell).astype(np.int64) + 1
    size = np.maximum(place_cell.max(axis=0), point_cell.max(axis=0)) + 2
    strides = np.array([size[1] * size[2], size[2], 1])
    point_key = point_cell @ strides
    order = np.argsort(point_key, kind="stable")
    cells, of_cell = np.unique(place_cell @ strides, return_inverse=True)

    # The points in and around each cell, one past the last where there are no more.
    steps = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(-1, 3) @ strides
    first = np.searchsorted(point_key[order], cells[:, None] + steps, side="left")
    count = np.searchsorted(point_key[order], cells[:, None] + steps, side="right") - first
    before = np.cumsum(count, axis=1) - count
    around = np.full((len(cells), max(int(count.sum(axis=1).max()), 1)), len(points))
    for k in range(count.max(initial=0)):
        row, column = np.nonzero(count > k)
        around[row, before[row, column] + k] = order[first[row, column] + k]

    beyond, no_way = np.append(points, [[np.inf] * 3], axis=0), np.append(normals, np.zeros((1, 3)), axis=0)
    owner = np.empty(len(places), np.int64)
    for begin in range(0, len(places), 10_000):
        rows = slice(begin, begin + 10_000)
        some = around[of_cell[rows]]
        distance = ((places[rows, None] - beyond[some]) ** 2).sum(axis=2)
        distance[np.einsum("ij,ikj->ik", place_normals[rows], no_way[some]) <= 0.05] = np.inf
        best = np.argmin(distance, axis=1)
        found = np.isfinite(np.take_along_axis(distance, best[:, None], axis=1)[:, 0])
        owner[rows] = np.where(found, np.take_along_axis(some, best[:, None], axis=1)[:, 0], -1)
    for lone in np.flatnonzero(owner < 0):  # a place that no point is near: seldom, and only at first
        gap = ((points - places[lone]) ** 2).sum(axis=1)
        owner[lone] = int(np.argmin(np.where(normals @ place_normals[lone] > 0.05, gap, gap + 1e6)))
    return owner
