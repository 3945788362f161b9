"""Every law of reactive walls holds water in corners and in an arc: at rest, and where a drop splashes into them."""

import math

import numpy as np
import pytest

from warpsph.cli import SCENES
from warpsph.kernels.walls import BY_LEG, WALL_FORCE
from warpsph.measure.leaks import behind_walls
from warpsph.scene.loading import load_scene
from warpsph.scene.source import SceneError
from warpsph.simulation import Simulation

# Speed that is left in water at rest, over sqrt(g H), 0.2 s after damping has ended, in troughs ten spacings deep that
# no lattice fits; 0.05 at most was seen.
TOLERANCE = 0.1
DEPTH = 0.1  # [m]


def trough(interior: float | None) -> str:
    """A wall that makes a corner of `interior` [degrees] at the bottom, with arms of 0.5 m, or an arc of 0.2 m."""
    if interior is None:
        return "arc: {center: [0.0, 0.2], radius: 0.2, start: 190.0, end: 350.0}"
    slope = math.radians((180.0 - interior) / 2)
    x, z = 0.5 * math.cos(slope), 0.5 * math.sin(slope)
    return f"path: [[{-x:.6f}, {z:.6f}], [0.0, 0.0], [{x:.6f}, {z:.6f}]]"


@pytest.fixture
def simulate(make_scene, device):
    """A function of law, corner and fluid that gives the simulation of a trough, spacing a tenth of DEPTH."""

    def make(force: str, interior: float | None, fluid: str, extra: str = "") -> Simulation:
        text = f"""
title: A trough
spacing: {DEPTH / 10}
materials: {{water: {{density: 1000.0, sound_speed: 20.0, alpha: 0.05}}}}
xsph: 0.0
walls: [{{name: trough, {trough(interior)}}}]
wall_model: {{force: {force}}}
fluids: [{{name: water, material: water, {fluid}}}]
run: {{end_time: 1.0}}
{extra}
"""
        return Simulation(make_scene(text), device)

    return make


CORNERS = pytest.mark.parametrize("interior", [90.0, 120.0, 150.0, None])


@CORNERS
@pytest.mark.parametrize("force", WALL_FORCE)
def test_water_rests_in_a_corner(simulate, force, interior, request):
    if (force, interior) == ("lennard_jones", 150.0):
        why = "as heavy as it is drawn, water swings at 0.117 sqrt(g H) between points that reach one spacing"
        request.node.add_marker(pytest.mark.xfail(reason=why, strict=True))
    fill = f"fill: {{level: {DEPTH}, above: trough}}"
    simulation = simulate(force, interior, fill, "warm_up: {duration: 0.6, damping: 40.0}")
    simulation.reach(0.2)
    snapshot = simulation.state.snapshot()
    assert not behind_walls(simulation.model, snapshot.position).any()
    speed = np.linalg.norm(snapshot.velocity, axis=1)
    assert speed.max() < TOLERANCE * math.sqrt(9.81 * DEPTH)


@CORNERS
@pytest.mark.parametrize("force", WALL_FORCE)
def test_a_drop_into_a_corner_neither_leaks_nor_jets(simulate, force, interior):
    """A disc of water falls into the corner, at 1.6 m/s at most. As it splashes, its sheets may outrun its fall, but by
    its own energy: walls that stand still, and begin out of reach, have at no time given any.

    Lists are made anew all the time: a drop that falls as one is not listed anew on its way to a wall.
    """
    simulation = simulate(force, interior, "shape: {disc: {center: [0.0, 0.08], radius: 0.05}}")
    energy = 1000.0 * math.pi * 0.05**2 * 9.81 * 0.08  # [J/m]
    fastest, given = 0.0, 0.0
    for time in np.linspace(0.0, 0.3, 201)[1:]:
        simulation.advance(time)
        fastest = max(fastest, float(np.linalg.norm(simulation.state.velocity.numpy(), axis=1).max()))
        given = max(given, simulation.energy.measure()[0].wall_work)
    assert not behind_walls(simulation.model, simulation.state.position.numpy()).any()
    assert fastest < 2.0 * math.sqrt(2 * 9.81 * 0.13)
    assert given < 0.01 * energy


@pytest.mark.parametrize("force", BY_LEG)
def test_laws_of_lines_are_refused_in_space(make_scene, force):
    text = """
title: A box
dimensions: 3
spacing: 0.1
materials: {water: {density: 1000.0, sound_speed: 50.0}}
walls: [{name: box, box: {min: [0.0, 0.0, 0.0], max: [1.0, 1.0, 1.0]}}]
fluids: [{name: water, material: water, fill: {level: 0.5, above: box}}]
run: {end_time: 1.0}
"""
    with pytest.raises(SceneError, match=f"wall_model.force: {force} needs walls that are lines"):
        make_scene(text, f"wall_model.force={force}")


def test_each_law_brings_what_suits_it(make_scene):
    """What a scene leaves out is the law's own; what it says stays; and what it does not know is refused."""
    scene = load_scene(SCENES / "still_water.yaml", ["wall_model.force=monaghan_kos_issa"])
    assert (scene.wall_model.strength, scene.wall_model.set_back) == (0.02, 1.35)
    scene = load_scene(SCENES / "still_water.yaml", ["wall_model.force=lennard_jones", "wall_model.set_back=0.7"])
    assert (scene.wall_model.strength, scene.wall_model.set_back) == (0.01, 0.7)
    assert make_scene(scene.resolved_yaml()).wall_model == scene.wall_model
    with pytest.raises(SceneError, match=r"wall_model\.approach: goes with the force monaghan_kos; radial does not"):
        load_scene(SCENES / "still_water.yaml", ["wall_model.force=radial", "wall_model.approach=1.0"])
