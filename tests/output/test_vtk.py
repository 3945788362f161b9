"""Particles for ParaView, read back by meshio and by Python's own reader of XML."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from scenes import pool, scene, tank
from warpsph.output.vtk import Particles
from warpsph.run import Run
from warpsph.state import Snapshot

TANK = scene(
    "A tank far from the origin",
    0.1,
    [tank(1.0, 1.0, left=4000.0)],
    [pool(0.5)],
    "output: {pictures: false, usd: false, vtk: true, frames_per_second: 50}",
    end_time=0.05,
)


def snapshot(frame: int, **fields: np.ndarray) -> Snapshot:
    random = np.random.default_rng(frame)
    return Snapshot(
        time=0.5 * frame,
        step=10 * frame,
        position=random.normal(size=(7, 3)),
        velocity=random.normal(size=(7, 3)).astype(np.float32),
        density=random.uniform(900.0, 1100.0, 7),
        pressure=random.normal(size=7).astype(np.float32),
        fluid=np.arange(7, dtype=np.int32) % 2,
        id=np.arange(7, dtype=np.int64),
        **fields,
    )


def listed(folder: Path) -> dict[float, str]:
    """The files of a list by their times."""
    rows = ElementTree.parse(folder / "particles.pvd").getroot().iter("DataSet")
    return {float(row.attrib["timestep"]): row.attrib["file"] for row in rows}


def test_meshio_reads_the_bits_that_were_written(tmp_path):
    meshio = pytest.importorskip("meshio")
    writer = Particles(tmp_path, frames_per_second=2.0, origin=(1000.0, 0.0, -5.0))
    given = [snapshot(0), snapshot(1, apparent_viscosity=np.ones(7, np.float32), yielded=np.zeros(7, np.int32))]
    for frame, one in enumerate(given):
        writer.write(frame, one)
    writer.finish()
    assert listed(tmp_path) == {0.0: "fluid.00000.vtu", 0.5: "fluid.00001.vtu"}
    for one, name in zip(given, listed(tmp_path).values(), strict=True):
        found = meshio.read(tmp_path / name)
        np.testing.assert_array_equal(found.points, one.position + np.array([1000.0, 0.0, -5.0]))
        (cells,) = found.cells
        assert cells.type == "vertex" and np.array_equal(cells.data[:, 0], np.arange(7))
        for field in ("velocity", "pressure", "density", "fluid", "id"):
            np.testing.assert_array_equal(found.point_data[field], getattr(one, field))
            assert found.point_data[field].dtype == getattr(one, field).dtype
        speed = np.linalg.norm(one.velocity, axis=1)
        np.testing.assert_array_equal(found.point_data["speed"], speed)
        assert ("yielded" in found.point_data) == (one.yielded is not None)


def test_a_run_that_goes_on_keeps_the_frames_before(tmp_path):
    for frame in range(3):
        Particles(tmp_path, frames_per_second=2.0, resume_at=frame).write(frame, snapshot(frame))
    assert list(listed(tmp_path)) == [0.0, 0.5, 1.0]
    Particles(tmp_path, frames_per_second=2.0, resume_at=1).write(1, snapshot(1))
    assert list(listed(tmp_path)) == [0.0, 0.5]
    assert not list(tmp_path.glob(".*"))


def test_a_scene_that_asks_for_them(make_scene, tmp_path):
    """Where the user put them, and of every frame."""
    meshio = pytest.importorskip("meshio")
    run = Run(make_scene(TANK), tmp_path / "run")
    run.execute()
    folder = tmp_path / "run" / "particles"
    assert list(listed(folder)) == pytest.approx([0.0, 0.02, 0.04])
    found = meshio.read(folder / "fluid.00002.vtu")
    assert len(found.points) == run.simulation.model.particle_count
    assert found.points[:, 0].min() > 4000.0 and found.points[:, 0].max() < 4001.0
