"""Watertight triangle meshes: read, welded, checked and weighed.

Everything here happens once, on the host: trimesh reads and weighs, Warp's tree of boxes finds what is near and inside,
and distances are taken in double precision then. A refusal is a ValueError of one line that says what to do.
"""

from __future__ import annotations

import itertools
import logging
import math
import warnings
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpsph.device.mesh_queries import MeshQueries
from warpsph.shapes.points import Array
from warpsph.shapes.reading import trimesh
from warpsph.shapes.section import MassProperties, total_mass

log = logging.getLogger("warpsph")
news = logging.getLogger("warpsph.progress")  # which the command line shows

# Corners nearer than this share of the size of a mesh are one: files in text, and programs that cut, keep no more.
WELD = 1e-5
# A mesh of more triangles is a scan, not a body, and so is a file of more bytes.
MOST_TRIANGLES, MOST_BYTES = 2_000_000, 1e9
# So many doubtful places of a mesh are asked exactly.
MOST_ASKED = 20
# A mesh of more triangles than these takes seconds, and is spoken of.
MANY = 20_000


@dataclass(frozen=True)
class Mesh:
    """A closed surface, its triangles counter-clockwise as seen from outside.

    Attributes:
        vertices: [m], shape [n, 3], no two the same.
        triangles: Indices into `vertices`, shape [m, 3].
    """

    vertices: Array
    triangles: NDArray[np.int64]

    @cached_property
    def corners(self) -> Array:
        """The corners of each triangle [m], shape [m, 3, 3]."""
        return self.vertices[self.triangles]

    @cached_property
    def areas(self) -> Array:
        """Vectors out of each triangle, as long as its area [m2], shape [m, 3]."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return 0.5 * np.cross(b - a, c - a)

    @cached_property
    def normals(self) -> Array:
        """Unit vectors out of each triangle, 0 of one without an area, shape [m, 3]."""
        areas = self.areas
        return areas / np.maximum(np.linalg.norm(areas, axis=1), 1e-300)[:, None]

    @cached_property
    def ways_in(self) -> Array:
        """How each vertex moves while the planes around it move inwards by 1, shape [n, 3]."""
        normals = self.normals
        squares, sums = np.zeros((len(self.vertices), 3, 3)), np.zeros((len(self.vertices), 3))
        ways = np.roll(self.corners, -1, axis=1) - self.corners
        ways /= np.maximum(np.linalg.norm(ways, axis=2), 1e-300)[:, :, None]
        for k in range(3):
            # By angle, so that it does not matter into how many triangles a flat face is cut.
            angle = np.arccos(np.clip(-np.einsum("ij,ij->i", ways[:, k], ways[:, k - 1]), -1.0, 1.0))
            np.add.at(squares, self.triangles[:, k], angle[:, None, None] * normals[:, :, None] * normals[:, None])
            np.add.at(sums, self.triangles[:, k], angle[:, None] * normals)
        # Normals that differ by less than about 6 degrees are one: a smooth surface goes along its normal.
        return -np.einsum("nij,nj->ni", np.linalg.pinv(squares, rcond=0.01, hermitian=True), sums)

    @cached_property
    def queries(self) -> MeshQueries:
        """To ask for nearest triangles, and for the inside."""
        return MeshQueries(self.vertices, self.triangles)


def read_mesh(path: Path | str, scale: float = 1.0) -> Mesh:
    """The mesh of a file that trimesh reads (STL, OBJ, PLY, OFF, GLB, ...; with meshio installed VTK, MSH and more).

    Its lengths are multiplied by `scale`.

    Raises ValueError where there is no such file, no triangles in it, or no solid inside of them.
    """
    if not Path(path).is_file():
        raise ValueError(f"{path}: no such file")
    facts = Path(path).stat()
    if facts.st_size > MOST_BYTES:
        raise ValueError(f"{path}: more than {MOST_BYTES / 1e9:g} GB; make it coarser")
    return _read(str(path), scale, facts.st_size, facts.st_mtime_ns)


@lru_cache(maxsize=8)  # a scene is placed more than once by `check`
def _read(path: str, scale: float, *_: int) -> Mesh:
    """As `read_mesh`; the file by its size and its time too, should it change."""
    _refuse_cut(Path(path))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of readers, about nothing that a user could mend
            read = trimesh.load_mesh(path, process=False)
        vertices, triangles = np.asarray(read.vertices, float), np.asarray(read.faces, np.int64)
    except (Exception, SystemExit) as error:  # each format has errors of its own
        first = (str(error).strip().splitlines() or [type(error).__name__])[0]
        if getattr(error, "name", "") == "charset_normalizer":  # is asked when nothing else can tell letters in it
            first = "it is damaged, or of another kind"
        hint = ""
        if Path(path).suffix.lower().lstrip(".") not in trimesh.available_formats():
            hint = "; it may be read after python -m pip install meshio"
        raise ValueError(f"{path}: not a mesh that can be read: {first[:120]}{hint}") from None
    if not len(triangles):
        raise ValueError(f"{path}: there are no triangles in it")
    if len(triangles) > MANY:
        news.info("%s: looking whether its %s triangles bound a solid", path, f"{len(triangles):,}")
    try:
        mesh, welded = _welded(scale * vertices, triangles)
        if welded:
            size = float(np.ptp(mesh.vertices, axis=0).max())
            log.warning("%s: %d corners lay within %.2g m of others, and are welded to them", path, welded, WELD * size)
        return _checked(mesh)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _refuse_cut(path: Path) -> None:
    """A binary STL has 84 bytes, which tell how many triangles there are, and 50 for each."""
    if path.suffix.lower() != ".stl":
        return
    with path.open("rb") as file:
        head = file.read(84)
    told, there = int.from_bytes(head[80:], "little"), (path.stat().st_size - 84) // 50
    if len(head) == 84 and b"\0" in head and there < told <= MOST_TRIANGLES:
        raise ValueError(f"{path}: is cut: it tells of {told:,} triangles, and {max(there, 0):,} are there")


def solid_mesh(vertices: ArrayLike, triangles: ArrayLike) -> Mesh:
    """The mesh of `vertices` [m], shape [n, 3], and `triangles` of them, vertices that are next to equal merged.

    Raises ValueError unless it bounds a solid: closed, turned outwards, and neither touching nor crossing itself.
    """
    vertices = np.asarray(vertices, float).reshape(-1, 3)
    triangles = np.asarray(triangles, np.int64).reshape(-1, 3)
    if not len(triangles):
        raise ValueError("the mesh has no triangles")
    return _checked(_welded(vertices, triangles)[0])


def _welded(vertices: Array, triangles: NDArray[np.int64]) -> tuple[Mesh, int]:
    """A mesh without corners that are next to each other, and how many there were that were not just the same."""
    if len(triangles) > MOST_TRIANGLES:
        raise ValueError(f"the mesh has {len(triangles):,} triangles; {MOST_TRIANGLES:,} are the most, make it coarser")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise ValueError(f"a triangle of the mesh names vertex {triangles.max()}; there are {len(vertices)}")
    used, triangles = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], triangles.reshape(-1, 3)
    if not np.isfinite(vertices).all():
        raise ValueError("a vertex of the mesh is not finite")
    low = vertices.min(axis=0)
    size = float((vertices.max(axis=0) - low).max())
    if size == 0.0:
        raise ValueError("all vertices of the mesh are the same place")
    vertices, same = np.unique(vertices, axis=0, return_inverse=True)
    triangles, count = same.reshape(-1)[triangles], len(vertices)
    # Two corners may be on both sides of a plane between cells of one lattice, and not of all eight.
    for shift in itertools.product((0.0, 0.5), repeat=3):
        place = np.floor((vertices - low) / (2.0 * WELD * size) + shift)
        _, kept, merged = np.unique(place, axis=0, return_index=True, return_inverse=True)
        vertices, triangles = vertices[kept], merged.reshape(-1)[triangles]
    a, b, c = triangles.T
    mesh = Mesh(vertices, triangles[(a != b) & (b != c) & (c != a)])
    if not len(mesh.triangles):
        raise ValueError("every triangle of the mesh has shrunk to a line")
    return mesh, count - len(vertices)


def _checked(mesh: Mesh) -> Mesh:
    """The mesh, if it bounds a solid."""
    _refuse_open(mesh)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    volume = _weighed(mesh).volume
    if volume < 0.0:
        raise ValueError(
            "the mesh is inside out: its triangles must be counter-clockwise as seen from outside; flip its normals"
        )
    if volume <= 1e-9 * size**3:
        raise ValueError("the mesh encloses no volume")
    _refuse_crossing(mesh, size)
    return mesh


def _weighed(mesh: Mesh) -> trimesh.triangles.MassProperties:
    """Volume, centre and inertia at a density of 1, about the mean of the vertices."""
    return trimesh.triangles.mass_properties(mesh.corners - mesh.vertices.mean(axis=0))


def solid_mass(
    mesh: Mesh,
    *,
    density: float | None = None,
    mass: float | None = None,
    centre: ArrayLike | None = None,
    inertia: ArrayLike | None = None,
) -> MassProperties:
    """Mass properties of the solid that `mesh` encloses, exact for its triangles.

    Of `density` [kg/m3] and `mass` [kg] one is
    given; `centre` [m] and the `inertia` about it [kg m2], shape [3, 3], replace the values of a uniform body.

    Raises ValueError for a mass that is not above 0, or an inertia that no body has.
    """
    origin, weighed = mesh.vertices.mean(axis=0), _weighed(mesh)
    total, middle = total_mass(float(weighed.volume), density, mass), np.asarray(weighed.center_mass)
    # The mean of x x^T about the centre, of an inertia J = tr(S) - S.
    moments = np.asarray(weighed.inertia) / weighed.volume
    squares = 0.5 * np.trace(moments) * np.eye(3) - moments
    return _mass_of(total, origin + middle, squares, centre, inertia)


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


def moved_in(mesh: Mesh, distance: float) -> Mesh:
    """The surface with each of its triangles `distance` [m] behind its own, even where it is too thin for that.

    A vertex goes by the v with n . v = -distance for the normals n of all triangles around it; where they are more than
    three, by that which is nearest to it.
    """
    return Mesh(mesh.vertices + distance * mesh.ways_in, mesh.triangles)


def stood_back(mesh: Mesh, distance: float) -> Mesh:
    """The surface `distance` [m] inside of `mesh`, as `moved_in` makes it.

    Raises ValueError where the mesh is too thin for that.
    """
    if distance == 0.0:
        return mesh
    back, sizes = moved_in(mesh, distance), np.linalg.norm(mesh.areas, axis=1)
    is_turned = np.zeros(len(mesh.vertices), dtype=bool)
    lost = (np.einsum("ij,ij->i", back.areas, mesh.normals) <= 0.0) & (sizes > 1e-6 * sizes.max())
    is_turned[mesh.triangles[lost].ravel()] = True
    is_turned |= ~is_deep(mesh, back.vertices, 0.7 * distance)
    if is_turned.any():
        x, y, z = mesh.vertices[np.argmax(is_turned)]
        words = f"it is too thin or too small at x = {x:.4g} m, y = {y:.4g} m, z = {z:.4g} m: "
        words += f"the points that push the fluid stand {distance:.3g} m inside of it"
        if np.median(sizes) < 0.1 * distance**2:  # a scan folds when it is moved in, thick as it is
            words += f"; or it is rough there: make it smoother, of triangles about {2.0 * distance:.2g} m wide"
        raise ValueError(words)
    return back


def is_deep(mesh: Mesh, points: Array, depth: float) -> NDArray[np.bool_]:
    """Whether each of `points` [k, 3] lies inside, at least `depth` [m] from the surface, shape [k]."""
    return contains(mesh, points) & (distance_to_mesh(mesh, points, depth) >= depth)


def contains(mesh: Mesh, points: Array) -> NDArray[np.bool_]:
    """Whether each of `points` [k, 3] lies inside, shape [k]."""
    return mesh.queries.inside(points)


def distance_to_mesh(mesh: Mesh, points: Array, within: float = math.inf) -> Array:
    """Distance from each of `points` [k, 3] to the nearest triangle [m], shape [k].

    Infinite where none is `within` [m].
    """
    nearest = mesh.queries.nearest(points, within)
    found = np.flatnonzero(nearest >= 0)
    distances = np.full(len(points), math.inf)
    distances[found] = _distances(mesh.corners[nearest[found]], points[found])
    return distances


def _distances(corners: Array, points: Array) -> Array:
    """Distance from each of `points` [k, 3] to its triangle [m], of `corners` [k, 3, 3]; shape [k]."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    squares, is_over = np.full(len(points), np.inf), np.ones(len(points), dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        way, arm = end - start, points - start
        share = np.clip(np.einsum("ij,ij->i", arm, way) / np.maximum((way**2).sum(axis=1), 1e-300), 0.0, 1.0)
        squares = np.minimum(squares, ((arm - share[:, None] * way) ** 2).sum(axis=1))
        is_over &= np.einsum("ij,ij->i", arm, np.cross(normal, way)) >= 0.0
    off = np.einsum("ij,ij->i", points - a, normal) ** 2
    return np.sqrt(np.where(is_over, off, squares))


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
            f"the mesh is open: {np.sum(uses < 2)} edges have one triangle, the first {where(pairs[np.argmin(uses)])}; "
            "close its holes"
        )
    ways, uses = np.unique(there, return_counts=True)
    if (uses > 1).any():
        raise ValueError(
            f"neighbouring triangles of the mesh are turned against each other {where(ways[np.argmax(uses)])}; "
            "make its normals consistent"
        )


def _refuse_crossing(mesh: Mesh, size: float) -> None:
    """Just inside and outside of a triangle the surface winds around a point once and not at all."""
    ways = np.roll(mesh.corners, -1, axis=1) - mesh.corners
    area = np.linalg.norm(mesh.areas, axis=1)
    radius = 2.0 * area / np.linalg.norm(ways, axis=2).sum(axis=1)  # of the circle inside of it
    tested = np.flatnonzero(radius > 1e-4 * size)
    steps = np.maximum(0.05 * radius, 1e-5 * size)[tested] / area[tested]
    steps = mesh.areas[tested] * steps[:, None]
    middles = mesh.corners[tested].mean(axis=1)
    for points, wanted in ((middles - steps, 1.0), (middles + steps, 0.0)):
        doubtful = np.flatnonzero(contains(mesh, points) != bool(wanted))[:MOST_ASKED]
        wrong = np.abs(winding_number(mesh, points[doubtful]) - wanted) > 0.25
        if wrong.any():
            x, y, z = points[doubtful[np.argmax(wrong)]]
            raise ValueError(
                f"the mesh crosses itself, near x = {x:.4g} m, y = {y:.4g} m, z = {z:.4g} m; "
                "unite its parts, or make it anew without what overlaps"
            )


def winding_number(mesh: Mesh, points: Array) -> Array:
    """How often the surface winds around each of a few `points` [k, 3]: 1 inside, 0 outside, shape [k]; exact, slow.

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
    ball = trimesh.creation.icosphere(subdivisions=refinements, radius=radius)
    return Mesh(np.asarray(centre, float) + np.asarray(ball.vertices), np.asarray(ball.faces, np.int64))
