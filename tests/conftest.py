"""Fixtures that every test can ask for."""

from collections.abc import Callable
from pathlib import Path

import pytest
import warp as wp

from warpsph.output.checkpoint import read_checkpoint
from warpsph.scene.loading import load_scene
from warpsph.scene.scene import Scene
from warpsph.simulation import Simulation

wp.config.log_level = wp.LOG_WARNING  # no line for each module loaded

DEVICES = ["cpu", "cuda:0"] if wp.get_cuda_device_count() > 0 else ["cpu"]


# Scenes of tests stand between walls that push, unless they say otherwise: the setting by the field that says it.
PUSHING = {
    "wall_model": "wall_model.force=radial",
    "smoothing": "smoothing={kernel: wendland_c2, ratio: 1.5}",
    "xsph": "xsph=0.5",
}


@pytest.fixture(scope="session", params=DEVICES)
def device(request) -> str:
    """Each device that a kernel must give the same answer on: the CPU, and the first GPU where there is one."""
    return request.param


@pytest.fixture(scope="session")
def make_scene(tmp_path_factory) -> Callable[..., Scene]:
    """A function that loads a scene from its YAML, with overrides such as `run.courant=0.25`, and PUSHING walls."""

    def make(text: str, *overrides: str) -> Scene:
        path = tmp_path_factory.mktemp("scene") / "scene.yaml"
        path.write_text(text, encoding="utf-8")
        told = text + "".join(f"\n{one.replace('=', ': ').replace('.', ': ', 1)}" for one in overrides)
        usual = [] if "dummy_particles" in told else [one for name, one in PUSHING.items() if f"\n{name}:" not in told]
        return load_scene(path, [*usual, *overrides])

    return make


@pytest.fixture(scope="session")
def bits() -> Callable[[Simulation], dict[str, bytes]]:
    """A function that gives all that a run goes on from, to be compared bit for bit."""
    return lambda simulation: {name: array.numpy().tobytes() for name, array in simulation.kept().items()}


@pytest.fixture(scope="session")
def resumed() -> Callable[[Simulation, Path], Simulation]:
    """A function that makes a new simulation of the same scene, which goes on from the last checkpoint of a folder."""

    def resume(simulation: Simulation, folder: Path) -> Simulation:
        new = Simulation(simulation.scene, str(simulation.launcher.device))
        read_checkpoint(folder, new)
        new.enter_phase()
        new.step.resume()
        return new

    return resume


# Water and a heavier fluid of the other state equation let go in a tank: fast, violent and small.
COLLAPSE = """
title: Two columns collapse in a tank
dimensions: 2
spacing: 0.02
materials:
  water: {density: 1000.0, sound_speed: 28.0, alpha: 0.05}
  brine: {density: 1200.0, sound_speed: 30.0, alpha: 0.02, state_equation: linear}
walls:
  - {name: tank, path: [[0.0, 0.6], [0.0, 0.0], [0.8, 0.0], [0.8, 0.6]]}
fluids:
  - {name: water, material: water, shape: {box: {min: [0.0, 0.0], max: [0.2, 0.4]}}}
  - {name: brine, material: brine, shape: {box: {min: [0.2, 0.0], max: [0.3, 0.4]}}}
gauges:
  - {name: middle, x: 0.4}
run: {end_time: 1.0}
wall_model: {force: radial}
smoothing: {kernel: wendland_c2, ratio: 1.5}
xsph: 0.5
"""


@pytest.fixture(scope="session")
def make_collapse(make_scene) -> Callable[..., Scene]:
    """A function that makes the scene of two collapsing columns, 300 particles, with overrides."""
    return lambda *overrides: make_scene(COLLAPSE, *overrides)


# All phases: a pool settles, is damped, and then a block that was held is let go.
RELEASE = """
title: A block held above a pool
dimensions: 2
spacing: 0.02
materials:
  water: {density: 1000.0, sound_speed: 30.0, alpha: 0.05}
  rock: {density: 2500.0, sound_speed: 30.0}
walls:
  - {name: tank, path: [[0.0, 0.5], [0.0, 0.0], [0.4, 0.0], [0.4, 0.5]]}
fluids:
  - {name: pool, material: water, fill: {level: 0.2, above: tank}}
  - {name: block, material: rock, hold: true, shape: {box: {min: [0.16, 0.3], max: [0.24, 0.36]}}}
warm_up: {duration: 0.1, damping: 50.0, settling: 0.04}
run: {end_time: 1.0}
wall_model: {force: radial}
smoothing: {kernel: wendland_c2, ratio: 1.5}
xsph: 0.5
"""


@pytest.fixture(scope="session")
def make_release(make_scene) -> Callable[..., Scene]:
    """A function that makes the scene of a block held above a pool, with overrides."""
    return lambda *overrides: make_scene(RELEASE, *overrides)
