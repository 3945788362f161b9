"""Walls of dummy particles hold water from the first step: at rest, in a collapse, and without friction."""

import math

import numpy as np
import pytest

from scenes import DUMMIES, block, crate, pool, scene, tank
from warpsph.scene.source import SceneError
from warpsph.simulation import Simulation

DX, DEPTH, G = 0.01, 0.1, 9.81

DIFFUSED = "density_diffusion: {model: fourtakas, delta: 0.1}\nxsph: 0.0"

TANK = scene(
    "A tank", DX, [tank(0.2, 0.2)], [pool(DEPTH)], DUMMIES, DIFFUSED, "gauges: [{name: middle, x: 0.1}]", end_time=0.5
)

COLLAPSE = scene(
    "A column collapses onto an end wall",
    0.025,
    [tank(1.2, 2.0)],  # the splash goes up to 1.25 m
    [block([0.0, 0.0], [0.5, 0.5])],
    DUMMIES,
    DIFFUSED,
    sound_speed=31.3,
)

BOX = scene(
    "Water in a box", 0.02, [crate(0.12, 0.12, 0.16)], [pool(0.1)], DUMMIES, DIFFUSED, end_time=0.2, dimensions=3
)


def fastest(simulation: Simulation) -> float:
    return float(np.linalg.norm(simulation.state.velocity.numpy(), axis=1).max())


def slope(q: np.ndarray, h: float) -> np.ndarray:
    """dW/dr / r [1/m4] of the quintic spline of Morris, Fox & Zhu (1997) in the plane, which ends at 2 h."""
    s, third = 1.5 * q, 2.0 / 3.0 * h
    slope_of_s = sum(-5.0 * n * np.maximum(a - s, 0.0) ** 4 for a, n in ((3, 1.0), (2, -6.0), (1, 15.0)))
    return 7.0 / (478.0 * math.pi * third**4) * slope_of_s / np.maximum(s, 1e-9)


@pytest.mark.parametrize("rows", [2, 10])
def test_water_stands_from_the_first_step(make_scene, device, rows):
    """No warm-up: speed below 0.01 sqrt(g H) at all times, pressure at the bed and level as drawn."""
    simulation = Simulation(make_scene(TANK, f"spacing={DEPTH / rows}"), device)
    speeds = []
    for time in np.linspace(0.0, 0.5, 26)[1:]:
        simulation.reach(time)
        speeds.append(fastest(simulation))
    assert max(speeds) < 1e-2 * math.sqrt(G * DEPTH)
    assert simulation.gauges.levels()[0] == pytest.approx(DEPTH, abs=0.1 * DX * 10 / rows)
    if rows == 10:
        snapshot = simulation.state.snapshot()
        x, p = snapshot.position, snapshot.pressure
        lowest = x[:, 2] < DX
        # A lattice is at rest where sum_j V (p_i + p_j) grad W is rho g; its sum of V x dW/dx is -1.0008.
        assert 1.0008 * p[lowest].mean() == pytest.approx(1000.0 * G * (DEPTH - x[lowest, 2].mean()), rel=0.005)


def test_water_stands_in_space(make_scene, device):
    simulation = Simulation(make_scene(BOX), device)
    speeds = []
    for time in np.linspace(0.0, 0.2, 11)[1:]:
        simulation.reach(time)
        speeds.append(fastest(simulation))
    assert max(speeds) < 1e-2 * math.sqrt(G * 0.1)


def test_a_collapse_stays_within_its_walls_and_keeps_its_energy(make_scene, device):
    simulation = Simulation(make_scene(COLLAPSE), device)
    start = simulation.energy.measure()[0]
    deepest, converted = 0.0, 0.0
    for time in np.linspace(0.0, 1.0, 101)[1:]:
        simulation.reach(time)
        x = simulation.state.position.numpy()
        deepest = max(deepest, float(np.max([-x[:, 0], x[:, 0] - 1.2, -x[:, 2]])))
        converted = max(converted, start.potential - simulation.energy.measure()[0].potential)
    assert deepest < 0.1 * 0.025
    end = simulation.energy.measure()[0]
    assert abs(end.total - start.total) < 0.005 * converted
    assert end.dissipated > 0.0


def test_walls_take_the_momentum_that_fluid_loses(make_scene, device):
    """The sum of m a over the fluid is its weight and what its pairs with dummies say, by an independent sum."""
    simulation = Simulation(make_scene(COLLAPSE), device)
    simulation.reach(0.2)  # against the left wall and on the bed
    model, state, n = simulation.model, simulation.state, simulation.model.particle_count
    # The state as forces find it: positions, pressures and dummies as they are now.
    simulation.step._pack()
    simulation.step.neighbours.dummies.press()
    simulation.step.scheme.fluid.sweep(continuity=False)[0]()
    packed = np.concatenate(
        [array.numpy()[:, :4] for array in (state.position_volume, state.velocity_pressure)], axis=1
    )
    x, V, p = packed[:, [0, 2]], packed[:, 3], packed[:, 7]
    h = simulation.scene.smoothing_length
    r = x[:n, None] - x[None, n:]
    q = np.linalg.norm(r, axis=2) / h
    pair = V[:n, None] * V[None, n:] * (np.maximum(p[:n], 0.0)[:, None] + p[None, n:]) * slope(q, h)
    force = -(pair[..., None] * r).sum(axis=(0, 1))
    m = model.parameters.mass.numpy()[0]
    found = m * state.pressure_acceleration.numpy()[:, ::2].astype(float).sum(axis=0)
    assert found == pytest.approx(force, rel=1e-3, abs=1e-3 * float(np.abs(force).max()))
    assert min(force) > 0.0


def test_fluid_slips_unless_its_material_rubs(make_scene, device):
    """A stream along the bed: what dissipates does nothing without wall_alpha, and holds the lowest rows with it."""
    forces = []
    for wall_alpha in (0.0, 0.05):
        scene = make_scene(TANK, f"materials.water.wall_alpha={wall_alpha}", "fluids[0].velocity=[0.5, 0.0]")
        simulation = Simulation(scene, device)
        simulation.step.neighbours.dummies.press()
        simulation.step.scheme.fluid.sweep(continuity=False)[0]()
        x = simulation.state.position.numpy()
        dissipative = simulation.state.dissipative_acceleration.numpy()
        middle = (x[:, 0] > 0.06) & (x[:, 0] < 0.14)
        forces.append([dissipative[middle & (np.abs(x[:, 2] - z) < 0.1 * DX), 0].mean() for z in (0.005, 0.055)])
        assert simulation.state.diffusion_rate.numpy()[middle & (x[:, 2] < DX)] == pytest.approx(0.0, abs=1.0)
    assert forces[0] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert forces[1][0] < -0.1
    assert forces[1][1] == pytest.approx(0.0, abs=1e-3)


def test_bits_depend_neither_on_threads_nor_on_a_checkpoint(make_scene, bits, resumed, tmp_path):
    from warpsph.output.checkpoint import write_checkpoint

    scene = make_scene(COLLAPSE)
    one, two = Simulation(scene, "cpu", threads=1), Simulation(scene, "cpu", threads=2)
    one.reach(0.3)
    two.reach(0.3)
    assert bits(one) == bits(two)
    write_checkpoint(tmp_path, one)
    again = resumed(one, tmp_path)
    one.reach(0.35)
    again.reach(0.35)
    assert bits(one) == bits(again)


def test_there_is_nothing_to_tune(make_scene):
    scene = make_scene(TANK)
    assert make_scene(scene.resolved_yaml()).wall_model == scene.wall_model
    for field in ("strength", "set_back", "refinement"):
        with pytest.raises(SceneError, match=rf"wall_model\.{field}: means nothing to dummy_particles"):
            make_scene(TANK, f"wall_model.{field}=2.0")


def test_what_does_not_know_dummies_is_refused(make_scene):
    mirror = "[{name: m, mirror: {point: [0.0, 0.0], normal: [1.0, 0.0]}}]"
    with pytest.raises(SceneError, match="neighbours: lists are needed for walls of dummy particles"):
        make_scene(TANK, "neighbours=cells")
    for path, value in (("images", mirror), ("viscosity.weights", "balanced")):
        with pytest.raises(SceneError, match=f"{path}: walls of dummy particles do not know this yet"):
            make_scene(TANK, f"{path}={value}")


FLUME = """
title: A paddle and a box that floats
spacing: 0.02
materials: {water: {density: 1000.0, sound_speed: 20.0, alpha: 0.01}}
density_diffusion: {model: fourtakas, delta: 0.1}
xsph: 0.0
walls: [{name: flume, path: [[-0.3, 0.4], [-0.3, 0.0], [1.2, 0.0], [1.2, 0.4]]}]
wall_model: {force: dummy_particles}
fluids: [{name: water, material: water, fill: {level: 0.2, above: flume, between: [0.0, 1.2]}}]
bodies:
  - name: paddle
    shape: {box: {min: [-0.16, 0.0], max: [0.0, 0.3]}}
    density: 1000.0
    motion: {kind: sine, shift: [0.02, 0.0], period: 0.8}
  - name: box
    shape: {box: {min: [-0.12, -0.06], max: [0.12, 0.06]}}
    at: [0.6, 0.2]
    mass: 14.4
run: {end_time: 0.6}
"""


def test_the_loads_on_bodies_are_what_they_do_to_the_fluid(make_scene, device):
    """In a tank without walls in reach of the water's middle the sum of m a over the fluid is minus the loads."""
    simulation = Simulation(make_scene(FLUME), device)
    simulation.reach(0.3)
    step, state = simulation.step, simulation.state
    step._pack()
    dummies = step.neighbours.dummies
    dummies.press()
    step.scheme.fluid.sweep(continuity=False)[0]()
    dummies.take_loads()()
    x = state.position.numpy()
    m = simulation.model.parameters.mass.numpy()[0]
    a = state.pressure_acceleration.numpy().astype(float) + state.dissipative_acceleration.numpy()
    # What pairs of the fluid do to each other cancels; what is left is bodies and walls.
    total = m * a.sum(axis=0)
    load = simulation.bodies.set.point_force.numpy().astype(float)
    packed = np.concatenate([s.numpy() for s in (state.position_volume, state.velocity_pressure)], axis=1).astype(float)
    n, at_rest = len(x), len(simulation.model.wall_position)
    h = simulation.scene.smoothing_length
    r = packed[:n, None, [0, 2]] - packed[None, n : n + at_rest, [0, 2]]
    q = np.linalg.norm(r, axis=2) / h
    p_i, p_d = packed[:n, None, 7], packed[None, n : n + at_rest, 7]
    pair = packed[:n, None, 3] * packed[None, n : n + at_rest, 3] * (np.maximum(p_i, 0.0) + p_d) * slope(q, h)
    by_walls = -(pair[..., None] * r).sum(axis=(0, 1))
    by_bodies = total[[0, 2]] - by_walls
    assert -load.sum(axis=0)[[0, 2]] == pytest.approx(by_bodies, rel=2e-3, abs=2e-3 * float(np.abs(by_bodies).max()))


def falling_box(make_scene, device) -> tuple[float, float, float]:
    """What a box that falls gains in energy, by how much the fluid's sum changes, and what it says walls did [J/m]."""
    simulation = Simulation(make_scene(FLUME, "bodies[0].motion.shift=[0.0, 0.0]", "bodies[1].at=[0.6, 0.23]"), device)
    start, bodies = simulation.energy.measure()[0], sum(simulation.bodies.energies())
    simulation.reach(0.6)
    end, gained = simulation.energy.measure()[0], sum(simulation.bodies.energies()) - bodies
    assert gained < -0.5  # it falls by 0.01 m or so, at 141 N/m
    assert not simulation.bodies.holds(simulation.state.position.numpy()).any()
    return gained, end.total - start.total, end.wall_work


def test_the_book_of_the_fluid_closes_beside_a_body(make_scene, device):
    gained, strayed, _ = falling_box(make_scene, device)
    assert strayed == pytest.approx(0.0, abs=0.01 * abs(gained))


def test_fluid_takes_what_a_body_loses(make_scene, device):
    gained, _, wall_work = falling_box(make_scene, device)
    assert wall_work == pytest.approx(-gained, rel=0.02)


def test_a_paddle_makes_the_wave_that_it_should(make_scene, device):
    """Volume pushed aside by the paddle at its foremost place raises the water: no water passes it."""
    scene = make_scene(FLUME, "run.end_time=1.0")
    simulation = Simulation(scene, device)
    for time in np.linspace(0.0, 0.6, 13)[1:]:
        simulation.reach(time)
        face = simulation.bodies.places()[0][0][0] + 0.08
        x = simulation.state.position.numpy()
        assert (x[:, 0] - face).min() > -0.1 * 0.02
    assert fastest(simulation) < 1.0


def test_fluid_that_moves_from_the_start_beside_dummies(make_scene, device):
    """The first rate of density is that of the flow: none in one that moves as a whole along a flume."""
    text = """
title: A stream in a flume
spacing: 0.02
xsph: 0.0
materials: {water: {density: 1000.0, sound_speed: 20.0}}
wall_model: {force: dummy_particles}
walls: [{name: flume, path: [[-0.6, 0.5], [-0.6, 0.0], [1.6, 0.0], [1.6, 0.5]]}]
fluids: [{name: water, material: water, velocity: [0.1, 0.0], fill: {level: 0.2, above: flume, between: [0.0, 1.0]}}]
run: {end_time: 4.0}
"""
    simulation = Simulation(make_scene(text), device)
    assert np.abs(simulation.state.density_rate.numpy()).max() < 0.1 * 1000.0 / 0.02  # a tenth of rho u / dx
    simulation.advance(0.002)
    assert np.abs(simulation.state.density.numpy() / 1000.0 - 1.0).max() < 0.01
