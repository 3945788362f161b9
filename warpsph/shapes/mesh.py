"""Watertight triangle meshes: read, checked and weighed.

Everything here happens once, on the host, in double precision. A refusal is a ValueError of one line.
"""

from __future__ import annotations

import contextlib
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpsph.shapes.points import Array
from warpsph.shapes.section import MassProperties, total_mass

# Triangles at whose middle it is tested that a mesh does not cross itself.
MOST_TESTED = 400


@dataclass(frozen=True)
class Mesh:
    """A closed surface, its triangles counter-clockwise as seen from outside.

    Attributes:
        vertices: [m], shape [n, 3], no two the same.
        triangles: Indices into `vertices`, shape [m, 3].
    """

    vertices: Array
    triangles: NDArray[np.int64]

    @property
    def corners(self) -> Array:
        """The corners of each triangle [m], shape [m, 3, 3]."""
        return self.vertices[self.triangles]

    @property
    def areas(self) -> Array:
        """Vectors out of each triangle, as long as its area [m2], shape [m, 3]."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return 0.5 * np.cross(b - a, c - a)


def read_mesh(path: Path | str, scale: float = 1.0) -> Mesh:
    """The mesh of a file that meshio reads (STL, OBJ, PLY, VTK, ...), its lengths multiplied by `scale`.

    Raises ValueError where there is no such file, no triangles in it, or no solid inside of them.
    """
    try:
        import meshio
    except ImportError:
        raise ValueError("a mesh is read by meshio, which is not installed: python -m pip install meshio") from None
    if not Path(path).is_file():
        raise ValueError(f"{path}: no such file")
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            read = meshio.read(path)
    except (Exception, SystemExit) as error:  # each format has errors of its own
        first = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise ValueError(f"{path}: not a mesh that can be read: {first}") from None
    found = [block.data for block in read.cells if block.type == "triangle"]
    for block in read.cells:
        if block.type == "quad":
            found += [block.data[:, [0, 1, 2]], block.data[:, [0, 2, 3]]]
    if not found:
        kinds = ", ".join(sorted({block.type for block in read.cells})) or "nothing"
        raise ValueError(f"{path}: there are no triangles in it, but {kinds}")
    try:
        return solid_mesh(scale * np.asarray(read.points, float)[:, :3], np.concatenate(found))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def solid_mesh(vertices: ArrayLike, triangles: ArrayLike) -> Mesh:
    """The mesh of `vertices` [m], shape [n, 3], and `triangles` of them, equal vertices merged.

    Raises ValueError unless it bounds a solid: closed, turned outwards, and neither touching nor crossing itself.
    """
    vertices = np.asarray(vertices, float).reshape(-1, 3)
    triangles = np.asarray(triangles, np.int64).reshape(-1, 3)
    if not len(triangles):
        raise ValueError("the mesh has no triangles")
    if not np.isfinite(vertices).all():
        raise ValueError("a vertex of the mesh is not finite")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise ValueError(f"a triangle of the mesh names vertex {triangles.max()}; there are {len(vertices)}")
    size = np.ptp(vertices[triangles.ravel()], axis=0).max()
    if size == 0.0:
        raise ValueError("all vertices of the mesh are the same place")
    _, kept, merged = np.unique(np.round(vertices / (1e-8 * size)), axis=0, return_index=True, return_inverse=True)
    triangles = merged.reshape(-1)[triangles]
    a, b, c = triangles.T
    mesh = Mesh(vertices[kept], triangles[(a != b) & (b != c) & (c != a)])
    if not len(mesh.triangles):
        raise ValueError("every triangle of the mesh has shrunk to a line")
    _refuse_open(mesh)
    volume = _volume(mesh)
    if volume < 0.0:
        raise ValueError("the mesh is inside out: its triangles must be counter-clockwise as seen from outside")
    if volume <= 1e-9 * size**3:
        raise ValueError("the mesh encloses no volume")
    _refuse_crossing(mesh)
    return mesh


def solid_mass(
    mesh: Mesh,
    *,
    density: float | None = None,
    mass: float | None = None,
    centre: ArrayLike | None = None,
    inertia: ArrayLike | None = None,
) -> MassProperties:
    """Mass properties of what `mesh` encloses, exact for its triangles.

    Sums over the tetrahedra from a point to each triangle (Eberly 2002). Of `density` [kg/m3] and `mass` [kg] one is
    given; `centre` [m] and the `inertia` about it [kg m2], shape [3, 3], replace those of a uniform body.

    Raises ValueError for a mass that is not above 0, or an inertia that no body has.
    """
    origin = mesh.vertices.mean(axis=0)
    a, b, c = np.moveaxis(mesh.corners - origin, 1, 0)
    six_volumes = np.einsum("ij,ij->i", a, np.cross(b, c))
    volume, total = six_volumes.sum() / 6.0, a + b + c
    middle = six_volumes @ total / (24.0 * volume)
    # Integral of x x^T over each tetrahedron.
    squares = sum(np.einsum("n,ni,nj->ij", six_volumes, p, p) for p in (a, b, c, total)) / 120.0
    squares = squares / volume - np.outer(middle, middle)
    return _mass_of(total_mass(float(volume), density, mass), origin + middle, squares, centre, inertia)


def ball_mass(
    middle: ArrayLike,
    radius: float,
    *,
    density: float | None = None,
    mass: float | None = None,
    centre: ArrayLike | None = None,
    inertia: ArrayLike | None = None,
) -> MassProperties:
    """As `solid_mass`, of a ball of `radius` [m] about `middle` [m]: V = 4 pi r^3 / 3, J = 2 m r^2 / 5."""
    total = total_mass(4.0 / 3.0 * math.pi * radius**3, density, mass)
    return _mass_of(total, np.asarray(middle, float), 0.2 * radius**2 * np.eye(3), centre, inertia)


def _mass_of(
    mass: float, uniform: Array, squares: Array, centre: ArrayLike | None, inertia: ArrayLike | None
) -> MassProperties:
    """Mass properties of a body that were uniform about `uniform` [m], with the mean of x x^T [m2] about it."""
    place = uniform if centre is None else np.asarray(centre, float)
    if inertia is None:
        offset = place - uniform
        squares = mass * (squares + np.outer(offset, offset))
        return MassProperties(mass, place, np.trace(squares) * np.eye(3) - squares)
    given = np.asarray(inertia, float)
    if given.shape != (3, 3) or not np.allclose(given, given.T, rtol=1e-9, atol=1e-12 * np.abs(given).max()):
        raise ValueError("an inertia is a symmetric matrix of 3 by 3")
    low, mid, high = np.linalg.eigvalsh(given)
    if low <= 0.0 or high > (1.0 + 1e-9) * (low + mid):
        raise ValueError(f"no body has the principal inertias {low:g}, {mid:g} and {high:g} kg m2")
    return MassProperties(mass, place, given)


def stood_back(mesh: Mesh, distance: float) -> Mesh:
    """The surface `distance` [m] inside of `mesh`: each of its triangles that far behind its own.

    A vertex goes by the v with n . v = -distance for the normals n of all triangles around it; where they are more than
    three, by that which is nearest to it.

    Raises ValueError where the mesh is too thin for that.
    """
    if distance == 0.0:
        return mesh
    sizes = np.linalg.norm(mesh.areas, axis=1)
    normals = mesh.areas / np.maximum(sizes, 1e-300)[:, None]
    squares, sums = np.zeros((len(mesh.vertices), 3, 3)), np.zeros((len(mesh.vertices), 3))
    ways = np.roll(mesh.corners, -1, axis=1) - mesh.corners
    ways /= np.maximum(np.linalg.norm(ways, axis=2), 1e-300)[:, :, None]
    for k in range(3):
        # By angle, so that it does not matter into how many triangles a flat face is cut.
        angle = np.arccos(np.clip(-np.einsum("ij,ij->i", ways[:, k], ways[:, k - 1]), -1.0, 1.0))
        np.add.at(squares, mesh.triangles[:, k], angle[:, None, None] * normals[:, :, None] * normals[:, None])
        np.add.at(sums, mesh.triangles[:, k], angle[:, None] * normals)
    # Normals that differ by less than about 6 degrees are one: a smooth surface goes along its normal.
    ways_in = -np.einsum("nij,nj->ni", np.linalg.pinv(squares, rcond=0.01, hermitian=True), sums)
    back = Mesh(mesh.vertices + distance * ways_in, mesh.triangles)
    is_turned = np.zeros(len(mesh.vertices), dtype=bool)
    lost = (np.einsum("ij,ij->i", back.areas, normals) <= 0.0) & (sizes > 1e-6 * sizes.max())
    is_turned[mesh.triangles[lost].ravel()] = True
    is_turned |= winding_number(mesh, back.vertices) < 0.5
    is_turned |= distance_to_mesh(mesh, back.vertices) < 0.7 * distance
    if is_turned.any():
        x, y, z = mesh.vertices[np.argmax(is_turned)]
        raise ValueError(
            f"it is too thin or too small at x = {x:.4g} m, y = {y:.4g} m, z = {z:.4g} m: "
            f"the points that push the fluid stand {distance:.3g} m inside of it"
        )
    return back


def distance_to_mesh(mesh: Mesh, points: Array) -> Array:
    """Distance from each of `points` [k, 3] to the nearest triangle [m], shape [k]."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    normals = mesh.areas / np.maximum(np.linalg.norm(mesh.areas, axis=1), 1e-300)[:, None]
    nearest = np.empty(len(points))
    count = max(1, 300_000 // len(a))  # at a time, for the sake of memory
    for first in range(0, len(points), count):
        some = points[first : first + count, None]
        squares = np.full((some.shape[0], len(a)), np.inf)
        is_over = np.ones(squares.shape, dtype=bool)
        for start, end in ((a, b), (b, c), (c, a)):
            way, arm = end - start, some - start
            share = np.clip(np.einsum("kij,ij->ki", arm, way) / np.maximum((way**2).sum(axis=1), 1e-300), 0.0, 1.0)
            squares = np.minimum(squares, ((arm - share[:, :, None] * way) ** 2).sum(axis=2))
            is_over &= np.einsum("kij,ij->ki", arm, np.cross(normals, way)) >= 0.0
        off = np.einsum("kij,ij->ki", some - a, normals) ** 2
        nearest[first : first + count] = np.sqrt(np.where(is_over, off, squares).min(axis=1))
    return nearest


def edges_of(mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Directed edges [3 m, 2] and the triangle of each, shape [3 m]."""
    directed = np.concatenate([mesh.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    return directed, np.tile(np.arange(len(mesh.triangles)), 3)


def _refuse_open(mesh: Mesh) -> None:
    """Each edge has two triangles, which run through it in opposite ways."""
    directed, _ = edges_of(mesh)
    count = len(mesh.vertices)
    there, back = directed[:, 0] * count + directed[:, 1], directed[:, 1] * count + directed[:, 0]
    pairs, uses = np.unique(np.minimum(there, back), return_counts=True)

    def where(pair: int) -> str:
        x, y, z = mesh.vertices[list(divmod(int(pair), count))].mean(axis=0)
        return f"at x = {x:.4g} m, y = {y:.4g} m, z = {z:.4g} m"

    if (uses > 2).any():
        worst = pairs[np.argmax(uses)]
        raise ValueError(f"the mesh touches itself: {uses.max()} triangles meet in one edge {where(worst)}")
    if (uses < 2).any():
        raise ValueError(
            f"the mesh is open: {np.sum(uses < 2)} edges have one triangle, the first {where(pairs[np.argmin(uses)])}"
        )
    ways, uses = np.unique(there, return_counts=True)
    if (uses > 1).any():
        raise ValueError(
            f"neighbouring triangles of the mesh are turned against each other {where(ways[np.argmax(uses)])}"
        )


def _volume(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.corners - mesh.vertices.mean(axis=0), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _refuse_crossing(mesh: Mesh) -> None:
    """Just inside and outside of a triangle the surface winds around a point once and not at all."""
    normals = mesh.areas
    sizes = np.linalg.norm(normals, axis=1)
    tested = np.flatnonzero(sizes > 1e-12 * sizes.max())
    tested = tested[:: max(1, len(tested) // MOST_TESTED)]
    middles = mesh.corners[tested].mean(axis=1)
    steps = 1e-4 * normals[tested] / np.sqrt(sizes[tested])[:, None]
    for points, wanted in ((middles - steps, 1.0), (middles + steps, 0.0)):
        wrong = np.abs(winding_number(mesh, points) - wanted) > 0.25
        if wrong.any():
            x, y, z = points[np.argmax(wrong)]
            raise ValueError(f"the mesh crosses itself, near x = {x:.4g} m, y = {y:.4g} m, z = {z:.4g} m")


def winding_number(mesh: Mesh, points: Array) -> Array:
    """How often the surface winds around each of `points` [k, 3]: 1 inside, 0 outside, shape [k].

    The sum of the solid angles of all triangles over 4 pi, van Oosterom & Strackee (1983).
    """
    numbers = np.empty(len(points))
    corners = mesh.corners
    for i, point in enumerate(points):
        a, b, c = np.moveaxis(corners - point, 1, 0)
        la, lb, lc = (np.linalg.norm(p, axis=1) for p in (a, b, c))
        above = np.einsum("ij,ij->i", a, np.cross(b, c))
        below = la * lb * lc
        below += np.einsum("ij,ij->i", a, b) * lc
        below += np.einsum("ij,ij->i", b, c) * la
        below += np.einsum("ij,ij->i", c, a) * lb
        numbers[i] = np.arctan2(above, below).sum() / (2.0 * math.pi)
    return numbers


# --------------------------------------------------------------------------------------------------------------- shapes


def box_mesh(low: ArrayLike, high: ArrayLike) -> Mesh:
    """A box from corner `low` to corner `high` [m], shape [3]."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    bits = np.array([[i & 1, (i >> 1) & 1, i >> 2] for i in range(8)])
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    return solid_mesh(low + bits * (high - low), triangles)


def sphere_mesh(centre: ArrayLike, radius: float, refinements: int = 4) -> Mesh:
    """A sphere of `radius` [m] whose triangles, 20 * 4^refinements of them, have its corners on it."""
    phi = 0.5 * (1.0 + math.sqrt(5.0))
    vertices = np.array([p for s in (1, -1) for t in (phi, -phi) for p in ([0, s, t], [s, t, 0], [t, 0, s])], float)
    # Neighbours of an icosahedron are 2 apart.
    near = np.isclose(np.linalg.norm(vertices[:, None] - vertices, axis=2), 2.0)
    triangles = np.array(
        [
            (i, j, k)
            for i in range(12)
            for j in range(i + 1, 12)
            for k in range(j + 1, 12)
            if near[i, j] and near[j, k] and near[k, i]
        ]
    )
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    inward = np.einsum("ij,ij->i", a, np.cross(b, c)) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    for _ in range(refinements):
        count = len(vertices)
        edges = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
        pairs, middle = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
        vertices = np.concatenate([vertices, vertices[pairs].mean(axis=1)])
        m = (count + middle.reshape(3, -1)).T
        triangles = np.concatenate(
            [
                np.stack([triangles[:, 0], m[:, 0], m[:, 2]], axis=1),
                np.stack([triangles[:, 1], m[:, 1], m[:, 0]], axis=1),
                np.stack([triangles[:, 2], m[:, 2], m[:, 1]], axis=1),
                m,
            ]
        )
        vertices /= np.linalg.norm(vertices, axis=1)[:, None]
    unit = vertices / np.linalg.norm(vertices, axis=1)[:, None]
    return solid_mesh(np.asarray(centre, float) + radius * unit, triangles)
