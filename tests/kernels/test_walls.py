"""Reactive walls: the loop over their points, friction, and what a force must and cannot do. The laws themselves are in
test_wall_laws.py."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.walls import WALL_FORCE, wall_acceleration_kernel

# Single precision, sums of some twenty terms: relative to the largest acceleration.
TOLERANCE = 1e-5
SPACING, RATIO, REFINEMENT = 0.1, 1.5, 3.0
H = RATIO * SPACING
STRENGTH = 0.01 / REFINEMENT  # K / (beta c^2)
SOUND_SPEED = 20.0

# A long straight wall along x, as fine as the scene's default.
WALL = np.arange(-30, 31)[:, None] * [SPACING / REFINEMENT, 0.0, 0.0]


@pytest.fixture
def push(make_cloud):
    """A function that gives the acceleration [m/s2] and the distance to the nearest wall point [m], and the cloud."""

    def launch(x, wall=WALL, force="radial", wall_strength=STRENGTH, wall_u=0.0, repeats=None, **fields):
        """A wall as seen from both of its sides. With `repeats` it moves at `wall_u` and is added so many times."""
        cloud = make_cloud(
            x, spacing=SPACING, ratio=RATIO, wall_strength=wall_strength, inverse_spacing=1.0 / SPACING, **fields
        )
        n, k = len(cloud.x), len(wall)
        before, after = np.roll(wall, 1, axis=0) - wall, np.roll(wall, -1, axis=0) - wall
        before[0] = after[-1] = 0.0
        vectors = [np.broadcast_to(values, (k, 3)) for values in (wall, wall_u, 0.0, before, after)]
        arrays = [cloud.array(values.ravel(), float) for values in vectors[:2]]
        arrays += [cloud.array(values, wp.vec3) for values in vectors[2:]]
        arrays += [cloud.array(k * np.arange(n + 1), int), cloud.array(np.tile(np.arange(k), n), int)]
        found = [cloud.array(np.zeros((n, 3)), wp.vec3), cloud.array(np.full(n, 1e9), float)]
        kernel = wall_acceleration_kernel(force, "wendland_c2", moving=repeats is not None)
        for _ in range(1 if repeats is None else repeats):
            inputs = [cloud.position_volume, cloud.velocity_pressure, cloud.fluids, *arrays, *found]
            cloud.launcher.record_in_order(kernel, n, [cloud.parameters, *inputs])()
        acceleration, distance = (values.numpy().astype(float) for values in found)
        return acceleration, distance, cloud

    return launch


def above(*heights: float, along: float = 0.0) -> np.ndarray:
    return np.array([[along, 0.0, z] for z in heights])


def radial_force(r: np.ndarray) -> np.ndarray:
    """f / |x_ik| of Vasco (2014) eq 66 with the 1 / r^2 that it lost [1/s2]: K / beta W / r^2, mass factor 1."""
    q = r / H
    W = 1.77 / 32 * (1 + 5 / 2 * q + 2 * q**2) * (2 - q) ** 5
    return np.where(q < 2, STRENGTH * SOUND_SPEED**2 * W / r**2, 0.0)


def test_force_is_eq_66(push):
    x = np.random.default_rng(2).uniform(-0.4, 0.4, (50, 3)) * [1, 0, 1]
    acceleration, distance, cloud = push(x)
    x_ik = cloud.x[:, None] - WALL
    r = np.linalg.norm(x_ik, axis=2)
    expected = np.einsum("ik,ikd->id", radial_force(r), x_ik)
    np.testing.assert_allclose(acceleration, expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())
    np.testing.assert_allclose(distance, np.minimum(r.min(axis=1), 2.3 * H), rtol=TOLERANCE)


@pytest.mark.parametrize("force", WALL_FORCE)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_pushes_off_the_wall_ever_harder(push, force, side):
    """On either side of a wall with fluid on both."""
    acceleration, _, _ = push(above(*side * np.linspace(0.05, 0.9, 12) * SPACING), force=force)
    off = side * acceleration[:, 2]
    assert np.all(off > 0.0) and np.all(np.diff(off) < 0.0)


@pytest.mark.parametrize("force", WALL_FORCE)
def test_is_even_along_the_wall(push, force):
    """From a height of half a spacing up, on a wall point or between two, to 1 %; lennard_jones to 2 %."""
    along = np.linspace(0.0, SPACING / REFINEMENT, 9)
    acceleration, _, _ = push(np.concatenate([above(0.5 * SPACING, along=x) for x in along]), force=force)
    off = acceleration[:, 2]
    bump = 0.02 if force == "lennard_jones" else 0.01
    assert np.ptp(off) < bump * off.mean()
    assert np.abs(acceleration[:, 0]).max() < bump * off.mean()


@pytest.mark.parametrize("force", WALL_FORCE)
def test_does_not_reach_beyond_the_support(push, force):
    acceleration, distance, cloud = push(above(2.0001 * H, 5.0 * H), force=force)
    assert not acceleration.any()
    np.testing.assert_allclose(distance, [2.0001 * H, cloud.parameters.list_radius], rtol=TOLERANCE)


@pytest.mark.parametrize("force", WALL_FORCE)
def test_is_conservative(push, force):
    """No work is done around a closed loop, near the end of the wall where the force is as crooked as it gets."""
    near, steps = (0.3, 200) if force == "lennard_jones" else (1.0, 200 if force == "radial" else 4000)  # kinks
    angle = 2 * np.pi * np.arange(steps) / steps
    loop = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    tangent = np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    acceleration, _, _ = push(WALL[-1] + near * ([0.05, 0.0, 0.2] + 0.1 * loop), force=force)
    work = np.einsum("id,id->i", acceleration, tangent)
    assert np.abs(work).max() > 1.0  # [m/s2]
    assert abs(work.sum()) < TOLERANCE * np.abs(work).sum()


@pytest.mark.parametrize("force", WALL_FORCE)
def test_is_the_gradient_of_a_potential(push, force):
    """curl a = 0 by central differences of 1 mm, to their own error and rounding."""
    x, step = np.array([0.9, 0.0, 0.13]), 1e-3
    dx, dz = np.array([step, 0, 0]), np.array([0, 0, step])
    (left, right, below, over), _, _ = push(np.array([x - dx, x + dx, x - dz, x + dz]), force=force)
    across, along = (right[2] - left[2]) / (2 * step), (over[0] - below[0]) / (2 * step)
    steepest = (below[2] - over[2]) / (2 * step)
    assert across == pytest.approx(along, abs=1e-3 * steepest)


@pytest.mark.parametrize("force", WALL_FORCE)
def test_a_moving_wall_adds_to_what_is_there(push, force):
    """Twice the push, the least distance, and with friction and approach only the speed of one against the other."""
    random = np.random.default_rng(5)
    x, u = random.uniform(0.03, 0.4, (40, 3)) * [1, 0, 1], np.array([0.3, 0.0, -0.8])
    numbers = {"force": force, "wall_alpha": [0.1, 0.1], "wall_approach": 1.0}
    once, distance, cloud = push(x, u=u, **numbers)
    twice, least, _ = push(x, u=u, repeats=2, **numbers)
    np.testing.assert_allclose(twice, 2 * once, rtol=0, atol=TOLERANCE * np.abs(twice).max())
    np.testing.assert_allclose(np.minimum(least, cloud.parameters.list_radius), distance, rtol=TOLERANCE)
    other = np.array([0.5, 0.0, 0.25])
    seen, _, _ = push(x, u=u + other, wall_u=other, repeats=1, **numbers)
    np.testing.assert_allclose(seen, once, rtol=0, atol=TOLERANCE * np.abs(once).max())


def test_friction_is_eq_63(push):
    """- m_i Pi_ik grad_i W_ik with Pi = -alpha c u . x_ik / (rho r): against the motion, and without motion nothing."""
    random = np.random.default_rng(4)
    x, u = random.uniform(0.03, 0.4, (40, 3)) * [1, 0, 1], random.normal(size=(40, 3)) * [1, 0, 1]
    frictionless, _, _ = push(x, u=u)
    at_rest, _, _ = push(x, wall_alpha=[0.1, 0.1])
    np.testing.assert_array_equal(at_rest, frictionless)

    rubbed, _, cloud = push(x, u=u, wall_alpha=[0.1, 0.1])
    x_ik = cloud.x[:, None] - WALL
    r = np.linalg.norm(x_ik, axis=2)
    q = r / H
    Pi = -0.1 * SOUND_SPEED * np.einsum("id,ikd->ik", cloud.u, x_ik) / (cloud.rho[:, None] * r)
    slope = np.where(q < 2, 7 / (4 * np.pi * H**4) * -5 * (1 - q / 2) ** 3, 0.0)  # W' / r
    expected = -np.einsum("ik,ikd->id", cloud.m[:, None] * Pi * slope, x_ik)
    np.testing.assert_allclose(rubbed - frictionless, expected, rtol=0, atol=TOLERANCE * np.abs(rubbed).max())
    power = np.einsum("id,id->i", expected, cloud.u)
    assert np.all(power <= 0.0) and power.min() < 0.0


def test_sliding_is_slowed_along_the_wall(push):
    """Friction on a particle that slides over a wall points backwards, not off the wall."""
    (rubbed,), _, _ = push(above(0.05), u=[2.0, 0.0, 0.0], wall_alpha=[0.1, 0.1])
    (free,), _, _ = push(above(0.05), u=[2.0, 0.0, 0.0])
    drag = rubbed - free
    assert drag[0] < 0.0
    assert abs(drag[2]) < 1e-3 * abs(drag[0])


def test_holds_light_and_heavy_fluids_alike(push):
    """A wall point counts as heavy as the particle that it pushes: acceleration by c^2 alone, whatever the density."""
    acceleration, _, cloud = push(above(0.05, 0.05), fluid=[0, 1])
    light, heavy = acceleration[:, 2] / cloud.c**2
    assert light == pytest.approx(heavy, rel=TOLERANCE)
