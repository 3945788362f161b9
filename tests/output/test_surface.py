"""The surface of water as a mesh: closed, as large as its particles, and where a renderer finds it."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade

from warpsph.output.surface import (
    LAYERS,
    SMOOTHING,
    SurfaceError,
    enclosed_volume,
    flat_share,
    is_watertight,
    make_surface,
    mesh_around,
    particle_volume,
    with_volume,
)
from warpsph.output.usd import UsdCache
from warpsph.output.usd_check import check_cache
from warpsph.shapes.mesh import box_mesh
from warpsph.state import Snapshot

SPACING = 0.05


def lattice(*counts: int) -> np.ndarray:
    axes = (SPACING * (np.arange(count) + 0.5) for count in counts)
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def test_volume_and_edges_of_a_box():
    mesh = box_mesh([0.0, 0.0, 0.0], [1.0, 2.0, 3.0])
    assert enclosed_volume(mesh.vertices, mesh.triangles) == pytest.approx(6.0)
    assert is_watertight(mesh.triangles)
    assert not is_watertight(mesh.triangles[1:])
    assert not is_watertight(np.concatenate([mesh.triangles[:1, ::-1], mesh.triangles[1:]]))


def test_a_mesh_takes_the_volume_that_it_is_told():
    mesh = box_mesh([0.0, 0.0, 0.0], [1.0, 2.0, 3.0])
    vertices, moved = with_volume(mesh.vertices, mesh.triangles, 6.5)
    assert enclosed_volume(vertices, mesh.triangles) == pytest.approx(6.5, rel=1e-6)
    assert 0.0 < moved < 0.05


def test_a_flat_surface_lies_half_a_spacing_beyond_its_particles():
    pytest.importorskip("pysplashsurf")
    assert 0.0 < flat_share(SMOOTHING) < 1.0
    points = lattice(14, 14, 14)
    vertices, _, moved = mesh_around(points, SPACING)
    middle = np.abs(vertices[:, :2] - 7 * SPACING).max(axis=1) < 3 * SPACING
    top = vertices[middle & (vertices[:, 2] > 7 * SPACING)]
    assert len(top) > 10
    assert top[:, 2].mean() == pytest.approx(14 * SPACING, abs=0.05 * SPACING)
    assert abs(moved) < 0.05  # the level set alone is nearly right


@pytest.mark.parametrize("counts", [(12, 8, 6), (1, 1, 1), (20, 15, 1)])
def test_a_mesh_is_closed_and_encloses_its_particles(counts):
    pytest.importorskip("pysplashsurf")
    points = lattice(*counts) + np.random.default_rng(1).uniform(-0.2, 0.2, (np.prod(counts), 3)) * SPACING
    vertices, triangles, _ = mesh_around(points, SPACING)
    assert is_watertight(triangles)
    assert enclosed_volume(vertices, triangles) == pytest.approx(particle_volume(points, SPACING), rel=0.01)


def test_a_sheet_is_made_thick():
    pytest.importorskip("pysplashsurf")
    points = lattice(20, 1, 10) * [1.0, 0.0, 1.0]
    vertices, triangles, _ = mesh_around(points, SPACING)
    assert np.ptp(vertices[:, 1]) == pytest.approx(LAYERS * SPACING, rel=0.1)
    assert enclosed_volume(vertices, triangles) == pytest.approx(200 * LAYERS * SPACING**3, rel=0.01)


@pytest.fixture
def cache(tmp_path):
    pytest.importorskip("pysplashsurf")
    box = ([0.0, 0.0, 0.0], [1.0, 1.0, 1.0])
    cache = UsdCache(
        tmp_path / "usd",
        fluids={"water": "#3f86bf"},
        walls={},
        spacing=SPACING,
        extent=box,
        frames_per_second=10.0,
    )
    for frame in range(2):
        points = lattice(8, 8, 6) + 0.1 * frame * np.eye(3)[0]
        count = len(points)
        still = np.tile(np.float32([1.0, 0.0, 0.0]), (count, 1))
        arrays = {"density": np.full(count, 1000.0), "pressure": np.zeros(count, np.float32)}
        whole = {"fluid": np.zeros(count, np.int32), "id": np.arange(count)}
        cache.write(Snapshot(time=0.1 * frame, step=frame, position=points, velocity=still, **arrays, **whole))
    return cache


def test_the_cache_holds_a_mesh_in_every_frame(cache):
    found = list(make_surface(cache.folder))
    assert [(mesh.frame, mesh.fluid, mesh.is_closed) for mesh in found] == [(0, "water", True), (1, "water", True)]
    assert all(mesh.share == pytest.approx(1.0, abs=0.01) for mesh in found)
    stage = Usd.Stage.Open(str(cache.folder / "surface.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Surface/water"))
    lows = [np.array(mesh.GetPointsAttr().Get(frame)).min(axis=0)[0] for frame in (0, 1)]
    assert lows[1] - lows[0] == pytest.approx(0.1, abs=0.005)
    assert UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0].GetPath() == "/World/Looks/water"
    particles = UsdGeom.Imageable(stage.GetPrimAtPath("/World/Fluid/water"))
    assert particles.ComputeVisibility(0) == "invisible"
    assert check_cache(cache.folder) == []


def test_a_fluid_that_has_left_has_no_surface(cache):
    nothing = np.zeros((0, 3), np.float32)
    arrays = {name: np.zeros(0, np.float32) for name in ("density", "pressure")}
    whole = {"fluid": np.zeros(0, np.int32), "id": np.zeros(0, np.int64)}
    cache.write(Snapshot(time=0.2, step=2, position=nothing.astype(float), velocity=nothing, **arrays, **whole))
    assert [mesh.frame for mesh in make_surface(cache.folder)] == [0, 1]
    assert check_cache(cache.folder) == []


def test_a_hole_in_the_surface_is_told(cache):
    list(make_surface(cache.folder))
    path = cache.folder / "frames" / "surface.00001.usdc"
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Surface/water"))
    corners = list(mesh.GetFaceVertexIndicesAttr().Get(1))[3:]
    mesh.GetFaceVertexIndicesAttr().Set(corners, 1)
    mesh.GetFaceVertexCountsAttr().Set([3] * (len(corners) // 3), 1)
    stage.Save()
    assert check_cache(cache.folder) == ["/World/Surface/water, frame 1: the surface is not watertight"]


@pytest.mark.parametrize("damage", ["gone", "cut", "root"])
def test_a_damaged_cache_is_told_by_its_file(cache, damage):
    path = cache.folder / ("scene.usda" if damage == "root" else "frames/fluid.00001.usdc")
    path.unlink() if damage == "gone" else path.write_bytes(b"xx")
    with pytest.raises(SurfaceError, match=rf"^{path}: is missing or damaged; `check` of the run tells what else is$"):
        list(make_surface(cache.folder))
