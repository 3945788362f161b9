"""The surface of the water as a mesh, beside the particles of a run's USD cache: what an artist renders.

    usd/surface.usda                what a renderer opens: all of scene.usda, with meshes in place of the particles
    usd/surface_manifest.usda       names the attributes that the frames hold
    usd/frames/surface.00000.usdc   the meshes of one frame

The mesh is where the share of space that particles fill, summed over them with a smoothing kernel, falls to that of a
flat surface half a spacing beyond the outermost particles (`flat_share`). It is then moved along its normals by the
little that is too much or missing, where there is spray, so that it encloses what the particles stand for.

pysplashsurf makes it, by marching cubes (Löschner, Böttcher, Jeske & Bender 2023, Weighted Laplacian smoothing for
surface reconstruction of particle-based fluids).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdShade, Vt

from warpsph.output.usd_files import (
    FLUID_SCOPE,
    LOOK_SCOPE,
    SURFACE_SCOPE,
    name_clips,
    new_stage,
    off_stage,
    publish,
)

SURFACE_CLIPS = "surfaces"
# In spacings: the smoothing length of the kernel, whose support is twice that, and the edge of a marching cube.
SMOOTHING, CUBE = 1.0, 0.5
# How near the volume of a mesh comes to the volume of its particles, over the latter [-].
CLOSE = 1e-6
# A sheet of particles, of a 2-D scene, is made so many particles thick.
LAYERS = 5
MESH_ATTRIBUTES = {
    "points": Sdf.ValueTypeNames.Point3fArray,
    "faceVertexCounts": Sdf.ValueTypeNames.IntArray,
    "faceVertexIndices": Sdf.ValueTypeNames.IntArray,
    "extent": Sdf.ValueTypeNames.Float3Array,
}


class SurfaceError(Exception):
    """No surface can be made; the text is one line for the user."""


@dataclass(frozen=True)
class Enclosed:
    """What the mesh of a fluid comes to in one frame.

    Attributes:
        frame: Its number.
        fluid: The name of the fluid's prim.
        share: Volume enclosed over the volume of the particles [-].
        moved: How far it was moved outwards for that, in spacings [-].
        is_closed: Whether it is watertight.
    """

    frame: int
    fluid: str
    share: float
    moved: float
    is_closed: bool


def cubic_spline(q: np.ndarray) -> np.ndarray:
    """The cubic spline of Monaghan & Lattanzio (1985) at r = q h, 1 at q = 0."""
    return np.where(q < 1.0, 1.0 - 1.5 * q**2 + 0.75 * q**3, 0.25 * np.clip(2.0 - q, 0.0, None) ** 3)


@cache
def flat_share(smoothing: float) -> float:
    """The sum over particles of V W half a spacing above a flat surface, averaged along it [-].

    The particles fill a half space as a cubic lattice of unit spacing; each counts with the volume V = 1 / (sum of W at
    its place) that pysplashsurf gives it. `smoothing` is h in spacings.
    """
    reach = int(np.ceil(2.0 * smoothing)) + 1
    along = np.arange(-reach, reach + 1.0)
    depths = np.arange(2.0 * reach + 2.0)

    def sums(x: float, y: float, z: float) -> np.ndarray:
        """Of W over each layer, at a place z above the outermost."""
        r = np.sqrt((along[:, None, None] - x) ** 2 + (along[:, None] - y) ** 2 + (z + depths) ** 2)
        return cubic_spline(r / smoothing).sum(axis=(0, 1))

    volume = np.array([1.0 / sums(0.0, 0.0, -depth).sum() for depth in depths[: reach + 1]])
    volume = np.append(volume, np.full(len(depths) - len(volume), volume[-1]))
    stations = (np.arange(8) + 0.5) / 8.0 - 0.5
    return float(np.mean([sums(x, y, 0.5) @ volume for x in stations for y in stations]))


def mesh_around(points: np.ndarray, spacing: float, threads: int = 1) -> tuple[np.ndarray, np.ndarray, float]:
    """The surface around particles, which encloses as much as they stand for.

    Args:
        points: [m], shape [n, 3]; none where all of a fluid has left. Those of a sheet, all with one y, are made
            `LAYERS` particles thick.
        spacing: Of the particles [m].
        threads: How many cores to use; pysplashsurf takes it from RAYON_NUM_THREADS when it is more than one.

    Returns:
        Vertices [m], float32, shape [k, 3]; triangles, counter-clockwise from outside, int32, shape [m, 3]; and how far
        the level set has been moved outwards to have the volume of the particles, in spacings.
    """
    import pysplashsurf

    points = thick(np.asarray(points, dtype=np.float64), spacing)
    if not len(points):
        return np.zeros((0, 3), dtype=np.float32), np.zeros((0, 3), dtype=np.int32), 0.0
    found = pysplashsurf.reconstruct_surface(
        points / spacing,
        particle_radius=0.5,
        # Both in radii of a particle, whatever its documentation says.
        smoothing_length=2.0 * SMOOTHING,
        cube_size=2.0 * CUBE,
        iso_surface_threshold=flat_share(SMOOTHING),
        multi_threading=threads > 1,
    )
    vertices = np.asarray(found.mesh.vertices, dtype=np.float64) * spacing
    triangles = np.asarray(found.mesh.triangles).astype(np.int32)
    if enclosed_volume(vertices, triangles) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    vertices, moved = with_volume(vertices, triangles, len(points) * spacing**3)
    return vertices.astype(np.float32), triangles, moved / spacing


def with_volume(vertices: np.ndarray, triangles: np.ndarray, volume: float) -> tuple[np.ndarray, float]:
    """A closed mesh, each vertex moved along its normal by the same way, so that it encloses `volume` [m3].

    To first order the volume changes by the way times the sum over vertices of |A|, a third of the area vectors of the
    triangles around; three times over at most, it is met.

    Returns:
        The vertices [m], and how far they have been moved outwards [m].
    """
    middle = vertices.mean(axis=0)
    at = np.ascontiguousarray((vertices - middle).T)  # a row for each direction, which NumPy goes through fastest
    corners = np.ascontiguousarray(triangles.T)
    moved = 0.0
    for _ in range(3):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (at[:, corner] for corner in corners)
        bx, by, bz, cx, cy, cz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
        normals = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx  # twice the areas
        missing = volume - (ax @ normals[0] + ay @ normals[1] + az @ normals[2]) / 6.0
        if abs(missing) < CLOSE * volume:
            break
        around = np.stack([sum(np.bincount(c, n, len(vertices)) for c in corners) for n in normals])
        size = np.sqrt((around**2).sum(axis=0))
        way = missing / (size.sum() / 6.0)
        at += way * around / np.maximum(size, 1e-300)
        moved += way
    return at.T + middle, moved


def is_sheet(points: np.ndarray) -> bool:
    """Whether particles lie in one x-z plane."""
    return bool(len(points) and np.ptp(points[:, 1]) == 0.0)


def thick(points: np.ndarray, spacing: float) -> np.ndarray:
    """The particles of a sheet, so many times that it is `LAYERS` thick; others as they are."""
    if not is_sheet(points):
        return points
    across = (np.arange(LAYERS) - 0.5 * (LAYERS - 1)) * spacing
    return (points[None] + across[:, None, None] * [0.0, 1.0, 0.0]).reshape(-1, 3)


def particle_volume(points: np.ndarray, spacing: float) -> float:
    """The volume that particles stand for [m3]; a sheet is as thick as it is made."""
    return len(points) * (LAYERS if is_sheet(points) else 1) * spacing**3


def enclosed_volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """The volume that a closed mesh encloses [m3], by the divergence theorem."""
    a, b, c = (vertices[triangles[:, k]].astype(np.float64) - vertices.mean(axis=0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def is_watertight(triangles: np.ndarray) -> bool:
    """Whether every edge of the triangles is there once in each direction."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).astype(np.int64)
    count = int(edges.max(initial=0)) + 1
    ways, back = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    ways.sort()
    return bool(np.all(np.diff(ways) > 0)) and np.array_equal(ways, np.sort(back))


def make_surface(folder: Path, threads: int = 1) -> Iterator[Enclosed]:
    """Make the meshes of all frames of the USD cache in `folder`, and then the file that shows them.

    Yields:
        What each mesh comes to, frame by frame; a fluid that has left whole has none.

    Raises:
        SurfaceError: pysplashsurf is not installed, there is no cache, or it is damaged.
        OSError: a file could not be written.
    """
    os.environ.setdefault("RAYON_NUM_THREADS", str(threads))
    try:
        import pysplashsurf  # noqa: F401
    except ImportError:
        raise SurfaceError("a surface needs pysplashsurf: python -m pip install pysplashsurf") from None
    root = folder / "scene.usda"
    if not root.exists():
        raise SurfaceError(f"{folder}: no USD cache is here (it has no scene.usda)")
    stage = _opened(Usd.Stage.Open, root)
    scope = stage.GetPrimAtPath(FLUID_SCOPE)
    fluids = {prim.GetName(): UsdGeom.Points(prim) for prim in scope.GetChildren() if prim.IsA(UsdGeom.Points)}
    rate = stage.GetTimeCodesPerSecond()
    frames = range(round(stage.GetStartTimeCode()), round(stage.GetEndTimeCode()) + 1)
    publish(off_stage(_declare(list(fluids), rate), ".usda"), folder / "surface_manifest.usda")
    for frame in frames:
        _opened(Sdf.Layer.FindOrOpen, folder / "frames" / f"fluid.{frame:05d}.usdc")
        layer = off_stage(_declare(list(fluids), rate), ".usdc")
        layer.startTimeCode = layer.endTimeCode = frame
        for name, prim in fluids.items():
            points = np.array(prim.GetPointsAttr().Get(frame), dtype=np.float64).reshape(-1, 3)
            if not len(points):  # all of it has left
                continue
            spacing = float(prim.GetWidthsAttr().Get()[0])
            vertices, triangles, moved = mesh_around(points, spacing, threads)
            for attribute, value in _values(vertices, triangles).items():
                layer.SetTimeSample(f"{SURFACE_SCOPE}/{name}.{attribute}", frame, value)
            if len(points):
                share = enclosed_volume(vertices, triangles) / particle_volume(points, spacing)
                yield Enclosed(frame, name, share, moved, is_watertight(triangles))
        publish(layer, folder / "frames" / _frame_name(frame))
    _write_root(folder, list(fluids), frames, rate)


def _opened(way: Callable[[str], Any], path: Path) -> Any:
    """A stage or layer of the cache. Raises SurfaceError where it cannot be read."""
    try:
        found = way(str(path)) if path.exists() else None
    except Tf.ErrorException:
        found = None
    if found is None:
        raise SurfaceError(f"{path}: is missing or damaged; `check` of the run tells what else is")
    return found


def _frame_name(frame: int) -> str:
    return f"surface.{frame:05d}.usdc"


def _values(vertices: np.ndarray, triangles: np.ndarray) -> dict[str, Any]:
    extent = np.stack([vertices.min(axis=0), vertices.max(axis=0)]) if len(vertices) else vertices
    return {
        "points": Vt.Vec3fArray.FromNumpy(vertices),
        "faceVertexCounts": Vt.IntArray.FromNumpy(np.full(len(triangles), 3, dtype=np.int32)),
        "faceVertexIndices": Vt.IntArray.FromNumpy(triangles.ravel()),
        "extent": Vt.Vec3fArray.FromNumpy(extent),
    }


def _declare(names: list[str], rate: float) -> Usd.Stage:
    """A stage that declares the meshes, without a value."""
    stage = new_stage(rate)
    UsdGeom.Scope.Define(stage, SURFACE_SCOPE)
    for name in names:
        mesh = UsdGeom.Mesh.Define(stage, f"{SURFACE_SCOPE}/{name}")
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        for attribute, value_type in MESH_ATTRIBUTES.items():
            mesh.GetPrim().CreateAttribute(attribute, value_type, custom=False)
    return stage


def _write_root(folder: Path, names: list[str], frames: range, rate: float) -> None:
    """All of scene.usda, its particles hidden, and the meshes of the frames with the materials of their fluids."""
    stage = _declare(names, rate)
    stage.SetStartTimeCode(frames[0])
    stage.SetEndTimeCode(frames[-1])
    for name in names:
        mesh = stage.GetPrimAtPath(f"{SURFACE_SCOPE}/{name}")
        look = UsdShade.Material(stage.OverridePrim(f"{LOOK_SCOPE}/{name}"))
        UsdShade.MaterialBindingAPI.Apply(mesh).Bind(look)
        points = UsdGeom.Imageable(stage.OverridePrim(f"{FLUID_SCOPE}/{name}"))
        points.CreateVisibilityAttr(UsdGeom.Tokens.invisible)
    layer = off_stage(stage, ".usda")
    layer.subLayerPaths.append("./scene.usda")
    assets = [f"./frames/{_frame_name(frame)}" for frame in frames]
    name_clips(layer, SURFACE_SCOPE, SURFACE_CLIPS, "./surface_manifest.usda", assets)
    publish(layer, folder / "surface.usda")
