"""Checkpoints: a run that goes on from one is, bit for bit, the run that was never interrupted."""

import numpy as np
import pytest

from warpsph.checkpoint import KEPT, CheckpointError, read_checkpoint, write_checkpoint
from warpsph.simulation import Simulation

# Bits are compared: there is no tolerance.

HELD = """
title: A block let go above a pool
dimensions: 2
spacing: 0.02
materials:
  water: {density: 1000.0, sound_speed: 30.0, alpha: 0.05}
  rock: {density: 2500.0, sound_speed: 30.0}
walls:
  - {name: tank, path: [[0.0, 0.5], [0.0, 0.0], [0.4, 0.0], [0.4, 0.5]]}
fluids:
  - {name: pool, material: water, fill: {level: 0.1, above: tank}}
  - {name: block, material: rock, hold: true, shape: {box: {min: [0.16, 0.14], max: [0.24, 0.2]}}}
warm_up: {duration: 0.06, damping: 50.0}
run: {end_time: 1.0}
"""


def advance(simulation: Simulation, time: float) -> None:
    """To `time` [s] by way of the changes of phase."""
    now = simulation.time
    for change in simulation.phase_changes():
        if now < change <= time:
            simulation.advance(change)
            simulation.enter_phase()
    simulation.advance(time)


def everything(simulation: Simulation) -> dict[str, bytes]:
    return {name: getattr(simulation.state, name).numpy().tobytes() for name in simulation.state.kept_names}


def resumed(simulation: Simulation, folder) -> Simulation:
    """A new simulation of the same scene that goes on from the last checkpoint of `folder`, as a run does."""
    new = Simulation(simulation.scene, str(simulation.launcher.device))
    read_checkpoint(folder, new)
    new.enter_phase()
    new.step.resume()
    return new


@pytest.fixture
def collapsing(make_collapse, device) -> Simulation:
    simulation = Simulation(make_collapse(), device)
    simulation.advance(0.02)
    return simulation


@pytest.mark.parametrize(
    "scheme",
    [
        [],
        ["run.integrator=predictor_corrector"],
        ["run.integrator=runge_kutta"],
        ["density_filter={model: mls, every: 7}", "continuity=renormalised", "shifting.model=fickian"],
        ["materials.water.dynamic_viscosity=5.0", "laminar.weights=balanced"],
    ],
)
def test_goes_on_bit_for_bit(make_collapse, device, tmp_path, scheme):
    """Through two checkpoints, the second of them made by a run that was itself resumed."""
    whole = Simulation(make_collapse(*scheme), device)
    for time in (0.05, 0.1):
        whole.advance(time)
        write_checkpoint(tmp_path, whole)
        if time == 0.05:
            part = resumed(whole, tmp_path)
    assert np.any(whole.state.id.numpy() != np.arange(300)), "the particles were never sorted"
    whole.advance(0.15)

    (tmp_path / "again").mkdir()
    part.advance(0.1)
    write_checkpoint(tmp_path / "again", part)
    again = resumed(part, tmp_path / "again")
    for other in (part, again):
        other.advance(0.15)
        assert everything(other) == everything(whole)
        assert other.energy.measure()[0] == whole.energy.measure()[0]
        assert other.gauges.levels() == whole.gauges.levels()


@pytest.mark.parametrize("time", [-0.03, -0.01, 0.0, 0.02], ids=["settled", "warming up", "release", "released"])
def test_goes_on_in_any_phase(make_scene, device, tmp_path, time):
    whole = Simulation(make_scene(HELD), device)
    advance(whole, time)
    write_checkpoint(tmp_path, whole)
    part = resumed(whole, tmp_path)
    for simulation in (whole, part):
        advance(simulation, 0.04)
    assert everything(part) == everything(whole)


def test_writing_leaves_no_trace_in_the_state(collapsing, tmp_path):
    before = everything(collapsing)
    write_checkpoint(tmp_path, collapsing)
    assert everything(collapsing) == before


def test_last_ones_are_kept(collapsing, tmp_path):
    paths = []
    for time in (0.03, 0.04, 0.05):
        collapsing.advance(time)
        paths.append(write_checkpoint(tmp_path, collapsing))
    assert sorted(tmp_path.iterdir()) == paths[-KEPT:]
    assert [path.stem for path in paths] == sorted(path.stem for path in paths)
    assert int(paths[-1].stem) == collapsing.step_count
    assert resumed(collapsing, tmp_path).time == 0.05


def test_nothing_to_go_on_from(collapsing, tmp_path):
    with pytest.raises(CheckpointError, match="no checkpoint to go on from"):
        read_checkpoint(tmp_path, collapsing)


@pytest.mark.parametrize("damage", [lambda b: b"", lambda b: b"text", lambda b: b[: len(b) // 2]])
def test_damaged_file_is_named(collapsing, tmp_path, damage):
    path = write_checkpoint(tmp_path, collapsing)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(CheckpointError) as caught:
        read_checkpoint(tmp_path, collapsing)
    assert str(caught.value).startswith(f"{path}: not a checkpoint that can be read")
    assert "\n" not in str(caught.value)


def test_checkpoint_of_another_scene_is_refused(collapsing, make_collapse, device, tmp_path):
    path = write_checkpoint(tmp_path, collapsing)
    other = Simulation(make_collapse("spacing=0.04"), device)
    with pytest.raises(CheckpointError, match="made by another scene") as caught:
        read_checkpoint(tmp_path, other)
    assert str(path) in str(caught.value)
