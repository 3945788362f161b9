"""Rigid bodies against mechanics: free tops, locks, prescribed motions, loads, and points that follow."""

import math

import numpy as np
import pytest
import warp as wp

from warpsph.bodies.body import PLANE_SHIFT, PLANE_TURN, Body
from warpsph.bodies.body_set import BodySet, rotation
from warpsph.bodies.motion import Motion, MotionTable
from warpsph.device.launch import Launcher
from warpsph.shapes.mesh import box_mesh, solid_mass
from warpsph.shapes.outline import box_outline
from warpsph.shapes.sampling import surface_of_mesh, surface_of_outline
from warpsph.shapes.section import MassProperties, plane_mass

# Double precision over 1e4 steps: relative drift of what the integrator keeps exactly.
TOLERANCE = 1e-10
G = np.array([0.0, 0.0, -9.81])

BRICK = box_mesh([0.0, 0.0, 0.0], [0.3, 0.2, 0.1])
OUTLINE = box_outline((0.2, 0.1), (0.5, 0.2))


class Run:
    """Bodies that are stepped on their own, with the time step and the loads that a test gives."""

    def __init__(self, device, bodies, dt, gravity=(0.0, 0.0, 0.0), dimensions=3, threads=1):
        launcher = Launcher(device, threads)
        self.set = BodySet(launcher, bodies, smoothing_length=0.02, dimensions=dimensions, gravity=gravity)
        self.time = wp.zeros(1, dtype=wp.float64, device=launcher.device)
        self.dt, self.step = wp.array([dt], dtype=float, device=launcher.device), float(np.float32(dt))
        self.done = 0
        self.stages = [
            self.set.drift(0.0, 0.5, self.time, self.dt),
            self.set.sum_loads(),
            self.set.kick(self.time, self.dt),
            self.set.drift(0.5, 1.0, self.time, self.dt),
        ]

    def __call__(self, steps):
        for _ in range(steps):
            self.time.fill_(self.done * self.step)  # a step begins
            for stage in self.stages:
                stage()
            self.done += 1
        return self

    def state(self, body=1):
        arrays = (self.set.position, self.set.orientation, self.set.velocity, self.set.spin)
        return [array.numpy()[body] for array in arrays]


@pytest.fixture
def run(device):
    """A function of bodies and dt [s] that gives a `Run`."""
    return lambda *arguments, **options: Run(device, *arguments, **options)


def brick(**fields) -> Body:
    return Body("brick", solid_mass(BRICK, density=500.0), surface_of_mesh(BRICK, 0.05), **fields)


def slab(**fields) -> Body:
    locks = {"free_shift": PLANE_SHIFT, "free_turn": PLANE_TURN}
    return Body("slab", plane_mass(OUTLINE, mass=20.0), surface_of_outline(OUTLINE, 0.02), OUTLINE, **(locks | fields))


def momentum(body: Body, orientation, spin) -> np.ndarray:
    R = rotation(orientation)
    return R @ body.mass.inertia @ R.T @ spin


# ---- spinning freely ----


def test_asymmetric_top_keeps_energy_and_momentum(run):
    """1e4 steps about the unstable middle axis: it tumbles over and over, and loses nothing."""
    body = brick(spin=(0.05, 12.0, 0.02))
    top = run([body], 1e-3)
    _, q, _, w = top.state()
    L, E = momentum(body, q, w), top.set.kinetic_energy()[1]
    turned_over = 0
    for _ in range(10):
        top(1000)
        _, q, _, w = top.state()
        turned_over += rotation(q)[1, 1] < 0.0
        np.testing.assert_allclose(momentum(body, q, w), L, rtol=0, atol=TOLERANCE * np.linalg.norm(L))
        assert top.set.kinetic_energy()[1] == pytest.approx(E, rel=TOLERANCE)
        assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-14)
    assert 0 < turned_over < 10


def test_top_is_of_second_order(run):
    """The orientation after 1 s against that of a step 16 times as short: the error falls by 4 with each halving."""
    body = brick(spin=(3.0, 9.0, 2.0))
    ways = [rotation(run([body], 1.0 / n)(n).state()[1]) for n in (128, 256, 512, 8192)]
    errors = np.array([np.abs(way - ways[-1]).max() for way in ways[:-1]])
    np.testing.assert_allclose(errors[:-1] / errors[1:], 4.0, rtol=0.05)


def test_symmetric_top_precesses_as_euler_says(run):
    """J = (2, 2, 1): the spin turns about the body's z at (J_z - J_x) / J_x w_z, and that axis about L at |L| / J_x."""
    mass = MassProperties(1.0, np.zeros(3), np.diag([2.0, 2.0, 1.0]))
    body = Body("top", mass, surface_of_mesh(BRICK, 0.05), spin=(1.0, 0.0, 4.0))
    dt, steps = 1e-3, 2000
    top = run([body], dt)(steps)
    _, q, _, w = top.state()
    angle = -0.5 * 4.0 * steps * top.step
    expected = [math.cos(angle), math.sin(angle), 4.0]
    np.testing.assert_allclose(rotation(q).T @ w, expected, atol=1e-5)
    L = np.array([2.0, 0.0, 4.0])
    unit, rate = L / np.linalg.norm(L), np.linalg.norm(L) / 2.0
    z, turn = np.array([0.0, 0.0, 1.0]), rate * steps * top.step
    around = z * math.cos(turn) + np.cross(unit, z) * math.sin(turn) + unit * (unit @ z) * (1 - math.cos(turn))
    np.testing.assert_allclose(rotation(q)[:, 2], around, atol=1e-5)


def test_spin_in_the_plane(run):
    """Spin and energy to rounding after 1e4 steps and 160 turns; positive spin turns z towards x."""
    spinning = run([slab(spin=(0.0, 10.0, 0.0), velocity=(0.3, 0.0, 0.0))], 1e-2, dimensions=2)
    E = spinning.set.kinetic_energy()[1]
    spinning(1)
    up = rotation(spinning.state()[1]) @ [0.0, 0.0, 1.0]
    assert up[0] > 0.0
    spinning(9999)
    x, q, u, w = spinning.state()
    assert w[1] == 10.0 and not w[[0, 2]].any()
    assert spinning.set.kinetic_energy()[1] == pytest.approx(E, rel=1e-14)
    np.testing.assert_array_equal(u, [0.3, 0.0, 0.0])
    assert x[0] == pytest.approx(0.35 + 0.3 * 1e4 * spinning.step, rel=TOLERANCE)
    assert not q[[0, 2]].any() and x[1] == 0.0


def test_free_fall_is_a_parabola(run):
    thrown = run([brick(velocity=(1.0, -0.5, 2.0))], 1e-3, gravity=G)(500)
    x, _, u, _ = thrown.state()
    t = 500 * thrown.step
    np.testing.assert_allclose(u, np.array([1.0, -0.5, 2.0]) + G * t, rtol=TOLERANCE)
    start = thrown.set.bodies[0].mass.centre
    np.testing.assert_allclose(x, start + np.array([1.0, -0.5, 2.0]) * t + 0.5 * G * t * t, rtol=1e-9)


# ---- locks, release, loads ----


def test_locked_degrees_do_not_move(run):
    body = brick(free_shift=(1.0, 0.0, 0.0), free_turn=(0.0, 0.0, 1.0))
    held = run([body], 1e-3, gravity=(1.0, 2.0, 3.0))
    held.set.point_force.fill_(wp.vec3(0.3, -0.2, 0.1))
    held(200)
    x, q, u, w = held.state()
    assert u[0] > 0.0 and not u[1:].any()
    assert not w[:2].any() and not q[:2].any()
    np.testing.assert_array_equal(x[1:], body.mass.centre[1:])


def test_body_is_held_until_its_release(run):
    """At rest to the bit until then, and afterwards as if it had begun then."""
    held = run([brick(release=0.0995)], 1e-3, gravity=G)(100)
    np.testing.assert_array_equal(held.state()[0], held.set.bodies[0].mass.centre)
    held(100)
    assert held.state()[2][2] == pytest.approx(-9.81 * 100 * held.step, rel=1e-12)


@pytest.mark.parametrize("threads", [1, 3])
def test_loads_are_summed_in_order(device, run, threads):
    """Forces of 300 points against NumPy, and the same bits for any number of threads."""
    bodies = [slab(), slab(velocity=(1.0, 0.0, 0.0))]
    loaded = run(bodies, 1e-3, dimensions=2, threads=threads)
    random = np.random.default_rng(5)
    forces = random.normal(size=(loaded.set.point_count, 3)).astype(np.float32)
    loaded.set.point_force.assign(forces)
    loaded(3)
    loaded.set.move_points()()
    loaded.set.sum_loads()()
    owner, places = loaded.set.point_body.numpy(), loaded.set.point_position.numpy().astype(float)
    for b in (1, 2):
        mine, x = owner == b, loaded.state(b)[0]
        total = forces[mine].astype(float).sum(axis=0)
        torque = np.cross(places[mine] - x, forces[mine]).sum(axis=0)
        np.testing.assert_allclose(loaded.set.force.numpy()[b], total, rtol=1e-12)
        np.testing.assert_allclose(loaded.set.torque.numpy()[b], torque, atol=1e-6)
    other = run(bodies, 1e-3, dimensions=2, threads=1)
    other.set.point_force.assign(forces)
    other(3)
    np.testing.assert_array_equal(other.set.velocity.numpy(), loaded.set.velocity.numpy())


def test_a_constant_force_and_torque(run):
    """J W = tau t and M U = F t for a body in the plane: eq 108 and 109."""
    body = slab()
    loaded = run([body], 1e-3, dimensions=2)
    forces = np.zeros((loaded.set.point_count, 3), np.float32)
    forces[0] = [2.0, 0.0, 3.0]
    loaded.set.point_force.assign(forces)
    arm = body.surface.points[0] - body.mass.centre
    loaded(1)
    _, _, u, w = loaded.state()
    np.testing.assert_allclose(u, np.array([2.0, 0.0, 3.0]) * loaded.step / 20.0, rtol=1e-12, atol=1e-18)
    torque = np.cross(arm, [2.0, 0.0, 3.0])[1]
    assert w[1] == pytest.approx(torque * loaded.step / body.mass.inertia[1, 1], rel=1e-12)


def test_points_follow_their_body(run):
    """x_k = X + R r, u_k = U + W x (x_k - X) by finite differences, normals turned along."""
    body = brick(spin=(1.0, 2.0, -3.0), velocity=(0.1, 0.2, 0.3))
    moving = run([body], 1e-3)(300)
    move = moving.set.move_points()
    move()
    x, q, _, _ = moving.state()
    state = (moving.set.point_position, moving.set.point_velocity, moving.set.point_normal)
    points, velocity, normals = (array.numpy().copy() for array in state)
    R = rotation(q)
    np.testing.assert_allclose(points, x + (body.surface.points - body.mass.centre) @ R.T, atol=1e-7)
    np.testing.assert_allclose(normals, body.surface.normals @ R.T, atol=1e-6)
    moving(1)
    move()
    np.testing.assert_allclose((moving.set.point_position.numpy() - points) / moving.step, velocity, atol=5e-3)


# ---- prescribed motions ----


def expected_course(motion: Motion, t: float) -> float:
    since = max(t - motion.begin, 0.0)
    if motion.kind == "constant":
        return since
    if motion.kind == "ramp":
        return since**2 / (2 * motion.period) if since < motion.period else since - motion.period / 2
    return math.sin(2 * math.pi * since / motion.period + motion.phase) - math.sin(motion.phase)


@pytest.mark.parametrize(
    "motion",
    [
        Motion("constant", direction=(0.5, 0.0, -0.2), turn=1.0),
        Motion("ramp", direction=(0.5, 0.0, 0.0), turn=-0.3, period=0.2, begin=0.05),
        Motion("sine", direction=(0.1, 0.0, 0.02), turn=0.2, period=0.4, phase=0.3, pivot=(0.0, 0.0, 0.0)),
    ],
)
def test_prescribed_motions(run, motion):
    """Place and velocity by the formula; gravity and forces do nothing."""
    body = slab(motion=motion)
    paddle = run([body], 1e-3, gravity=G, dimensions=2)
    paddle.set.point_force.fill_(wp.vec3(1.0, 1.0, 1.0))
    pivot = body.mass.centre if motion.pivot is None else np.array(motion.pivot)

    def place(t: float) -> np.ndarray:
        s = expected_course(motion, t)
        c, n = math.cos(motion.turn * s), math.sin(motion.turn * s)
        turn = np.array([[c, 0.0, n], [0.0, 1.0, 0.0], [-n, 0.0, c]])
        return pivot + turn @ (body.mass.centre - pivot) + s * np.array(motion.direction)

    for _ in range(6):
        paddle(60)
        t = paddle.done * paddle.step
        x, q, u, w = paddle.state()
        np.testing.assert_allclose(x, place(t), atol=1e-12)
        np.testing.assert_allclose(u, (place(t + 1e-6) - place(t - 1e-6)) / 2e-6, atol=1e-6)
        turned = 2.0 * math.atan2(q[1], q[3])
        assert turned == pytest.approx(motion.turn * expected_course(motion, t), abs=1e-12)
        ahead = (expected_course(motion, t + 1e-6) - expected_course(motion, t - 1e-6)) / 2e-6
        assert w[1] == pytest.approx(motion.turn * ahead, abs=1e-6)


def test_motion_by_a_table(run):
    """Through every row, never outside of two rows between them, velocity the slope of that, at rest after the last."""
    time = np.array([0.0, 0.05, 0.15, 0.2, 0.3])
    shift = np.stack([time**2, 0 * time, [0.0, 0.0, 0.1, 0.1, 0.04]], axis=1)
    motion = Motion("table", table=MotionTable(time, shift, -0.4 * time**2), begin=0.1)
    body = slab(motion=motion)
    paddle = run([body], 1e-3, dimensions=2)
    times, places, speeds = [], [], []
    for _ in range(420):
        paddle(1)
        x, q, u, _ = paddle.state()
        times.append(paddle.done * paddle.step - 0.1)
        places.append([*(x - body.mass.centre), 2.0 * math.atan2(q[1], q[3])])
        speeds.append(np.array(u))
    times, places, speeds = np.array(times), np.array(places), np.array(speeds)
    for row, (t, where) in enumerate(zip(time, shift, strict=True)):
        k = np.argmin(np.abs(times - t))
        np.testing.assert_allclose(places[k], [*where, -0.4 * t**2], atol=1e-8)
        if row:
            between = (times > time[row - 1]) & (times < t)
            low, high = np.minimum(shift[row - 1], where), np.maximum(shift[row - 1], where)
            assert (places[between, :3] > low - 1e-8).all() and (places[between, :3] < high + 1e-8).all()
    inside = (times > 0.002) & (times < 0.298)
    slopes = np.gradient(places[:, :3], times, axis=0)
    np.testing.assert_allclose(speeds[inside], slopes[inside], atol=0.06)
    np.testing.assert_array_equal(speeds[times > 0.3], 0.0)
    np.testing.assert_allclose(places[-1, :3], shift[-1], atol=1e-8)
