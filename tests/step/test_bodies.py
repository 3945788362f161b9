"""Bodies in the fluid: action and reaction, the lists, and that neither checkpoints nor threads leave a trace."""

import numpy as np
import pytest

from scenes import pool, scene, tank
from warpsph.bodies.body_set import rotation
from warpsph.cli import SCENES
from warpsph.output.checkpoint import write_checkpoint
from warpsph.simulation import Simulation
from warpsph.step.bodies import columns

# Single precision, summed over hundreds of steps: relative to the impulse that is exchanged.
TOLERANCE = 1e-5

RAFT = scene(
    "A raft and a stone in a tank",
    0.02,
    [tank(0.8, 0.6)],
    [pool(0.3)],
    """bodies:
  - name: raft
    shape: {polygon: [[-0.1, -0.06], [0.1, -0.06], [0.14, 0.06], [-0.1, 0.06]]}
    at: [0.3, 0.3]
    angle: 5.0
    density: 500.0
    velocity: [0.3, 0.0]
    hold: true
    contact: {restitution: 0.3, static_friction: 0.2, dynamic_friction: 0.1}
  - {name: stone, shape: {disc: {center: [0.6, 0.44], radius: 0.07}}, density: 1500.0, spin: 4.0, hold: true}""",
    "warm_up: {duration: 0.1, damping: 50.0}",
    "xsph: 0.0",
    sound_speed=30.0,
    alpha=0.05,
    wall_alpha=0.02,
)


# A crate and a ball in 3-D, the ball on the crate; the tank small, so that steps are quick.
SPACE = """
title: A crate and a ball in a box of water
dimensions: 3
spacing: 0.04
materials:
  water: {density: 1000.0, sound_speed: 30.0, alpha: 0.05, wall_alpha: 0.02}
xsph: 0.0
walls:
  - {name: tank, box: {min: [0.0, 0.0, 0.0], max: [0.48, 0.48, 0.6], open: [top]}}
fluids:
  - {name: water, material: water, fill: {level: 0.2, above: tank}}
bodies:
  - name: crate
    shape: {box: {min: [-0.12, -0.1, -0.1], max: [0.12, 0.1, 0.1]}}
    at: [0.26, 0.22, 0.24]
    angle: 10.0
    axis: [1.0, 2.0, 0.0]
    density: 600.0
    spin: [0.0, 0.0, 2.0]
    hold: true
    contact: {restitution: 0.3, static_friction: 0.3, dynamic_friction: 0.2}
  - name: ball
    shape: {sphere: {center: [0.24, 0.24, 0.44], radius: 0.08}}
    density: 500.0
    velocity: [0.0, 0.0, -1.0]
    hold: true
warm_up: {duration: 0.1, damping: 50.0}
run: {end_time: 1.0}
"""


def momentum(simulation: Simulation) -> tuple[np.ndarray, float]:
    """Momentum of fluid and bodies [kg/s], and their mass [kg/m]."""
    state, bodies = simulation.state, simulation.bodies.set
    mass = simulation.model.parameters.mass.numpy().astype(float)[state.fluid.numpy()]
    solid = np.array([body.mass.mass for body in bodies.bodies])
    total = mass @ state.velocity.numpy() + solid @ bodies.velocity.numpy()[1:]
    return total, float(mass.sum() + solid.sum())


@pytest.mark.parametrize(
    ("text", "force", "integrator"),
    [
        (RAFT, "radial", "verlet"),
        (RAFT, "monaghan_kos_issa", "verlet"),
        (RAFT, "radial", "runge_kutta"),
        (SPACE, "radial", "verlet"),
    ],
    ids=["plane", "by leg", "runge_kutta", "space"],
)
def test_momentum_changes_by_gravity_and_walls_alone(make_scene, text, force, integrator):
    """Walls by what is left of their push on the fluid once the reaction of the bodies is taken off, and by contact."""
    simulation = Simulation(make_scene(text, f"wall_model.force={force}", f"run.integrator={integrator}"))
    simulation.reach(0.0)
    state, bodies = simulation.state, simulation.bodies.set
    (before, mass), impulse, exchanged = momentum(simulation), np.zeros(3), 0.0
    particle_mass = simulation.model.parameters.mass.numpy().astype(float)[state.fluid.numpy()]
    simulation.step.aim_at(0.4)
    while simulation.time < 0.4:
        began = simulation.time
        simulation.step.run(1)
        dt = simulation.time - began
        on_points = bodies.point_force.numpy().astype(float).sum(axis=0)
        impulse += dt * (particle_mass @ state.wall_acceleration.numpy() + on_points - [0.0, 0.0, mass * 9.81])
        impulse += bodies.received.numpy()[1:].sum(axis=0)
        exchanged += dt * np.linalg.norm(on_points)
    after, _ = momentum(simulation)
    assert exchanged > (10.0 if text is RAFT else 1.0)
    np.testing.assert_allclose(after - before, impulse, atol=TOLERANCE * exchanged)


def test_loads_and_pushes_are_sums_over_all_pairs(make_scene, device):
    """Against sums over every particle and every point in double precision, after the lists have lived for a while."""
    simulation = Simulation(make_scene(RAFT, "materials.water.wall_alpha=0.0"), device)
    simulation.reach(0.05)
    state, bodies, p = simulation.state, simulation.bodies.set, simulation.model.parameters
    simulation.step.aim_at(0.06)
    simulation.step.run(5)
    for name in ("drift, pressure", "drift of bodies", "pair loop: forces, walls", "loads on bodies"):
        simulation.step.stages[name]()
    # Pushes by walls are no concern of the bodies: only particles that no wall reaches are looked at.
    far = state.position_volume.numpy().astype(float)[:, :3]
    to_walls = np.linalg.norm(far[:, None] - simulation.model.wall_position.numpy(), axis=2).min(axis=1)
    away = to_walls > simulation.model.support
    x = far[:, None] - bodies.point_position.numpy()
    r = np.linalg.norm(x, axis=2)
    q = r * p.inverse_h
    c = float(p.sound_speed.numpy()[0])
    W = (1.77 / 32.0) * (1.0 + q * (2.5 + 2.0 * q)) * np.maximum(2.0 - q, 0.0) ** 5
    pushes = (p.wall_strength * c**2 * W / r**2)[..., None] * x
    scale = np.abs(pushes.sum(axis=1)).max()
    assert np.any(pushes[away] != 0.0)
    found = state.wall_acceleration.numpy()[away]
    np.testing.assert_allclose(found, pushes[away].sum(axis=1), atol=1e-5 * scale)
    on_points = -float(p.mass.numpy()[0]) * pushes.sum(axis=0)
    scale = np.abs(on_points).max()
    np.testing.assert_allclose(bodies.point_force.numpy(), on_points, atol=1e-5 * scale)
    for b in (1, 2):
        mine = bodies.point_body.numpy() == b
        arm = bodies.point_position.numpy()[mine] - bodies.position.numpy()[b]
        np.testing.assert_allclose(bodies.force.numpy()[b], on_points[mine].sum(axis=0), atol=1e-4 * scale)
        torque = np.cross(arm, on_points[mine]).sum(axis=0)
        np.testing.assert_allclose(bodies.torque.numpy()[b], torque, atol=1e-4 * scale)


FAST = ["bodies[1].velocity=[-1.0, -3.0]", "bodies[1].shape.disc.radius=0.06"]


def test_no_pair_is_missing_however_fast_bodies_are(make_scene):
    """The distance to the nearest wall or body point, by the lists and by brute force, in every step of a splash."""
    simulation = Simulation(make_scene(RAFT, *FAST))
    simulation.reach(0.0)
    state, points = simulation.state, simulation.bodies.set.point_position
    walls, reach = simulation.model.wall_position.numpy(), simulation.model.support
    simulation.step.aim_at(0.1)
    rebuilds = simulation.step.neighbours.rebuilds
    while simulation.time < 0.1:
        x_before = state.position.numpy() + 0.5 * state.dt.numpy()[0] * state.velocity.numpy()
        if state.stale.numpy()[0] or state.dt.numpy()[0] == 0.0:
            simulation.step.run(1)
            continue
        simulation.step.stages["drift of bodies"]  # its points, at the half step, are read below
        moved = points.numpy()
        simulation.step.run(1)
        # The body has moved by half a step since `moved`; allow for that.
        slack = 0.1 * simulation.scene.smoothing_length
        nearest = np.linalg.norm(x_before[:, None] - np.concatenate([moved, walls]), axis=2).min(axis=1)
        wrong = (nearest < reach - slack) & (np.abs(state.wall_distance.numpy() - nearest) > slack)
        assert not wrong.any(), simulation.time
    assert simulation.step.neighbours.rebuilds - rebuilds < simulation.step_count / 3


@pytest.mark.parametrize(
    ("text", "time"),
    [(RAFT, -0.05), (RAFT, 0.0), (RAFT, 0.1), (SPACE, 0.12)],
    ids=["held", "release", "released", "touching in space"],
)
def test_goes_on_bit_for_bit(make_scene, device, tmp_path, bits, resumed, text, time):
    whole = Simulation(make_scene(text), device)
    whole.reach(time)
    write_checkpoint(tmp_path, whole)
    part = resumed(whole, tmp_path)
    for simulation in (whole, part):
        simulation.reach(0.2)
    assert bits(part) == bits(whole)
    assert part.bodies.rows() == whole.bodies.rows()


@pytest.mark.parametrize("text", [RAFT, SPACE], ids=["plane", "space"])
def test_same_bits_on_any_number_of_threads(make_scene, bits, text):
    runs = [Simulation(make_scene(text), threads=threads) for threads in (1, 3)]
    for simulation in runs:
        simulation.reach(0.15)
    assert bits(runs[0]) == bits(runs[1])


def test_held_body_stays_and_then_starts_with_its_velocity(make_scene):
    simulation = Simulation(make_scene(RAFT))
    place = simulation.bodies.set.position.numpy().copy()
    simulation.reach(-0.01)
    np.testing.assert_array_equal(simulation.bodies.set.position.numpy(), place)
    assert not simulation.bodies.set.point_velocity.numpy().any()
    simulation.reach(0.0)
    (raft, stone) = simulation.bodies.rows()
    assert raft[3:6] == pytest.approx([0.3, 0.0, 0.0]) and stone[5] == pytest.approx(4.0)
    simulation.reach(0.001)
    assert simulation.bodies.set.position.numpy()[1, 0] == pytest.approx(place[1, 0] + 0.0003, rel=1e-3)


def test_step_is_short_enough_for_fast_bodies(make_scene):
    """No point moves more than a tenth of a smoothing length in a step, or contact would not see it coming."""
    scene = make_scene(RAFT, "bodies[1].velocity=[0.0, -5.0]", "materials.water.sound_speed=40.0", "run.courant=1.0")
    simulation = Simulation(scene)
    simulation.reach(0.0)
    assert simulation.state.dt_limit.numpy()[0] > 0.0
    simulation.advance(0.002)
    speed = np.linalg.norm(simulation.bodies.set.velocity.numpy(), axis=1).max() + 4.0 * 0.07
    assert simulation.state.dt_limit.numpy()[0] * speed <= 0.1 * scene.smoothing_length * (1.0 + 1e-5)


def test_prescribed_body_goes_its_way(make_scene):
    motion = "bodies[0].motion={kind: sine, shift: [0.02, 0.0], turn: 10.0, period: 0.2}"
    free = ["bodies[0].hold=false", "bodies[0].velocity=null"]
    simulation = Simulation(make_scene(RAFT, motion, *free))
    start = simulation.bodies.rows()[0]
    simulation.reach(0.05)  # a quarter of the period: the amplitude, and at rest
    x, z, angle, u, w, spin, *_ = simulation.bodies.rows()[0]
    assert (x - start[0], z - start[1]) == pytest.approx((0.02, 0.0), abs=1e-9)
    assert angle == pytest.approx(10.0) and (u, w, spin) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_energy_of_bodies(make_scene):
    simulation = Simulation(make_scene(RAFT))
    simulation.reach(0.0)
    raft, stone = simulation.bodies.set.bodies
    kinetic, potential = simulation.bodies.energies()
    inertia = stone.mass.inertia[1, 1]
    assert inertia == pytest.approx(0.5 * stone.mass.mass * 0.07**2)
    assert kinetic == pytest.approx(0.5 * raft.mass.mass * 0.3**2 + 0.5 * inertia * 4.0**2)
    assert potential == pytest.approx(9.81 * (raft.mass.mass * raft.mass.centre[2] + stone.mass.mass * 0.44))


AFLOAT = scene(
    "A box where it floats",
    0.015,
    [tank(0.75, 0.5)],
    [pool(0.3)],
    """bodies:
  - name: box
    shape: {box: {min: [-0.15, -0.09], max: [0.15, 0.09]}}
    at: [0.375, 0.3]
    density: 500.0
    hold: true""",
    "warm_up: {duration: 1.5, damping: 20.0}",
    "xsph: 0.0",
    sound_speed=22.5,
    end_time=0.05,
    alpha=0.05,
)


def pulse(simulation: Simulation, until: float = 0.05) -> float:
    """The largest change of pressure until then after the release, over that of the bed.

    Of 99 % of the particles: grains of the lattice that slip past each other, one by one, are no pulse.
    """
    simulation.reach(0.0)
    before, worst = simulation.state.snapshot().pressure, 0.0
    for time in np.arange(0.0025, until + 1e-9, 0.0025):
        simulation.advance(time)
        worst = max(worst, np.quantile(np.abs(simulation.state.snapshot().pressure - before), 0.99))
    return float(worst / (1000.0 * 9.81 * 0.3))


@pytest.mark.parametrize("hold", ["true", "false"], ids=["held where it floats", "finds where it floats"])
def test_body_that_is_let_go_where_forces_balance_gives_no_kick(make_scene, hold):
    """No pulse above 2 % of hydrostatic within 0.05 s of the release; one that is free to move finds the place."""
    simulation = Simulation(make_scene(AFLOAT, f"bodies[0].hold={hold}"))
    assert pulse(simulation) < 0.02
    weight = 9.81 * simulation.bodies.set.bodies[0].mass.mass
    assert simulation.bodies.rows()[0][7] == pytest.approx(weight, rel=0.02)


def test_body_that_is_let_go_elsewhere_gives_a_kick(make_scene):
    """As it should: the water has to make way for it."""
    assert pulse(Simulation(make_scene(AFLOAT, "bodies[0].density=900.0"))) > 0.04


def depth_below_ramp(simulation: Simulation) -> float:
    """How far the lowest corner of the first body is below a ramp of 30 degrees and the bed, z = 0 [m]."""
    (solid,), ((x, q),) = simulation.bodies.solids, simulation.bodies.places()
    corners = solid.corners()[0] @ rotation(q).T + x
    return float(np.max(np.maximum(-corners[:, 0] * np.tan(np.radians(30.0)), 0.0) - corners[:, 2]))


def test_fastest_block_stays_on_its_ramp(make_scene):
    """block_maciel.yaml in a shorter flume at 6 m/s, twice the highest speed of its series."""
    text = (SCENES / "block_maciel.yaml").read_text()
    fast = ["bodies[0].velocity=[5.196152, -3.0]", "materials.water.sound_speed=60.0"]
    shorter = ["walls[0].path[2]=[1.8, 0.0]", "walls[0].path[3]=[1.8, 0.6]", "spacing=0.02", "gauges=[]"]
    simulation = Simulation(make_scene(text, *fast, *shorter))
    for time in np.arange(0.0, 0.3, 0.01):
        simulation.reach(time)
        assert depth_below_ramp(simulation) < 1e-3, time
    assert simulation.bodies.rows()[0][0] > 0.3  # it has passed the toe


def test_ball_falls_on_a_crate_in_water(make_scene):
    """The ball bounces off the crate, which dips, and neither enters the other; the row of each has its 19 columns."""
    simulation = Simulation(make_scene(SPACE))
    simulation.reach(0.0)
    crate = simulation.bodies.solids[0]
    nearest, received = np.inf, 0.0
    for time in np.arange(0.01, 0.2, 0.01):
        simulation.reach(time)
        (x, q), (centre, _) = simulation.bodies.places()
        place = (centre - x) @ rotation(q) + crate.body.mass.centre
        nearest = min(nearest, float(crate.distance(place[None])[0]) * (1.0 - 2.0 * crate.contains(place[None])[0]))
        received = max(received, np.linalg.norm(simulation.bodies.set.received.numpy()[2]))
    assert received > 0.0
    assert nearest == pytest.approx(0.08, abs=1e-4)
    assert not simulation.bodies.holds(simulation.state.snapshot().position).any()
    assert [len(row) for row in simulation.bodies.rows()] == [len(columns(3))] * 2


def test_turns_about_a_given_axis(make_scene):
    """A quarter of a sine about z through a pivot: right-handed, from x to y."""
    motion = "bodies[0].motion={kind: sine, turn: 40.0, axis: [0.0, 0.0, 3.0], pivot: [0.24, 0.22, 0.2], period: 0.2}"
    free = ["bodies[0].hold=false", "bodies[0].spin=null", "bodies[0].angle=0.0"]
    simulation = Simulation(make_scene(SPACE, motion, *free))
    start = simulation.bodies.solids[0].body.mass.centre
    simulation.reach(0.05)
    (x, q), _ = simulation.bodies.places()
    angle, arm = np.radians(40.0), start[0] - 0.24
    np.testing.assert_allclose(q, [0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)], atol=1e-6)
    np.testing.assert_allclose(x, [0.24 + arm * np.cos(angle), 0.22 + arm * np.sin(angle), start[2]], atol=1e-6)
