"""Where pair loops find neighbours: in lists, or in the cells around."""

import numpy as np
import pytest

from scenes import block, crate, scene
from warpsph.device.launch import Launcher
from warpsph.forecast import forecast
from warpsph.output.checkpoint import read_checkpoint, write_checkpoint
from warpsph.scene.source import SceneError
from warpsph.simulation import Simulation

# Sums of some thirty terms that nearly cancel, in single precision and in another order: relative to the largest value.
TOLERANCE = 1e-5

SWEPT = ("pressure_acceleration", "dissipative_acceleration", "density_rate", "diffusion_rate", "xsph_velocity")

CUBE = scene(
    "A cube of water collapses in a tank",
    0.025,
    [crate(0.5, 0.2, 0.4)],
    [block([0.0, 0.0, 0.0], [0.2, 0.2, 0.2])],
    sound_speed=30.0,
    dimensions=3,
    alpha=0.05,
)


def rates(simulation: Simulation) -> dict[str, np.ndarray]:
    """What both halves of the pair loop give, one after the other."""
    simulation.step.scheme.fluid.sweep(continuity=False)[0]()
    simulation.step.scheme.fluid.sweep(momentum=False)[0]()
    return {name: getattr(simulation.state, name).numpy() for name in SWEPT}


@pytest.mark.parametrize("dimensions", [2, 3])
def test_cells_hold_whoever_is_listed(make_collapse, make_scene, device, tmp_path, dimensions):
    """In mid-flow, some steps after particles were sorted, both find the same pairs."""

    def make(neighbours: str) -> Simulation:
        options = f"neighbours={neighbours}", "xsph=0.5"
        return Simulation(make_collapse(*options) if dimensions == 2 else make_scene(CUBE, *options), device)

    walker = make("cells")
    walker.step.aim_at(1.0)
    walker.step.run(150)
    while walker.state.stale.numpy()[0] or walker.step.neighbours.rebuilds < 3:
        walker.step.run(1)
    assert not np.array_equal(walker.state.position.numpy().astype(np.float32), walker.state.listed_position.numpy())
    write_checkpoint(tmp_path, walker)

    found = []
    for neighbours in ("cells", "lists"):
        simulation = make(neighbours)
        read_checkpoint(tmp_path, simulation)
        simulation.enter_phase()
        simulation.step.resume()
        found.append(rates(simulation))
    for name, expected in found[1].items():
        assert expected.any()
        np.testing.assert_allclose(
            found[0][name], expected, rtol=0, atol=TOLERANCE * np.abs(expected).max(), err_msg=name
        )


def test_cells_need_little_memory(make_collapse, device):
    """250 bytes a particle in the plane; these few particles lie among many cells and wall points."""
    scenes = [make_collapse(f"neighbours={neighbours}", "spacing=0.005") for neighbours in ("lists", "cells")]
    lists, cells = (forecast(scene, Launcher(device)) for scene in scenes)
    assert lists.memory.arrays - cells.memory.arrays > 140 * lists.particle_count
    walls_and_grid = 8.0 * cells.particle_count  # of a tank so much wider than its fluid
    assert cells.memory.arrays < 250 * cells.particle_count + walls_and_grid


def test_what_needs_lists_says_so(make_collapse):
    with pytest.raises(SceneError, match="neighbours: lists are needed for antuono's diffusion of density"):
        make_collapse("neighbours=cells", "density_diffusion.model=antuono")
    with pytest.raises(SceneError, match="neighbours: lists are needed for images"):
        make_collapse("neighbours=cells", "images=[{name: floor, mirror: {point: [0, -0.5], normal: [0, 1]}}]")
