"""Contact against mechanics: slopes, bounces, rolling, toppling, ramps with a toe, stacks; and nothing tunnels."""

import math
from itertools import pairwise

import numpy as np
import pytest

from warpsph.bodies.body import PLANE_SHIFT, PLANE_TURN, Body
from warpsph.bodies.contact_geometry import contact_depth, contact_legs, contact_points
from warpsph.shapes.outline import Bend, Line, Outline, box_outline, polygon_outline
from warpsph.shapes.points import turned
from warpsph.shapes.sampling import surface_of_outline
from warpsph.shapes.section import plane_mass

# What the issue asks of contact: relative.
TOLERANCE = 0.01
G, H = 9.81, 0.0225
FLOOR = Outline((Line(np.array([-5.0, 0.0]), np.array([5.0, 0.0])),), closed=False)


@pytest.fixture
def run(touching):
    """A function of bodies, and of a wall that is drawn with its free side on the left, that lets them go."""

    def let_go(bodies, wall=None, **options):
        walls = (contact_legs(wall, 1, contact_depth(H)), contact_points(wall, 1)) if wall else ()
        return touching(bodies, *walls, smoothing_length=H, **options)

    return let_go


def body(outline: Outline, mass=31.0, friction=0.0, at_rest=None, **fields) -> Body:
    return Body(
        "body",
        plane_mass(outline, mass=mass),
        surface_of_outline(outline, H / 3),
        outline,
        free_shift=PLANE_SHIFT,
        free_turn=PLANE_TURN,
        static_friction=friction if at_rest is None else at_rest,
        dynamic_friction=friction,
        **fields,
    )


def disc(x, z, radius=0.05, **fields) -> Body:
    return body(Outline((Bend(np.array([x, z]), radius, -0.5 * math.pi, 2.0 * math.pi),), closed=True), **fields)


def path(*corners) -> Outline:
    return Outline(tuple(Line(np.array(a), np.array(b)) for a, b in pairwise(corners)), closed=False)


def slope(angle: float) -> Outline:
    """Through the origin, down to the right."""
    way = np.array([math.cos(angle), -math.sin(angle)])
    return path(-20.0 * way, 20.0 * way)


def on_slope(angle: float, width=0.325, height=0.075, **fields) -> Body:
    corners = np.array([[-width / 2, 0.0], [width / 2, 0.0], [width / 2, height], [-width / 2, height]])
    return body(polygon_outline(turned(corners, -angle)), **fields)


# ---- friction ----


@pytest.mark.parametrize(("at_rest", "moving"), [(0.6, 0.6), (0.6, 0.1)])
def test_block_at_rest_below_the_friction_angle_stays(run, at_rest, moving):
    """5 s at 30 degrees (tan = 0.577): it does not creep, not by a nanometre, whatever friction it would slide with."""
    block = run([on_slope(math.radians(30.0), at_rest=at_rest, friction=moving)], slope(math.radians(30.0)))
    start = block.position()
    block(5.0)
    assert np.abs(block.position() - start).max() < 1e-9
    assert np.abs(block.velocity()).max() < 1e-9


@pytest.mark.parametrize(
    ("angle", "friction", "at_rest"),
    [(30.0, 0.3, 0.3), (30.0, 0.0, 0.0), (30.0, 0.3, 0.5), (10.0, 0.1, 0.1), (45.0, 0.9, 0.9)],
)
def test_block_slides_with_g_sin_minus_mu_cos(run, angle, friction, at_rest):
    a = math.radians(angle)
    block = run([on_slope(a, friction=friction, at_rest=at_rest)], slope(a))
    start = block.position()
    block(1.0)
    expected = G * (math.sin(a) - friction * math.cos(a))
    way = np.array([math.cos(a), 0.0, -math.sin(a)])
    assert block.velocity() @ way == pytest.approx(expected, rel=TOLERANCE)
    moved = block.position() - start
    assert moved @ way == pytest.approx(0.5 * expected, rel=TOLERANCE)
    assert np.linalg.norm(moved - moved @ way * way) < 1e-6 and abs(block.tilt()) < 1e-6


def test_block_that_slides_up_comes_back_or_stays(run):
    """u^2 / 2 g (sin + mu cos) up the slope; then it stays where mu_s > tan, without a jolt."""
    a, mu = math.radians(20.0), 0.5
    way = np.array([math.cos(a), 0.0, -math.sin(a)])
    block = run([on_slope(a, friction=mu, velocity=-1.5 * way)], slope(a))
    start = block.position()
    block(1.0)
    reach = 1.5**2 / (2 * G * (math.sin(a) + mu * math.cos(a)))
    assert (block.position() - start) @ -way == pytest.approx(reach, rel=TOLERANCE)
    assert np.abs(block.velocity()).max() < 1e-9


def test_load_along_the_plane_breaks_loose_at_the_static_coefficient(run):
    """Gravity turned instead of a load: 0.99 of the limit holds, 1.01 does not."""
    for share, moves in ((0.99, False), (1.01, True)):
        pull = share * 0.4 * G
        block = run([on_slope(0.0, at_rest=0.4, friction=0.2)], FLOOR, gravity=(pull, 0.0, -G))
        block(0.5)
        if moves:
            assert block.velocity()[0] == pytest.approx((pull - 0.2 * G) * 0.5, rel=0.03)
        else:
            assert np.abs(block.velocity()).max() < 1e-9


@pytest.mark.parametrize(("friction", "share"), [(0.5, 2.0 / 3.0), (0.0, 1.0)])
def test_disc_rolls_or_slips(run, friction, share):
    """A disc rolls down with 2/3 g sin where friction holds it (mu > tan / 3), and slips with g sin without any."""
    a = math.radians(25.0)
    center = 0.05 * np.array([math.sin(a), math.cos(a)])
    ball = run([disc(*center, friction=friction)], slope(a))(1.0)
    speed = ball.velocity() @ [math.cos(a), 0.0, -math.sin(a)]
    assert speed == pytest.approx(share * G * math.sin(a), rel=TOLERANCE)
    # Positive spin turns z to x: the way that a disc rolls along x.
    assert ball.spin()[1] == pytest.approx(speed / 0.05 if friction else 0.0, rel=TOLERANCE, abs=1e-9)


@pytest.mark.parametrize(("angle", "topples"), [(25.0, False), (28.0, True)])
def test_tall_block_topples_beyond_its_foot(run, angle, topples):
    """Foot 0.1 m, height 0.2 m: the balance is at atan(1/2) = 26.6 degrees."""
    a = math.radians(angle)
    tower = run([on_slope(a, 0.1, 0.2, friction=2.0)], slope(a))(1.0)
    assert (tower.tilt() > 0.2) == topples
    if not topples:
        assert abs(tower.tilt()) < 1e-9


# ---- bounces ----


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.8, 1.0])
@pytest.mark.parametrize("dt", [1e-4, 4e-4])
def test_dropped_ball_rebounds_with_its_restitution(run, restitution, dt):
    ball = run([disc(0.3, 0.25, restitution=restitution, friction=0.3)], FLOOR, dt=dt)
    fall = math.sqrt(2 * 0.2 / G)
    ball(fall * 0.98)
    before = math.sqrt(2 * G * 0.2)
    ball(fall * 0.04)
    after = fall * 1.02 - fall
    assert ball.velocity()[2] == pytest.approx(restitution * before - G * after * (restitution > 0), rel=0.02, abs=2e-2)
    assert ball.position()[2] > 0.05 - 1e-6
    assert abs(ball.position()[0] - 0.3) < 1e-9


def test_spinning_ball_bounces_off_along_the_floor(run):
    """It grips: mu large, no bounce. What is left is I W / (I + m r^2) of the spin: a third."""
    ball = run([disc(0.0, 0.0501, friction=5.0, spin=(0.0, 30.0, 0.0))], FLOOR)(0.05)
    assert ball.spin()[1] == pytest.approx(10.0, rel=TOLERANCE)
    assert ball.velocity()[0] == pytest.approx(0.05 * 10.0, rel=TOLERANCE)


def test_flat_block_lands_flat(run):
    block = run([body(box_outline((-0.16, 0.1), (0.16, 0.175)), friction=0.3, restitution=0.4)], FLOOR)(1.5)
    assert block.corners()[:, 1].min() > -1e-6
    assert abs(block.tilt()) < 1e-6 and np.abs(block.velocity()).max() < 1e-6


def test_nothing_gains_energy_by_contact(run):
    """A box tumbles down onto a corner of 90 degrees; the energy never rises by more than rounding."""
    tank = path([-0.6, 1.0], [-0.6, 0.0], [0.6, 0.0], [0.6, 1.0])
    box = box_outline((-0.1, 0.3), (0.1, 0.4))
    outline = polygon_outline(turned([leg.start for leg in box.legs], 0.7, (0.0, 0.35)))
    tumbling = run([body(outline, friction=0.4, restitution=0.5, velocity=(2.5, 0.0, 0.5), spin=(0, -8.0, 0))], tank)
    last = first = tumbling.energy()
    for _ in range(400):
        tumbling(0.005)
        energy = tumbling.energy()
        assert energy < last + 1e-4 * first
        last = energy
        corners = tumbling.corners()
        assert corners[:, 1].min() > -1e-4 and np.abs(corners[:, 0]).max() < 0.6 + 1e-4
    assert np.abs(tumbling.velocity()).max() < 0.05


# ---- ramps ----


def ramp(angle: float, radius: float) -> Outline:
    """Down to the right, an arc for a toe (a bare corner where its radius is 0), and a flat bed."""
    c, s, t = math.cos(angle), math.sin(angle), radius * math.tan(angle / 2)
    top, toe, bed = np.array([-3.0 * c, 3.0 * s]), np.array([-t * c, t * s]), np.array([t, 0.0])
    flat = Line(bed, np.array([8.0, 0.0]))
    if radius == 0.0:
        return Outline((Line(top, toe), flat), closed=False)
    centre = np.array([t, radius])
    begin = math.atan2(toe[1] - radius, toe[0] - t)
    return Outline((Line(top, toe), Bend(centre, radius, begin, angle), flat), closed=False)


def overlap(corners: np.ndarray, angle: float, radius: float) -> float:
    """How deep the deepest of `corners` is in the ramp, its arc or the bed [m]."""
    c, s, t = math.cos(angle), math.sin(angle), radius * math.tan(angle / 2)
    deep = []
    for x, z in corners:
        if x > t:
            deep.append(-z)
        elif x < -t * c:
            deep.append(-(x * s + z * c))
        else:
            deep.append(math.hypot(x - t, z - radius) - radius)
    return max(deep)


@pytest.mark.parametrize(
    ("angle", "radius", "speed", "friction"),
    [(30.0, 0.3, 2.0, 0.2), (30.0, 0.3, 3.0, 0.0), (30.0, 0.1, 6.0, 0.2), (45.0, 0.2, 3.0, 0.3), (10.0, 0.0, 2.0, 0.1)],
)
def test_block_runs_from_a_ramp_over_its_toe_onto_the_flat(run, angle, radius, speed, friction):
    """The chamfered block of Maciel & Nascimento (2002), also at twice the highest speed: no tunnel, no jump."""
    a = math.radians(angle)
    way = np.array([math.cos(a), -math.sin(a)])
    shape = np.array([[-0.1625, 0.0], [0.0875, 0.0], [0.1625, 0.075], [-0.1625, 0.075]])
    outline = polygon_outline(turned(shape, -a) - 0.8 * way)
    sliding = run([body(outline, friction=friction, velocity=(speed * way[0], 0.0, speed * way[1]))], ramp(a, radius))
    energies, speeds = [sliding.energy()], [speed]
    for _ in range(250):
        sliding(0.002)
        assert overlap(sliding.corners(), a, radius) < 2e-5  # h / 1000
        energies.append(sliding.energy())
        speeds.append(np.linalg.norm(sliding.velocity()))
    assert sliding.position()[0] > 0.2
    assert np.abs(np.sort(sliding.corners()[:, 1])[:2]).max() < 1e-5  # it lies flat on the bed
    assert np.max(np.diff(energies)) < 1e-4 * energies[0]
    if radius > 0.0:
        # On an arc of radius R speed changes by friction at most: mu (g + u^2 / R) a moment, or twice that on corners.
        most = (G + 2.0 * friction * (G + max(speeds) ** 2 / radius)) * 0.002 + 0.02 * max(speeds)
        assert np.abs(np.diff(speeds)).max() < most
    if friction == 0.0:
        assert energies[-1] == pytest.approx(energies[0], rel=0.005)


def test_frictionless_block_over_an_arc_loses_nothing_as_the_step_shrinks(run):
    """Every step ends along the arc, which costs (u dt / R)^2 / 2 of the energy: the loss is of first order in dt."""
    a, losses = math.radians(30.0), []
    for dt in (4e-4, 2e-4, 1e-4):
        way = np.array([math.cos(a), -math.sin(a)])
        shape = turned([[-0.1, 0.0], [0.1, 0.0], [0.1, 0.05], [-0.1, 0.05]], -a) - 0.4 * way
        sliding = run([body(polygon_outline(shape), velocity=(2.0 * way[0], 0.0, 2.0 * way[1]))], ramp(a, 0.3), dt=dt)
        first = sliding.energy()
        sliding(0.5)
        losses.append(1.0 - sliding.energy() / first)
    assert 0.0 < losses[-1] < 0.003
    assert losses[0] / losses[1] > 1.5 and losses[1] / losses[2] > 1.5


def test_face_on_an_edge_of_the_wall(run):
    """A block that hangs over a step of 90 degrees, its corners in the air: the edge carries it, and it tips."""
    step = path([-1.0, 0.0], [0.0, 0.0], [0.0, -1.0])
    plank = run([body(box_outline((-0.1, 0.0), (0.3, 0.02)), friction=0.5)], step)
    for _ in range(20):
        plank(0.01)
        corners = plank.corners()
        low, high = corners[0], corners[1]  # the lower face
        assert (high[0] - low[0]) * (0.0 - low[1]) - (high[1] - low[1]) * (0.0 - low[0]) < 1e-4 * 0.4
    assert plank.tilt() > 0.3


# ---- bodies on bodies ----


def test_stack_stands(run):
    """Three boxes of 0.2 m and 1, 4 and 2 times the weight stand for 2 s."""
    boxes = [
        body(box_outline((-0.1 + s, 0.1 * i), (0.1 + s, 0.1 * (i + 1))), mass=m, friction=0.4)
        for i, (m, s) in enumerate(((10.0, 0.0), (40.0, 0.02), (20.0, -0.01)))
    ]
    stack = run(boxes, FLOOR)
    start = stack.set.position.numpy().copy()
    stack(2.0)
    np.testing.assert_allclose(stack.set.position.numpy(), start, atol=1e-6)
    # The bottom one carries all: the impulse of a step is its own weight, for contact passes the others' on.
    received = stack.set.received.numpy() / stack.step
    np.testing.assert_allclose(received[1:, 2], G * np.array([10.0, 40.0, 20.0]), rtol=1e-6)
    assert received[0, 2] == pytest.approx(-G * 70.0, rel=1e-6)


def test_two_balls_collide(run):
    """Newton's law of impact along the line of centres, 1 kg on 3 kg, e = 0.7; momentum to rounding."""
    balls = run(
        [
            disc(0.0, 1.0, mass=1.0, restitution=0.7, velocity=(2.0, 0.0, 0.0)),
            disc(0.3, 1.0, mass=3.0, restitution=0.7),
        ],
        gravity=(0.0, 0.0, 0.0),
    )(0.2)
    one, two = balls.velocity(1), balls.velocity(2)
    assert one[0] + 3.0 * two[0] == pytest.approx(2.0, rel=1e-12)
    assert two[0] - one[0] == pytest.approx(0.7 * 2.0, rel=1e-9)
    assert abs(one[2]) + abs(two[2]) < 1e-9


def test_box_against_box_keeps_momentum(run):
    """A spinning box flies into another: linear and angular momentum of both stay, energy does not rise."""
    left = body(box_outline((-0.1, 0.0), (0.1, 0.1)), mass=2.0, friction=0.5, velocity=(1.5, 0, 0), spin=(0, 5.0, 0))
    right = body(box_outline((0.2, 0.03), (0.3, 0.33)), mass=5.0, friction=0.5)
    pair = run([left, right], gravity=(0.0, 0.0, 0.0))
    before, energy = pair.momenta(), pair.set.kinetic_energy().sum()
    pair(0.5)
    assert pair.velocity(2)[0] > 0.05
    np.testing.assert_allclose(pair.momenta(), before, atol=1e-6)
    assert pair.set.kinetic_energy().sum() < energy


def test_overlap_is_put_right_without_a_jump(run):
    """A block that starts 1 mm inside of the floor comes out gently: it is not shot up."""
    block = run([body(box_outline((-0.1, -0.001), (0.1, 0.099)), friction=0.3)], FLOOR)
    top_speed = 0.0
    for _ in range(50):
        block(0.001)
        top_speed = max(top_speed, np.abs(block.velocity()).max())
    assert -5e-6 < block.corners()[:, 1].min() < 1e-6
    assert top_speed < 1e-6
