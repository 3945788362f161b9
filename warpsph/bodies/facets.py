"""Solids and walls in space as contact sees them: flat faces, the edges at which these bulge, and corners.

Everything here happens once, on the host. Points are [x, y, z].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warpsph.shapes.crate import Crate
from warpsph.shapes.outline import Bend, Line, reversed_outline
from warpsph.shapes.points import Array
from warpsph.shapes.sampling import along_curve
from warpsph.shapes.sheet import Sheet

# Neighbouring triangles whose normals differ by less are one flat face [rad].
FLAT = 1e-3
# Arcs of walls that bulge have edges across their width, so far apart at most [rad].
ARC_STEP = math.radians(5.0)


@dataclass(frozen=True)
class Face:
    """A flat face, of triangles that have three borders each.

    Attributes:
        normal: Unit vector to the free side, shape [3].
        along: Any unit vector in the face, shape [3].
        corners: Of its triangles [m], shape [3 m, 3]; border i starts in corner i.
        into: From each border into its triangle, unit vectors, shape [3 m, 3].
        beyond: How far the face counts beyond each border [m], and how fast that shrinks inside, shape [3 m, 2].
    """

    normal: Array
    along: Array
    corners: Array
    into: Array
    beyond: Array


@dataclass(frozen=True)
class FacetEdge:
    """An edge that bulges, or the border of a sheet.

    Attributes:
        start: [m], shape [3].
        way: Unit vector to its end, shape [3].
        length: [m].
        into: From it into either of its two faces, unit vectors, shape [2, 3]; twice the same at a border.
    """

    start: Array
    way: Array
    length: float
    into: Array


@dataclass(frozen=True)
class Faces:
    """Faces, of which a mesh from a file has many: face i has the borders first[i] .. first[i + 1] - 1.

    Attributes:
        normal, along: As of `Face`, shape [n, 3].
        first: Into the borders, shape [n + 1].
        corners, into, beyond: As of `Face`, of all borders.
    """

    normal: Array
    along: Array
    first: NDArray[np.int64]
    corners: Array
    into: Array
    beyond: Array

    def __len__(self) -> int:
        return len(self.normal)

    def __getitem__(self, i: int) -> Face:
        mine = slice(self.first[i], self.first[i + 1])
        return Face(self.normal[i], self.along[i], self.corners[mine], self.into[mine], self.beyond[mine])


@dataclass(frozen=True)
class FacetEdges:
    """Edges: arrays of the fields of a `FacetEdge`, with `length` of shape [n]."""

    start: Array
    way: Array
    length: Array
    into: Array

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, i: int) -> FacetEdge:
        return FacetEdge(self.start[i], self.way[i], self.length[i], self.into[i])


_NONE = np.empty((0, 3))
NO_FACES = Faces(_NONE, _NONE, np.zeros(1, np.int64), _NONE, _NONE, np.empty((0, 2)))


@dataclass(frozen=True)
class Facets:
    """What can touch of a surface; `corners` [m], shape [n, 3]."""

    faces: Faces
    edges: FacetEdges
    corners: Array


def facets(vertices: Array, triangles: NDArray[np.int64], depth: float) -> Facets:
    """What can touch of a surface whose triangles are counter-clockwise as seen from its free side.

    It may have borders. Faces that form a hollow reach `depth` [m] into each other. Triangles without area are left
    out.
    """
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    doubled = np.cross(b - a, c - a)
    sizes = np.linalg.norm(doubled, axis=1)
    has_area = sizes > 1e-12 * sizes.max()
    triangles, normals = triangles[has_area], doubled[has_area] / sizes[has_area, None]
    corners = vertices[triangles]
    ways = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(ways, axis=2)
    ways /= lengths[:, :, None]
    into = np.cross(normals[:, None], ways)
    beside = _neighbours(triangles)
    group = _flat_groups(normals, beside)

    beyond = np.zeros((len(triangles), 3, 2))
    is_corner = np.zeros(len(vertices), dtype=bool)
    one, border = np.nonzero((beside < 0) | (group[beside] != group[:, None]))
    other = beside[one, border]
    met = other >= 0
    inward, outward = into[one, border], into[one, border]
    back = np.argmax(beside[other[met]] == one[met, None], axis=1)
    outward[met] = into[other[met], back]
    # How far the other face turns away from this one.
    turn = np.zeros(len(one))
    turn[met] = np.arctan2(
        -np.einsum("ij,ij->i", normals[one], outward)[met], -np.einsum("ij,ij->i", inward, outward)[met]
    )
    hollow = met & (turn < 0.0)
    beyond[one[hollow], border[hollow], 0] = depth
    bulges = met & ~hollow
    beyond[one[bulges], border[bulges], 1] = np.tan(0.5 * turn[bulges])
    for k in (0, 1):
        is_corner[triangles[one[~hollow], (border[~hollow] + k) % 3]] = True
    first = np.flatnonzero(~hollow & (other < one))  # of the two triangles at a border, or the only one
    starts, directions = corners[one[first], border[first]], ways[one[first], border[first]]
    spans, pairs = lengths[one[first], border[first]], np.stack([inward[first], outward[first]], axis=1)
    order = np.argsort(group, kind="stable")
    begin = np.flatnonzero(np.diff(group[order], prepend=-1))
    borders = (a[order].reshape(-1, a.shape[2]) for a in (corners, into, beyond))
    faces = Faces(
        normals[order[begin]], ways[order[begin], 0], 3 * np.append(begin, len(order)).astype(np.int64), *borders
    )
    bulging = vertices[is_corner]
    # Neighbours together, so that contact passes over far parts.
    size = float(np.ptp(vertices, axis=0).max()) / 64.0
    if len(first):
        order = np.argsort(along_curve(starts + 0.5 * spans[:, None] * directions, size), kind="stable")
        starts, directions, spans, pairs = (a[order] for a in (starts, directions, spans, pairs))
        bulging = bulging[np.argsort(along_curve(bulging, size), kind="stable")]
    edges = FacetEdges(starts, directions, spans, pairs)
    return Facets(faces, edges, bulging)


def crate_facets(crate: Crate, side: int, depth: float) -> Facets:
    """Those of a wall that is a box, free on its inner (`side` 1) or outer side (-1); `depth` as of `facets`."""
    vertices = np.array([[(crate.low, crate.high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
    triangles = []
    for axis, end in crate.sides():
        a, b = (1 << other for other in ((axis + 1) % 3, (axis + 2) % 3))
        first = end << axis
        quad = [first, first + a, first + a + b, first + b]  # counter-clockwise as seen from where the axis leads to
        if (end == 1) == (side > 0):
            quad.reverse()
        triangles += [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    return facets(vertices, np.array(triangles), depth)


def sheet_edges(sheet: Sheet, side: int) -> Facets:
    """Edges and corners of a wall that is an outline across a width, free on the left of its way (`side` 1) or right.

    Its faces are the legs of `bodies.contact_legs`. An arc that bulges is a row of edges; the side borders of one that
    does not are left out.
    """
    assert sheet.width, "a wall of the plane has no edges"
    outline = sheet.outline if side > 0 else reversed_outline(sheet.outline)
    low, high = sheet.width
    edges: list[FacetEdge] = []
    corners: list[Array] = []
    along_y = np.array([0.0, 1.0, 0.0])

    def across(point: Array, *into: Array) -> None:
        ends = np.array([[point[0], y, point[1]] for y in (low, high)])
        faces = np.array([[x, 0.0, z] for x, z in (into if len(into) == 2 else into * 2)])
        edges.append(FacetEdge(ends[0], along_y, high - low, faces))
        corners.extend(ends)

    def beside(start: Array, end: Array) -> None:
        way = np.array([end[0] - start[0], 0.0, end[1] - start[1]])
        length = float(np.linalg.norm(way))
        for y, inward in ((low, along_y), (high, -along_y)):
            edges.append(FacetEdge(np.array([start[0], y, start[1]]), way / length, length, np.stack([inward, inward])))

    legs, count = outline.legs, len(outline.legs)
    for i, leg in enumerate(legs):
        stops = np.array([0.0, 1.0])
        if isinstance(leg, Bend):
            stops = np.linspace(0.0, 1.0, max(1, math.ceil(abs(leg.turn) / ARC_STEP)) + 1)
        points, normals = leg.points(stops), leg.normals(stops)
        tangents = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
        if isinstance(leg, Line) or leg.turn < 0.0:
            for start, end in pairwise(points):
                beside(start, end)
            for point, tangent in zip(points[1:-1], tangents[1:-1], strict=True):
                across(point, -tangent, tangent)
        if i == 0 and not outline.closed:
            across(points[0], tangents[0])
        if i == count - 1 and not outline.closed:
            across(points[-1], -tangents[-1])
            continue
        after = legs[(i + 1) % count].normals(np.zeros(1))[0]
        is_bulging = normals[-1, 0] * after[1] - normals[-1, 1] * after[0] < -1e-6
        if is_bulging or (isinstance(leg, Bend) and leg.turn < 0.0):
            across(points[-1], -tangents[-1], np.array([after[1], -after[0]]))
    table = FacetEdges(
        np.array([edge.start for edge in edges]).reshape(-1, 3),
        np.array([edge.way for edge in edges]).reshape(-1, 3),
        np.array([edge.length for edge in edges]),
        np.array([edge.into for edge in edges]).reshape(-1, 2, 3),
    )
    return Facets(NO_FACES, table, np.array(corners).reshape(-1, 3))


def _neighbours(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangle on the other side of each border, shape [m, 3]; -1 where there is none."""
    count = int(triangles.max()) + 1
    there = triangles * count + np.roll(triangles, -1, axis=1)
    back = np.roll(triangles, -1, axis=1) * count + triangles
    order = np.argsort(there.ravel(), kind="stable")
    place = np.minimum(np.searchsorted(there.ravel(), back.ravel(), sorter=order), there.size - 1)
    found = order[place]
    return np.where(there.ravel()[found] == back.ravel(), found // 3, -1).reshape(-1, 3)


def _flat_groups(normals: Array, beside: NDArray[np.int64]) -> NDArray[np.int64]:
    """The number of the flat face of each triangle, shape [m]: spread from one triangle to its neighbours."""
    group = np.full(len(normals), -1)
    flat, near = math.cos(FLAT), beside.tolist()
    # Triangles none of whose neighbours is as flat to them are their own faces at once.
    alike = np.einsum("ijk,ik->ij", normals[beside], normals)
    alone = np.all((beside < 0) | (alike <= flat), axis=1)
    group[alone] = np.flatnonzero(alone)
    for seed in np.flatnonzero(~alone).tolist():
        if group[seed] >= 0:
            continue
        group[seed] = seed
        waiting = [seed]
        while waiting:
            for other in near[waiting.pop()]:
                if other >= 0 and group[other] < 0 and normals[other] @ normals[seed] > flat:
                    group[other] = seed
                    waiting.append(other)
    return group
