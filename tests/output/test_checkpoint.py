"""Checkpoints: a run that goes on from one is, bit for bit, the run that was never interrupted."""

import numpy as np
import pytest

from warpsph.output.checkpoint import KEPT, CheckpointError, read_checkpoint, write_checkpoint
from warpsph.simulation import Simulation

# Bits are compared: there is no tolerance.


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
        ["materials.water.dynamic_viscosity=5.0", "viscosity.weights=balanced"],
    ],
)
def test_goes_on_bit_for_bit(make_collapse, device, tmp_path, bits, resumed, scheme):
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
        assert bits(other) == bits(whole)
        assert other.energy.measure()[0] == whole.energy.measure()[0]
        assert other.gauges.levels() == whole.gauges.levels()


@pytest.mark.parametrize(
    "time", [-0.08, -0.06, -0.01, 0.0, 0.02], ids=["settling", "settled", "warming up", "release", "released"]
)
def test_goes_on_in_any_phase(make_release, device, tmp_path, bits, resumed, time):
    whole = Simulation(make_release(), device)
    whole.reach(time)
    write_checkpoint(tmp_path, whole)
    part = resumed(whole, tmp_path)
    for simulation in (whole, part):
        simulation.reach(0.04)
    assert bits(part) == bits(whole)


def test_writing_leaves_no_trace_in_the_state(collapsing, tmp_path, bits):
    before = bits(collapsing)
    write_checkpoint(tmp_path, collapsing)
    assert bits(collapsing) == before


def test_last_ones_are_kept(collapsing, tmp_path, resumed):
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
