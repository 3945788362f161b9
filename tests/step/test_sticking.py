"""Viscous fluid sticks to walls of dummy particles, or slips where the scene says so."""

import math

import numpy as np
import pytest

from warpsph.simulation import Simulation

SPEED, DX = 0.1, 0.04  # m/s, m
NU = 0.01  # m2/s

PLATE = f"""
title: A layer that slides along a plate which stops it
spacing: {DX}
gravity: 1.0e-6
materials: {{oil: {{density: 1000.0, sound_speed: 2.0, alpha: 0.0, dynamic_viscosity: {1000.0 * NU}}}}}
walls: [{{name: plate, path: [[-0.2, 0.0], [1.4, 0.0]]}}]
wall_model: {{force: dummy_particles}}
xsph: 0.0
fluids: [{{name: oil, material: oil, velocity: [{SPEED}, 0.0], shape: {{box: {{min: [0.0, 0.0], max: [1.2, 0.4]}}}}}}]
run: {{end_time: 0.2}}
"""


def middle(simulation):
    """Height and velocity of what lies amidships, where the ends of the layer have not been felt yet."""
    snapshot = simulation.state.snapshot()
    x, u = snapshot.position, snapshot.velocity
    amidships = (x[:, 0] > 0.5) & (x[:, 0] < 0.7)
    return x[amidships, 2], u[amidships]


def test_a_plate_stops_the_fluid_as_stokes_found(make_scene, device):
    """u = U erf(z / sqrt(4 nu t)): Stokes (1851). At 0.25 s 1.6 % of U off, 0.38 and 0.11 % with finer dx."""
    simulation = Simulation(make_scene(PLATE), device)
    simulation.reach(0.2)
    z, u = middle(simulation)
    exact = [SPEED * math.erf(height / math.sqrt(4.0 * NU * 0.2)) for height in z]
    assert np.sqrt(np.mean((u[:, 0] - exact) ** 2)) < 0.025 * SPEED
    assert np.abs(u[:, 2]).max() < 0.01 * SPEED


def test_it_slips_where_it_is_told_to(make_scene, device):
    simulation = Simulation(make_scene(PLATE.replace("dummy_particles}", "dummy_particles, slip: free}")), device)
    simulation.reach(0.2)
    _, u = middle(simulation)
    assert np.abs(u[:, 0] - SPEED).max() < 1e-3 * SPEED


@pytest.mark.parametrize("law", ["oil", "mud"])
def test_shear_goes_on_into_the_wall(make_scene, device, law):
    """Of u = G z in disorder dummies have -G depth: sums over them leave a linear flow alone, and find its gradient."""
    mud = "rheology: {law: bingham, consistency: 10.0, yield_stress: 5.0, viscosity_max: 100.0}"
    text = PLATE if law == "oil" else PLATE.replace(f"dynamic_viscosity: {1000.0 * NU}", mud)
    simulation = Simulation(make_scene(text, "viscosity.form=stress"), device)
    state, viscosity, n = simulation.state, simulation.step.scheme.viscosity, simulation.model.particle_count
    noise = np.random.default_rng(1).uniform(-0.1, 0.1, (n, 3)) * DX * [1.0, 0.0, 1.0]
    x = state.position.numpy() + noise
    G = 0.7
    u = np.zeros((n, 3))
    u[:, 0] = G * x[:, 2]
    state.position.assign(x)
    state.velocity.assign(u)
    simulation.step._pack()
    simulation.step.neighbours.dummies.press()
    for act in viscosity.see_walls():
        for stage in act.stages().values():
            stage()
    packed = viscosity.seen_velocity.numpy()[n:]
    depth = simulation.model.wall_position.numpy()[:, 2]
    faced = packed[:, 3] > 0.0
    assert faced.sum() > 60
    assert packed[faced, 0] == pytest.approx(G * depth[faced], rel=1e-3, abs=1e-4)
    for launch in viscosity.prepare():
        launch()
    inside = (x[:, 0] > 0.2) & (x[:, 0] < 1.0) & (x[:, 2] < 0.2)
    gradient = viscosity.velocity_gradient.numpy()[inside]
    expected = np.zeros((3, 3))
    expected[0, 2] = G
    assert np.abs(gradient - expected).max() < 1e-3 * G
