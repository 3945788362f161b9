"""The four laws of reactive walls against their formulas, even along walls, whole at corners, without a leak."""

from itertools import pairwise

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.walls import BY_LEG, WALL_FORCE, wall_acceleration_kernel
from warpsph.shapes.outline import Bend, Line, Outline
from warpsph.shapes.points import in_plane, in_space
from warpsph.shapes.sheet import Sheet

# Single precision: relative to the largest acceleration of the test.
TOLERANCE = 2e-5
SPACING, RATIO, BETA, SOUND_SPEED = 0.01, 1.5, 3.0, 20.0
H, PITCH = RATIO * SPACING, SPACING / BETA
K = 0.01 * SOUND_SPEED**2
BY_POINT = tuple(name for name in WALL_FORCE if name not in BY_LEG)


@pytest.fixture
def push(make_cloud):
    """A function of law, particles [n, 2], wall outline and velocity that gives accelerations [m/s2], shape [n, 2]."""

    def launch(name, x, outline, u=0.0, approach=0.0, pitch=PITCH, only=slice(None)):
        sheet = Sheet(outline)
        points, normals, _ = sheet.sample(pitch)
        wall = [a[only] for a in (points, np.zeros_like(points), normals, *sheet.ways_along(points))]
        x = np.atleast_2d(x)
        cloud = make_cloud(
            in_space(x),
            u=in_space(np.broadcast_to(u, x.shape)),
            spacing=SPACING,
            ratio=RATIO,
            inverse_spacing=1.0 / SPACING,
            wall_strength=0.01 * (pitch / SPACING if name in BY_POINT else 1.0),
            wall_approach=approach,
        )
        n, k = len(x), len(wall[0])
        inputs = [
            *(cloud.position_volume, cloud.velocity_pressure, cloud.fluids),
            *(cloud.array(a.ravel(), float) for a in wall[:2]),
            *(cloud.array(a, wp.vec3) for a in wall[2:]),
            *(cloud.array(k * np.arange(n + 1), int), cloud.array(np.tile(np.arange(k), n), int)),
        ]
        found, _ = cloud.run(wall_acceleration_kernel(name, "wendland_c2"), inputs, [wp.vec3, float])
        assert not found[:, 1].any()
        return in_plane(found)

    return launch


def path(*corners) -> Outline:
    corners = np.array(corners, float)
    return Outline(tuple(Line(a, b) for a, b in pairwise(corners)), closed=False)


FLAT = path([-0.2, 0.0], [0.2, 0.0])
# Reach off the wall.
REACH = {"radial": 2 * H, "lennard_jones": SPACING, "monaghan_kos": 2 * SPACING, "monaghan_kos_issa": 2 * H}


def off_the_wall(name: str, xi: np.ndarray) -> np.ndarray:
    """Q [m/s2] of the laws by leg, from errata.csv: Vasco (2014) eq 65 and 88 put right."""
    if name == "monaghan_kos":
        q = xi / (2 * SPACING)
        return np.where(q < 1, K / H * (1 - q) / np.sqrt(q), 0.0)
    q = xi / H
    w = np.select([q < 2 / 3, q < 1, q < 2], [2 / 3, 2 * q - 1.5 * q**2, 0.5 * (2 - q) ** 2], 0.0)
    return K / xi * w


def by_point(name: str, r: np.ndarray) -> np.ndarray:
    """f / |x_ik| [1/s2] of the laws of distance alone, Vasco (2014) eq 66 and 64 put right."""
    if name == "radial":
        q = r / H
        return np.where(q < 2, K / BETA / r**2 * 1.77 / 32 * (1 + 2.5 * q + 2 * q**2) * np.maximum(2 - q, 0) ** 5, 0.0)
    s = SPACING / r
    return np.where(s > 1, K / BETA * (s**4 - s**2) / r**2, 0.0)


@pytest.mark.parametrize("name", BY_POINT)
def test_laws_of_distance_are_their_formulas(push, name):
    x = np.random.default_rng(1).uniform([-0.15, 0.003], [0.15, 0.04], (60, 2))
    arms = x[:, None] - FLAT.sample(PITCH)[0]
    expected = np.einsum("ik,ikd->id", by_point(name, np.linalg.norm(arms, axis=2)), arms)
    np.testing.assert_allclose(push(name, x, FLAT), expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


@pytest.mark.parametrize("name", BY_LEG)
def test_one_point_of_a_leg_is_its_formula(push, name):
    """P Q n of each of the two points of a single leg, 1 cm long; their shares add up to 1."""
    leg = path([0.0, 0.0], [0.01, 0.0])
    psi, xi = np.array([0.001, 0.004, 0.007]), np.array([0.004, 0.012, 0.019])
    x = np.stack([psi, xi], axis=1)
    P = 0.5 * (1 + np.cos(np.pi * psi / 0.01)) if name == "monaghan_kos" else 1 - psi / 0.01
    for only, share in ((slice(0, 1), P), (slice(1, 2), 1 - P)):
        found = push(name, x, leg, pitch=0.01, only=only)
        np.testing.assert_allclose(found[:, 1], share * off_the_wall(name, xi), rtol=TOLERANCE)
        assert not found[:, 0].any()


@pytest.mark.parametrize("name", BY_LEG)
def test_a_flat_wall_pushes_with_exactly_its_law(push, name):
    """Whatever the place along the wall: on a point, between two, and for any beta."""
    xi = np.linspace(0.1, 2.9, 30) * SPACING
    for along in (0.0, 0.2 * PITCH, 0.5 * PITCH, PITCH, 0.1234):
        found = push(name, np.stack([np.full_like(xi, along), xi], axis=1), FLAT)
        expected = off_the_wall(name, xi)
        np.testing.assert_allclose(found[:, 1], expected, rtol=1e-4, atol=TOLERANCE * expected.max())
        np.testing.assert_allclose(found[:, 0], 0.0, atol=TOLERANCE * expected.max())
    coarse = push(name, np.stack([np.full_like(xi, 0.0123), xi], axis=1), FLAT, pitch=SPACING)
    np.testing.assert_allclose(coarse[:, 1], expected, rtol=1e-4, atol=TOLERANCE * expected.max())


@pytest.mark.parametrize(("name", "bump"), [("radial", 0.01), *((name, 1e-4) for name in BY_LEG)])
@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_even_along_a_wall(push, name, bump, angle):
    """At half a spacing off a wall, straight or on a slope, far from the origin."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn, origin = np.array([[c, s], [-s, c]]), np.array([3.0, 1.0])
    wall = path(*(np.array([[-0.2, 0.0], [0.2, 0.0]]) @ turn + origin))
    along = np.linspace(-SPACING, SPACING, 41)
    x = np.stack([along, np.full_like(along, 0.5 * SPACING)], axis=1)
    push_off = push(name, x @ turn + origin, wall) @ turn.T
    # Rounding of places 3 m from the origin is 1e-4 of half a spacing.
    assert np.ptp(push_off[:, 1]) < (bump + 2e-4) * push_off[:, 1].mean()
    assert np.abs(push_off[:, 0]).max() < (bump + 2e-4) * push_off[:, 1].mean()


def test_lennard_jones_is_rough_along_a_wall(push):
    """Peak to peak over the mean, half a spacing off: the same sums of eq 64 in double precision."""
    along = np.linspace(0.0, SPACING, 41)
    x = np.stack([along, np.full_like(along, 0.5 * SPACING)], axis=1)
    fine, coarse = (push("lennard_jones", x, FLAT, pitch=pitch)[:, 1] for pitch in (PITCH, SPACING))
    points = np.arange(-20, 21) * SPACING
    for found, pitch, rough in ((fine, PITCH, 0.0188), (coarse, SPACING, 1.54)):
        arms = np.hypot(along[:, None] - points * pitch / SPACING, 0.5 * SPACING)
        expected = (by_point("lennard_jones", arms) * BETA * pitch / SPACING).sum(axis=1) * 0.5 * SPACING
        np.testing.assert_allclose(found, expected, rtol=TOLERANCE * 10)
        assert np.ptp(expected) / expected.mean() == pytest.approx(rough, rel=0.01)


@pytest.mark.parametrize("name", WALL_FORCE)
def test_pushes_away_within_reach_and_not_beyond(push, name):
    xi = np.linspace(0.1, 0.95, 18) * REACH[name]
    found = push(name, np.stack([np.zeros_like(xi), xi], axis=1), FLAT)[:, 1]
    assert np.all(found > 0.0)
    assert np.all(np.diff(found) < 0.0)
    assert not push(name, [[0.0, 1.001 * REACH[name]], [0.05, 3 * REACH[name]]], FLAT).any()


@pytest.mark.parametrize("name", BY_LEG)
def test_who_has_slipped_through_is_pushed_back(push, name):
    behind = push(name, [[0.05, -0.1 * PITCH], [0.05, -0.4 * PITCH], [0.0512, -0.4 * PITCH]], FLAT)
    assert np.all(behind[:, 1] > 0.0)
    assert not push(name, [[0.05, -SPACING]], FLAT).any()


def test_approach_adds_to_monaghan_kos(push):
    """A = (K + beta_v c u_n) / h for who comes closer, and K / h for who leaves or slides."""
    x = [[0.0, 0.5 * SPACING]] * 3
    u = [[0.0, -0.7], [0.0, 0.7], [1.0, 0.0]]
    closer, leaving, sliding = push("monaghan_kos", x, FLAT, u, approach=1.0)[:, 1]
    still = push("monaghan_kos", x[:1], FLAT)[0, 1]
    assert closer / still == pytest.approx((K + SOUND_SPEED * 0.7) / K, rel=TOLERANCE)
    assert leaving == pytest.approx(still, rel=TOLERANCE) and sliding == pytest.approx(still, rel=TOLERANCE)


# ---- corners ----


@pytest.mark.parametrize("name", BY_LEG)
def test_from_a_corner_that_bulges_the_push_is_away_from_it(push, name):
    """The rule of Monaghan, Kos & Issa (2003): between the two normals, Q(r) along x_ik."""
    step = path([-0.2, 0.0], [0.0, 0.0], [0.0, -0.2])  # the upper right edge of a block, fluid on the left of the way
    angle = np.radians(np.linspace(1.0, 89.0, 23))
    away = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for r in (0.4 * SPACING, 1.3 * SPACING):
        found = push(name, r * away, step)
        np.testing.assert_allclose(found, off_the_wall(name, np.array(r)) * away, rtol=0, atol=1e-4 * found.max())


@pytest.mark.parametrize("name", BY_LEG)
@pytest.mark.parametrize("turn", [-90.0, -60.0, -30.0, -1.0, 1.0, 30.0, 60.0, 90.0])
def test_no_jump_on_the_way_around_a_corner(push, name, turn):
    """A particle that follows a wall around a corner, bulging (< 0) or receding, 0.6 spacings off it.

    Monaghan & Kos's law grows more slowly than 1 / xi, so that where the second leg of a receding corner comes within
    its normal there is a step of up to 1 - sqrt(cos(turn)); the law of 2003 has none.
    """
    way = np.radians(turn)
    ahead, left = np.array([np.cos(way), np.sin(way)]), np.array([-np.sin(way), np.cos(way)])
    corner = path([-0.2, 0.0], [0.0, 0.0], 0.2 * ahead)
    xi, s = 0.6 * SPACING, np.linspace(0.0, 0.03, 3001)[:, None]
    if turn < 0:
        fan = np.linspace(0.0, -way, 500)[1:-1]
        around = xi * np.stack([np.sin(fan), np.cos(fan)], axis=1)
        x = np.concatenate([s[::-1] * [-1, 0] + [0, xi], around, s * ahead + xi * left])
    else:
        meet = xi * np.tan(way / 2)
        x = np.concatenate([(s[::-1] + meet) * [-1, 0] + [0, xi], (s + meet) * ahead + xi * left])
    found = push(name, x, corner)
    jumps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    allowed = 0.02 + (1 - np.sqrt(np.cos(way)) if name == "monaghan_kos" and 0 < turn < 90 else 0.0)
    assert jumps.max() < allowed * np.linalg.norm(found, axis=1).max()


@pytest.mark.parametrize("name", BY_LEG)
@pytest.mark.parametrize("interior", [90.0, 120.0, 150.0])
def test_in_a_corner_that_recedes_each_wall_pushes_no_less_than_alone(push, name, interior):
    way = np.radians(180.0 - interior)
    ahead, left = np.array([np.cos(way), np.sin(way)]), np.array([-np.sin(way), np.cos(way)])
    corner = path([-0.2, 0.0], [0.0, 0.0], 0.2 * ahead)
    random = np.random.default_rng(3)
    depth = random.uniform(0.2, 1.4, (400, 2)) * SPACING
    # At given distances off both legs.
    x = depth @ np.linalg.inv(np.array([[0.0, 1.0], left]).T)
    found = push(name, x, corner)
    floor, wall = found[:, 1], found @ left
    least = off_the_wall(name, depth)
    # Over both legs, and as far as a list of neighbours holds the corner.
    reached = (np.linalg.norm(x, axis=1) < 2.0 * H) & (x[:, 0] < 0.0) & (x @ ahead > 0.0)
    assert reached.sum() > 40
    assert np.all((floor >= least[:, 0] * (1 - 1e-3))[reached])
    assert np.all((wall >= least[:, 1] * (1 - 1e-3))[reached])
    if interior == 90.0:
        np.testing.assert_allclose(np.stack([floor, wall], axis=1), least, rtol=1e-3)


@pytest.mark.parametrize("name", BY_LEG)
@pytest.mark.parametrize(("turn", "radius"), [(1.0, 0.3), (1.0, 0.1), (-1.0, 0.1), (-1.0, 0.05)])
def test_an_arc_is_even(push, name, turn, radius):
    """At half a spacing off an arc that recedes (turn 1) or bulges, within 3 % of Q: chords stand inside the arc."""
    arc = Outline((Bend(np.zeros(2), radius, np.radians(180.0 if turn > 0 else 0.0), turn * np.radians(180.0)),), False)
    angle = np.radians(np.linspace(250.0, 290.0, 801))
    x = (radius - turn * 0.5 * SPACING) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inward = -turn * x / np.linalg.norm(x, axis=1)[:, None]
    found = push(name, x, arc)
    off = np.einsum("ij,ij->i", found, inward)
    expected = float(off_the_wall(name, np.array(0.5 * SPACING)))
    assert np.abs(off / expected - 1.0).max() < 0.03
    along = found - off[:, None] * inward
    # Within a chord the push is along its own normal: half of what the wall turns from a point to the next.
    assert np.linalg.norm(along, axis=1).max() < 0.6 * PITCH / radius * expected + 1e-3 * expected


@pytest.mark.parametrize("name", BY_LEG)
@pytest.mark.parametrize("interior", [90.0, 120.0, 150.0])
def test_nothing_leaks_from_a_corner(push, name, interior):
    """A lone particle thrown about in a corner of a closed hexagonal or square box, 4 m/s, one fifth of c: it stays."""
    sides = {90.0: 4, 120.0: 6, 150.0: 12}[interior]
    angle = 2 * np.pi * np.arange(sides) / sides
    corners = 0.06 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    box = Outline(tuple(Line(a, b) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)), closed=True)
    random = np.random.default_rng(4)
    heading = random.uniform(0.0, 2 * np.pi, 40)
    x, u = np.zeros((40, 2)), 2.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    dt, fastest = 0.1 * H / SOUND_SPEED, 0.0
    for _ in range(1500):
        x = x + 0.5 * dt * u
        u = u + dt * push(name, x, box)
        x = x + 0.5 * dt * u
        fastest = max(fastest, np.linalg.norm(u, axis=1).max())
    apothem = 0.06 * np.cos(np.pi / sides)
    middle = angle + np.pi / sides
    assert (x @ np.stack([np.cos(middle), np.sin(middle)])).max() < apothem
    assert fastest < 2.0 * 1.1  # no jet: no particle leaves much faster than it came
