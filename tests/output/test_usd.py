"""The USD cache: what it holds is read back in another process; what can go wrong with it is done to it."""

import json
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from warpsph.output.usd import UsdCache
from warpsph.output.usd_check import check_cache
from warpsph.output.usd_scenery import DrawnBody
from warpsph.state import Snapshot

SPACING = 0.01
BOX = ([-1.0, -0.5, 0.0], [1.0, 0.5, 1.0])
FRAMES_PER_SECOND = 30.0
SPIN = 3.0  # [rad/s]
FLUIDS = {"slide": "#8a6a4a", "deep-water": "#1f6fb2"}
WALLS = {"flume": np.array([[-0.5, 0.3], [0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 0.5]])}


def spinning_blob(frame: int) -> Snapshot:
    """Two fluids that turn together as a rigid disc about the y axis while they fall."""
    time = frame / FRAMES_PER_SECOND
    x, z = (axis.ravel() for axis in np.mgrid[-10:11, -10:11] * SPACING)
    cos, sin = np.cos(SPIN * time), np.sin(SPIN * time)
    rest = np.zeros_like(x)
    around = np.stack([cos * x - sin * z, rest, sin * x + cos * z], axis=1)
    position = around + np.array([0.3 * time, 0.0, 0.5 - 0.5 * 9.81 * time**2])
    velocity = SPIN * np.stack([-around[:, 2], rest, around[:, 0]], axis=1) + [0.3, 0.0, -9.81 * time]
    count = len(x)
    return Snapshot(
        time=time,
        step=10 * frame,
        position=position,
        velocity=velocity.astype(np.float32),
        density=np.full(count, 1000.0) + x,
        pressure=(1000.0 * (0.1 - z)).astype(np.float32),
        fluid=(np.arange(count) % 3 > 0).astype(np.int32),
        id=np.arange(count, dtype=np.int64),
    )


def open_cache(folder: Path, **options) -> UsdCache:
    return UsdCache(
        folder,
        fluids=FLUIDS,
        walls=WALLS,
        spacing=SPACING,
        extent=BOX,
        frames_per_second=FRAMES_PER_SECOND,
        provenance={"version": "0.1.0", "device": {"name": "cpu", "cores": 2}, "seed": None},
        **options,
    )


def in_a_fresh_process(program: str, folder: Path) -> str:
    """What `program` prints, with `folder` as its argument."""
    done = subprocess.run([sys.executable, "-c", program, folder], capture_output=True, text=True, check=True)
    return done.stdout


def change_frame(folder: Path, frame: int, attribute: str, change) -> None:
    """Put `change(value)` in the place of one attribute of the first fluid."""
    layer = Sdf.Layer.FindOrOpen(str(folder / f"frames/fluid.{frame:05d}.usdc"))
    path = f"/World/Fluid/slide.{attribute}"
    layer.SetTimeSample(path, frame, change(np.array(layer.QueryTimeSample(path, frame))))
    layer.Save()


@pytest.fixture(scope="module")
def sound_cache(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "usd"
    cache = open_cache(folder)
    for frame in range(5):
        cache.write(spinning_blob(frame))
    return folder


@pytest.fixture
def cache_copy(sound_cache, tmp_path) -> Path:
    return Path(shutil.copytree(sound_cache, tmp_path / "usd"))


READ_BACK = """
import json, sys
import numpy as np
from pxr import Usd, UsdGeom
stage = Usd.Stage.Open(sys.argv[1] + "/scene.usda")
points = [UsdGeom.Points(prim) for prim in stage.GetPrimAtPath("/World/Fluid").GetChildren()]
wall = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Walls/flume"))
print(json.dumps({
    "up": UsdGeom.GetStageUpAxis(stage),
    "metre": UsdGeom.GetStageMetersPerUnit(stage),
    "range": [stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()],
    "provenance": stage.GetRootLayer().customLayerData,
    "names": [p.GetPrim().GetName() for p in points],
    "labels": [p.GetPrim().GetDisplayName() for p in points],
    "position": [np.array(p.GetPointsAttr().Get(3)).tolist() for p in points],
    "ids": [list(p.GetIdsAttr().Get(3)) for p in points],
    "pressure": [list(UsdGeom.PrimvarsAPI(p).GetPrimvar("pressure").Get(3)) for p in points],
    "widths": [list(p.GetWidthsAttr().Get()) for p in points],
    "colors": [list(p.GetDisplayColorPrimvar().Get()[0]) for p in points],
    "types": [str(a.GetTypeName()) for a in points[0].GetPrim().GetAttributes() if a.GetName().startswith("primvars:")],
    "wall": [wall.GetPurposeAttr().Get(), len(wall.GetFaceVertexCountsAttr().Get())],
}))
"""


def test_rheology_has_two_primvars_more(tmp_path):
    blob = spinning_blob(0)
    mu = np.linspace(1.0, 1000.0, len(blob.id)).astype(np.float32)
    blob = replace(blob, apparent_viscosity=mu, yielded=(mu < 500.0).astype(np.int32))
    cache = open_cache(tmp_path / "usd", rheology=True)
    cache.write(blob)
    assert check_cache(cache.folder) == []
    stage = Usd.Stage.Open(str(cache.root))
    slide = stage.GetPrimAtPath("/World/Fluid/slide")
    np.testing.assert_array_equal(slide.GetAttribute("primvars:apparent_viscosity").Get(0), mu[blob.fluid == 0])
    np.testing.assert_array_equal(slide.GetAttribute("primvars:yielded").Get(0), blob.yielded[blob.fluid == 0])
    del stage
    change_frame(cache.folder, 0, "primvars:yielded", lambda values: values[1:])
    assert any("146 primvars:yielded" in problem for problem in check_cache(cache.folder))


def test_walls_in_space_keep_their_faces(tmp_path):
    """Two faces of a box, an edge in common: corners, winding and extent are read back as they were given."""
    faces = np.array(
        [
            [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [1.5, 0.5, 0.0], [0.0, 0.5, 0.0]],
            [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.5, 0.75], [0.0, 0.0, 0.75]],
        ]
    )
    cache = UsdCache(
        tmp_path / "usd", fluids=FLUIDS, walls={"box": faces}, spacing=SPACING, extent=BOX, frames_per_second=30.0
    )
    cache.write(spinning_blob(0))
    assert check_cache(cache.folder) == []
    stage = Usd.Stage.Open(str(cache.root))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Walls/box"))
    points, indices = np.array(mesh.GetPointsAttr().Get()), np.array(mesh.GetFaceVertexIndicesAttr().Get())
    np.testing.assert_array_equal(points[indices.reshape(-1, 4)], faces)
    np.testing.assert_array_equal(mesh.GetExtentAttr().Get(), [[0.0, 0.0, 0.0], [1.5, 0.5, 0.75]])


def test_a_fresh_process_reads_what_was_written(sound_cache):
    found = json.loads(in_a_fresh_process(READ_BACK, sound_cache))
    snapshot = spinning_blob(3)
    assert (found["up"], found["metre"], found["range"]) == ("Z", 1.0, [0.0, 4.0, 30.0])
    assert found["provenance"] == {"version": "0.1.0", "device": {"name": "cpu", "cores": 2}, "seed": "None"}
    assert found["names"] == ["slide", "deep_water"]
    assert found["labels"] == ["slide", "deep-water"]
    for fluid in (0, 1):
        members = snapshot.fluid == fluid
        np.testing.assert_array_equal(found["position"][fluid], snapshot.position[members].astype(np.float32))
        np.testing.assert_array_equal(found["ids"][fluid], snapshot.id[members])
        np.testing.assert_array_equal(np.float32(found["pressure"][fluid]), snapshot.pressure[members])
        assert found["widths"][fluid] == [np.float32(SPACING)]
    # 0x8a / 255 = 0.5412 in sRGB is 0.2542 in linear light (IEC 61966-2-1).
    np.testing.assert_allclose(found["colors"][0], [0.2542, 0.1441, 0.0685], atol=1e-4)
    assert set(found["types"]) == {"float[]", "int[]", "color3f[]"}
    assert found["wall"] == ["default", 3]


def test_the_checker_and_usd_find_nothing_wrong(sound_cache):
    program = "import sys; from warpsph.output.usd_check import check_cache; print(check_cache(sys.argv[1]))"
    assert in_a_fresh_process(program, sound_cache) == "[]\n"


def test_each_frame_opens_by_itself(sound_cache):
    stage = Usd.Stage.Open(str(sound_cache / "frames/fluid.00002.usdc"))
    assert stage.GetStartTimeCode() == stage.GetEndTimeCode() == 2.0
    assert stage.GetRootLayer().customLayerData == {"time": 2 / FRAMES_PER_SECOND, "step": 20}
    box = UsdGeom.BBoxCache(2.0, ["default"]).ComputeWorldBound(stage.GetDefaultPrim()).ComputeAlignedRange()
    np.testing.assert_allclose(box.GetMax(), spinning_blob(2).position.max(axis=0) + SPACING / 2, rtol=1e-6)


@pytest.mark.parametrize(
    ("attribute", "change", "complaint"),
    [
        ("velocities", lambda values: values[:-1], "147 points, 2 corners of the extent, 146 velocities"),
        ("primvars:density", lambda values: values[1:], "147 points, 2 corners of the extent, 146 primvars:density"),
        ("points", lambda values: np.where(np.arange(147)[:, None] == 7, np.nan, values), "points is not finite"),
        ("extent", lambda values: values + 0.02, "particles reach out of the extent"),
        ("ids", lambda values: np.where(values == 3, 0, values), "ids are not unique"),
        ("primvars:speed", lambda values: 2 * values, "primvars:speed is not the length of velocities"),
        ("points", lambda values: values[::-1].copy(), "147 particles are not where their velocities take them"),
    ],
)
def test_damage_to_a_frame_is_found(cache_copy, attribute, change, complaint):
    change_frame(cache_copy, 3, attribute, change)
    problems = check_cache(cache_copy)
    assert any(complaint in problem and "/World/Fluid/slide, frame 3" in problem for problem in problems), problems


def test_a_wrong_frame_rate_is_found(cache_copy):
    root = cache_copy / "scene.usda"
    root.write_text(root.read_text().replace("timeCodesPerSecond = 30", "timeCodesPerSecond = 10"))
    assert any("not where their velocities take them" in problem for problem in check_cache(cache_copy))


def test_a_value_in_the_root_that_hides_the_frames_is_found(cache_copy):
    layer = Sdf.Layer.FindOrOpen(str(cache_copy / "scene.usda"))
    layer.GetAttributeAtPath("/World/Fluid/slide.extent").default = [Gf.Vec3f(-9.0), Gf.Vec3f(9.0)]
    layer.Save()
    assert "/World/Fluid/slide, frame 0: extent does not come from the frame's own file" in check_cache(cache_copy)


def test_files_that_are_gone_or_cut_short_are_found(cache_copy, tmp_path):
    frame = cache_copy / "frames/fluid.00001.usdc"
    content = frame.read_bytes()
    frame.write_bytes(content[: len(content) // 2])
    (cache_copy / "frames/fluid.00004.usdc").unlink()
    cut_short, gone = check_cache(cache_copy)
    assert cut_short.startswith("./frames/fluid.00001.usdc: does not open: ")
    assert gone == "./frames/fluid.00004.usdc: missing"
    (problem,) = check_cache(tmp_path / "nowhere")
    assert "scene.usda: does not open" in problem


def test_an_earlier_cache_is_refused_or_begun_anew(cache_copy):
    with pytest.raises(FileExistsError, match="holds the USD cache of an earlier run"):
        open_cache(cache_copy)
    open_cache(cache_copy, resume_at=0).write(spinning_blob(0))
    assert sorted(path.name for path in cache_copy.rglob("*.usd*")) == [
        "fluid.00000.usdc",
        "manifest.usda",
        "scene.usda",
        "static.usdc",
    ]


def test_a_cache_is_continued_at_a_frame(cache_copy):
    cache = open_cache(cache_copy, resume_at=2)
    assert cache.frame_count == 2
    assert Usd.Stage.Open(str(cache.root)).GetEndTimeCode() == 1.0
    assert check_cache(cache_copy) == []
    for frame in (2, 3):
        cache.write(spinning_blob(frame))
    assert check_cache(cache_copy) == []
    assert len(list((cache_copy / "frames").iterdir())) == 4
    with pytest.raises(FileNotFoundError, match=r"this frame of the cache is missing: .*fluid\.00004\.usdc"):
        open_cache(cache_copy, resume_at=5)


def test_a_frame_that_cannot_be_written_is_an_error_of_the_machine(cache_copy):
    cache = open_cache(cache_copy, resume_at=5)
    shutil.rmtree(cache_copy / "frames")
    (cache_copy / "frames").write_text("in the way")
    with pytest.raises(OSError, match="could not be written") as failed:
        cache.write(spinning_blob(5))
    assert failed.value.filename == str(cache_copy / "frames/fluid.00005.usdc")
    assert cache.frame_count == 5


WRITE_UNTIL_KILLED = """
import importlib.util, itertools, sys
spec = importlib.util.spec_from_file_location("cache_program", sys.argv[1])
program = importlib.util.module_from_spec(spec)
spec.loader.exec_module(program)
cache = program.open_cache(sys.argv[2])
for frame in itertools.count():
    cache.write(program.spinning_blob(frame))
    print(frame, flush=True)
"""


@pytest.mark.parametrize("lines", [1, 4, 11])
def test_a_killed_run_leaves_a_cache_with_all_finished_frames(tmp_path, lines):
    folder = tmp_path / "usd"
    command = [sys.executable, "-c", WRITE_UNTIL_KILLED, __file__, folder]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
        for _ in range(lines):
            writer.stdout.readline()
        writer.send_signal(signal.SIGKILL)
        reported = lines + len(writer.stdout.readlines())
    frame_count = Usd.Stage.Open(str(folder / "scene.usda")).GetEndTimeCode() + 1
    assert frame_count >= reported
    assert check_cache(folder) == []
    # What the kill left half done goes when the cache is continued.
    open_cache(folder, resume_at=reported)
    assert len(list((folder / "frames").iterdir())) == reported


def test_body_is_a_mesh_under_an_animated_xform(tmp_path):
    """Its corners land where the body is in each frame, before and after the cache is continued."""
    corners = np.array([[-0.1, 0.0, -0.1], [0.1, 0.0, -0.1], [0.1, 0.0, 0.1]])
    bodies = {"raft": DrawnBody(corners, [[0, 1, 2]], "#8a5a2b")}
    quarter = np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)])  # from z to x

    def make(resume_at):
        return UsdCache(
            tmp_path,
            fluids={"water": "#3f86bf"},
            walls={},
            bodies=bodies,
            spacing=0.02,
            extent=BOX,
            frames_per_second=10.0,
            resume_at=resume_at,
        )

    def snapshot(time):
        points = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
        still, ones = np.zeros((2, 3), np.float32), np.ones(2)
        return Snapshot(time, 0, points, still, ones, ones, np.zeros(2, int), np.arange(2))

    cache = make(None)
    cache.write(snapshot(0.0), [(np.array([1.0, 0.0, 2.0]), np.array([0.0, 0.0, 0.0, 1.0]))])
    make(1).write(snapshot(0.1), [(np.array([1.5, 0.0, 2.0]), quarter)])
    assert check_cache(tmp_path) == []
    stage = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Bodies/raft/raft"))
    first = np.array(mesh.GetPointsAttr().Get())[:3] + np.array([0.0, 0.02, 0.0])
    np.testing.assert_allclose(first, corners, atol=1e-6)
    for frame, place in ((0, [0.9, 0.0, 1.9]), (1, [1.4, 0.0, 2.1])):
        moved = mesh.ComputeLocalToWorldTransform(frame).Transform(Gf.Vec3d(*corners[0].tolist()))
        np.testing.assert_allclose(moved, place, atol=1e-6)


def test_walls_can_be_hidden_and_fields_left_out(tmp_path):
    cache = open_cache(tmp_path / "usd", shows_walls=False, fields=False)
    cache.write(spinning_blob(0))
    assert check_cache(cache.folder) == []
    stage = Usd.Stage.Open(str(cache.root))
    walls = stage.GetPrimAtPath("/World/Walls").GetChildren()
    assert {UsdGeom.Mesh(wall).GetPurposeAttr().Get() for wall in walls} == {"guide"}
    fluid = stage.GetPrimAtPath("/World/Fluid").GetChildren()[0]
    assert fluid.HasAttribute("primvars:speed")
    assert not fluid.HasAttribute("primvars:density") and not fluid.HasAttribute("primvars:pressure")


def test_the_camera_has_the_whole_scene_in_its_picture(tmp_path):
    """Every corner of the box around fluid and walls lies between the edges of the camera's frustum."""
    cache = open_cache(tmp_path / "usd")
    cache.write(spinning_blob(0))
    stage = Usd.Stage.Open(str(cache.root))
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera(0.0)
    frustum = camera.frustum
    corners = [Gf.Vec3d(x, y, z) for x in (BOX[0][0], BOX[1][0]) for y in (-0.5, 0.5) for z in (0.0, 1.0)]
    assert all(frustum.Intersects(corner) for corner in corners)
    assert camera.transform.TransformDir(Gf.Vec3d(0, 1, 0))[2] > 0.5  # upright


def test_every_fluid_has_a_preview_material_of_its_colour(tmp_path):
    cache = open_cache(tmp_path / "usd")
    cache.write(spinning_blob(0))
    stage = Usd.Stage.Open(str(cache.root))
    for prim in stage.GetPrimAtPath("/World/Fluid").GetChildren():
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        shader, _, _ = material.ComputeSurfaceSource()
        assert shader.GetIdAttr().Get() == "UsdPreviewSurface"
        (shown,) = UsdGeom.Points(prim).GetDisplayColorAttr().Get()
        assert shader.GetInput("diffuseColor").Get() == shown


@pytest.mark.parametrize(
    ("gone", "complaint"),
    [("/World/Camera", "has no camera"), ("/World/Lights", "has no light"), ("/World/Looks", "has no material")],
)
def test_a_cache_without_what_an_artist_needs_is_told(tmp_path, gone, complaint):
    cache = open_cache(tmp_path / "usd")
    cache.write(spinning_blob(0))
    layer = Sdf.Layer.FindOrOpen(str(cache.folder / "static.usdc"))
    del layer.GetPrimAtPath("/World").nameChildren[gone.rpartition("/")[2]]
    layer.Save()
    assert any(complaint in problem for problem in check_cache(cache.folder))
