"""What leaves the tank is counted, the rest goes on: mass, energy, ids, records; what is absurd stops or is dropped."""

import json

import numpy as np
import pytest

from scenes import pool, scene
from warpsph.cli import BLOWN_UP, OK, main
from warpsph.output.records import read_record
from warpsph.output.usd_check import check_cache
from warpsph.simulation import BlowUpError, Simulation

# A dam break that overtops the low end wall of its tank; see tests/cases/README.md.
OVERTOP = scene(
    "A dam break overtops the low end wall of its tank",
    0.04,
    [{"name": "tank", "path": [[0.0, 1.0], [0.0, 0.0], [1.2, 0.0], [1.2, 0.2]]}],
    [pool(0.6, between=[0.0, 0.6])],
    "gauges: [{name: middle, x: 0.6}]",
    "output: {usd: true, pictures: false, frames_per_second: 20, checkpoint_every: 0.5}",
    sound_speed=35.0,
    end_time=1.2,
)


@pytest.fixture
def overtop(make_scene):
    return lambda *overrides: make_scene(OVERTOP, *overrides)


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("overtop")
    (folder / "overtop.yaml").write_text(OVERTOP)
    assert main(["scene", str(folder / "overtop.yaml"), "--out", str(folder / "run"), "--threads", "1"]) == OK
    return folder / "run"


def test_what_leaves_is_counted_and_the_run_goes_on(run_folder):
    facts, left = json.loads((run_folder / "run.json").read_text()), read_record(run_folder / "left.csv")
    assert facts["outcome"] == "done" and facts["left"]["dropped as absurd"] == 0
    count = len(left["id"])
    assert count == facts["left"]["particles"] > 10
    assert len(set(left["id"])) == count and (np.diff(left["time [s]"]) >= 0.0).all()
    assert facts["left"]["volume [m2]"] == pytest.approx(count * 0.04**2, rel=1e-6)
    assert facts["left"]["first [s]"] == left["time [s]"][0] and facts["left"]["last [s]"] == left["time [s]"][-1]
    assert facts["conservation"]["mass / mass placed"] == pytest.approx(1.0, abs=1e-6)
    # Two smoothing lengths beyond the wall that it ran over, no more than the way of a step farther.
    assert (left["x [m]"] > 1.2 + 2 * 0.056).all() and (left["x [m]"] < 1.2 + 2 * 0.056 + 0.1).all()


def test_energy_that_leaves_is_accounted_for(run_folder):
    energy = read_record(run_folder / "energy.csv")
    gone, total = energy["gone [J/m]"], energy["total [J/m]"]
    assert gone[0] == 0.0 and gone[-1] > 10.0
    before = np.searchsorted(energy["time [s]"], read_record(run_folder / "left.csv")["time [s]"][0])
    # What goes takes its energy along: the sum strays no faster than before anything left.
    drift = np.abs(np.diff(total))
    assert drift[before:].max() < 3.0 * drift[:before].max() + 1e-3 * gone[-1]


def test_the_cache_keeps_the_others_and_their_ids(run_folder):
    from pxr import Usd, UsdGeom

    assert check_cache(run_folder / "usd") == []
    stage = Usd.Stage.Open(str(run_folder / "usd" / "scene.usda"))
    points = UsdGeom.Points(stage.GetPrimAtPath("/World/Fluid/water"))
    first, last = (np.array(points.GetIdsAttr().Get(frame)) for frame in (0, 24))
    gone = read_record(run_folder / "left.csv")["id"].astype(int)
    np.testing.assert_array_equal(last, np.setdiff1d(first, gone))
    assert len(points.GetPointsAttr().Get(24)) == len(last)


def test_gone_particles_do_not_come_back_on_resume(run_folder, tmp_path):
    """A resumed run has the bits of one that went through."""
    (tmp_path / "overtop.yaml").write_text(OVERTOP)
    scene, folder = str(tmp_path / "overtop.yaml"), str(tmp_path / "run")
    for command in (["scene", scene, "--out", folder, "--until", "0.9"], ["resume", folder, "--until", "1.2"]):
        assert main([*command, "--threads", "1"]) == OK
        assert len(read_record(tmp_path / "run" / "left.csv")["id"]) > 0
    for name in ("left.csv", "energy.csv", "gauges/middle.csv", "fluids/water.csv"):
        assert (tmp_path / "run" / name).read_bytes() == (run_folder / name).read_bytes(), name


def test_what_has_left_rests_out_of_reach(overtop, device):
    simulation = Simulation(overtop(), device)
    simulation.advance(1.2)
    state, leaving = simulation.state, simulation.leaving
    gone = state.fluid.numpy() == 1
    assert leaving.parked == gone.sum() == len(leaving.gone) > 10
    assert not state.velocity.numpy()[gone].any()
    places = state.position.numpy()[gone]
    near = np.linalg.norm(places[:, None] - places, axis=2) + 1e9 * np.eye(len(places))
    assert near.min() > simulation.model.list_radius
    assert places[:, 2].min() > state.position.numpy()[~gone, 2].max() + simulation.model.list_radius
    assert len(state.snapshot().id) == len(gone) - gone.sum()
    assert simulation.energy.measure()[1][0].mass == pytest.approx(1000.0 * 0.04**2 * (~gone).sum(), rel=1e-6)


def rushed(simulation: Simulation, count: int = 1) -> Simulation:
    """Some particles made faster than sound."""
    velocity = simulation.state.velocity.numpy()
    velocity[:count] = [0.0, 0.0, 1000.0]
    simulation.state.velocity.assign(velocity)
    return simulation


def test_an_absurd_particle_stops_a_run(overtop, device):
    with pytest.raises(BlowUpError, match="it moves faster than sound"):
        rushed(Simulation(overtop(), device)).advance(0.01)


def test_an_absurd_particle_is_dropped_where_a_scene_says_so(overtop, device):
    simulation = rushed(Simulation(overtop("run.absurd=drop"), device))
    simulation.advance(0.01)
    (gone,) = simulation.leaving.gone
    assert gone.is_absurd and simulation.time == 0.01
    assert np.isfinite(simulation.energy.measure()[0].total)


def test_more_than_a_few_absurd_particles_stop_every_run(overtop, device):
    with pytest.raises(BlowUpError, match="it moves faster than sound"):
        rushed(Simulation(overtop("run.absurd=drop"), device), 5).advance(0.01)


def test_a_viscoplastic_fluid_may_leave_too(overtop, device):
    mud = "materials.water.rheology={law: bingham, consistency: 0.5, yield_stress: 1.0, viscosity_max: 50.0}"
    simulation = Simulation(overtop(mud), device)
    simulation.advance(1.2)
    assert simulation.leaving.parked > 0
    assert len(simulation.state.snapshot().yielded) == 225 - simulation.leaving.parked


def test_a_run_of_which_all_leaves_ends(tmp_path, capsys):
    """There is nothing to go on with."""
    fill = "fill: {level: 0.6, above: tank, between: [0.0, 0.6]}"
    text = OVERTOP.replace(fill, "shape: {box: {min: [1.3, 0.4], max: [1.34, 0.44]}}")
    (tmp_path / "drop.yaml").write_text(text)
    assert main(["scene", str(tmp_path / "drop.yaml"), "--out", str(tmp_path / "run"), "--threads", "1"]) == BLOWN_UP
    assert "left the box" in capsys.readouterr().err
