"""Tests of the search for particles behind walls: against one that looks at all wall points."""

import numpy as np
import pytest

from warpsph.measure.leaks import behind_walls
from warpsph.scene.scene import Scene
from warpsph.simulation import Simulation

PLANE = {
    "title": "a flume with a slope, and a block in it",
    "spacing": 0.02,
    "materials": {"water": {"density": 1000.0, "sound_speed": 30.0}},
    "walls": [
        {"name": "flume", "path": [[-0.8, 0.5], {"at": [0.0, 0.0], "radius": 0.1}, [2.0, 0.0], [2.0, 0.5]]},
        {"name": "block", "box": {"min": [1.2, 0.05], "max": [1.5, 0.15]}},
        {"name": "post", "disc": {"center": [0.7, 0.3], "radius": 0.04}},
    ],
    "fluids": [{"name": "water", "material": "water", "fill": {"level": 0.2, "above": "flume"}}],
    "run": {"end_time": 0.1},
}
SPACE = {
    "title": "a tank in space",
    "dimensions": 3,
    "spacing": 0.05,
    "materials": {"water": {"density": 1000.0, "sound_speed": 30.0}},
    "walls": [{"name": "tank", "box": {"min": [0.0, 0.0, 0.0], "max": [2.0, 0.8, 0.9], "open": ["top"]}}],
    "fluids": [{"name": "water", "material": "water", "fill": {"level": 0.3, "above": "tank"}}],
    "run": {"end_time": 0.1},
}


@pytest.mark.parametrize("law", ["radial", "dummy_particles"])
@pytest.mark.parametrize("fields", [PLANE, SPACE], ids=["plane", "space"])
def test_behind_walls_is_what_all_wall_points_say(fields, law, device):
    fields = fields | {"wall_model": {"force": law}}
    if law == "dummy_particles":  # walls with fluid on both sides are too thin for them
        fields |= {"walls": fields["walls"][:1]}
    model = Simulation(Scene.model_validate(fields), device).model
    low, high = (np.array(fields_of) for fields_of in ([-2.0, -1.0, -1.0], [3.5, 2.0, 1.5]))
    points = np.random.default_rng(1).uniform(low, high, (4000, 3))
    if model.scene.dimensions == 2:
        points[:, 1] = 0.0
    walls, normals = model.wall_line
    distance = np.linalg.norm(points[:, None] - walls, axis=2)
    nearest = distance.argmin(axis=1)
    behind = np.einsum("ij,ij->i", points - walls[nearest], normals[nearest]) < 0.0
    found = behind_walls(model, points)
    near = distance.min(axis=1) < 3.0 * model.spacing
    assert behind[near].any() and not behind[near].all()
    # Right off an edge of a wall the point that is nearest may have one normal or another.
    is_clear = np.abs(np.einsum("ij,ij->i", points - walls[nearest], normals[nearest])) > 0.05 * model.spacing
    np.testing.assert_array_equal(found[near & is_clear], behind[near & is_clear])
    assert np.mean(found != behind) < 0.01


def test_a_small_thing_seen_from_afar(device):
    """Far from all walls a post, smaller than the cells are there, is in front of whoever looks at it."""
    fields = PLANE | {"walls": [*PLANE["walls"][:1], {"name": "post", "disc": {"center": [0.9, 1.3], "radius": 0.03}}]}
    model = Simulation(Scene.model_validate(fields), device).model
    angle = np.linspace(0.0, 2.0 * np.pi, 500)
    around = [np.array([0.9 + r * np.cos(angle), 0.0 * angle, 1.3 + r * np.sin(angle)]).T for r in (0.1, 0.25, 0.5)]
    assert not behind_walls(model, np.concatenate(around)).any()


def test_fluid_at_rest_is_in_front(device):
    simulation = Simulation(Scene.model_validate(SPACE), device)
    assert not behind_walls(simulation.model, simulation.state.position).any()
    below = simulation.state.position.numpy() - [0.0, 0.0, 0.4]
    assert behind_walls(simulation.model, below).all()


def test_walls_of_dummy_particles_have_a_surface_too(make_scene, device):
    """Their points are behind it: what is nearer to them than to the fluid is behind the wall, and nothing else."""
    text = """
title: A tank
spacing: 0.02
materials: {water: {density: 1000.0, sound_speed: 20.0}}
wall_model: {force: dummy_particles}
walls: [{name: tank, path: [[0.0, 0.4], [0.0, 0.0], [0.6, 0.0], [0.6, 0.4]]}]
fluids: [{name: water, material: water, fill: {level: 0.2, above: tank}}]
run: {end_time: 1.0}
"""
    simulation = Simulation(make_scene(text), device)
    assert not behind_walls(simulation.model, simulation.state.position).any()
    places = [[0.3, 0.0, -0.001], [0.3, 0.0, 0.001], [-0.05, 0.0, 0.1], [0.601, 0.0, 0.3], [0.3, 0.0, 2.0]]
    np.testing.assert_array_equal(behind_walls(simulation.model, places), [True, False, True, True, False])
