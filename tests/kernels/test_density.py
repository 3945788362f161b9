"""Continuity, its diffusion and XSPH: against NumPy's sum over all pairs, and by what they must leave alone."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.density import DENSITY_DIFFUSION, rest_density
from warpsph.kernels.smoothing import SMOOTHING

# Single precision, sums of some thirty terms that nearly cancel: relative to the largest of what is compared.
TOLERANCE = 1e-5
GRAVITY = 9.81


def assert_same(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


def shake(x: np.ndarray) -> np.ndarray:
    """`x` with every point moved at random by up to a fifth of the lattice's 0.1 m."""
    return x + 0.02 * np.random.default_rng(3).uniform(-1, 1, x.shape) * [1, 0, 1]


# ------------------------------------------------------------------------------------------------------- continuity


@pytest.mark.parametrize("smoothing", SMOOTHING)
def test_continuity_is_eq_43(mixture, smoothing):
    """d rho_i/dt = rho_i sum_j m_j / rho_j u_ij . grad_i W_ij."""
    cloud = mixture(smoothing=smoothing)
    rate, diffusion, _ = cloud.density_rate()
    expected = cloud.rho * np.einsum("j,ijk,ijk->i", cloud.m / cloud.rho, cloud.u_ij, cloud.grad_W)
    assert_same(rate, expected)
    assert not diffusion.any()


def test_linear_velocity_dilutes(make_cloud, lattice):
    """u = (k x, 0, 0): d rho/dt = -k rho inside a lattice, whose own error at h = 1.5 dx is 0.3 %."""
    x, k = lattice(9, 9), 2.0
    rate, _, _ = make_cloud(x, u=k * x * [1, 0, 0]).density_rate()
    assert rate[len(x) // 2] == pytest.approx(-k * 1000.0, rel=0.004)


def test_rigid_motion_changes_no_density(make_cloud, lattice):
    x = shake(lattice(9, 9))
    still = np.zeros(len(x))
    spin = 3.0 * np.stack([-x[:, 2], still, x[:, 0]], axis=1)
    dilution, _, _ = make_cloud(x, u=3.0 * x).density_rate()
    for u in (np.full((len(x), 3), [5.0, 0.0, -2.0]), spin):
        rate, _, _ = make_cloud(x, u=u).density_rate()
        assert np.abs(rate).max() < TOLERANCE * np.abs(dilution).max()


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("smoothing", SMOOTHING)
def test_renormalised_continuity_is_its_formula(mixture, smoothing, dimensions):
    """-rho_i tr(L_i B_i), B_i the inverse of sum V_j (x_j - x_i) (x) grad W."""
    cloud = mixture(smoothing=smoothing)
    rate = cloud.rates(momentum=False, renormalised=True, dimensions=dimensions)[2]
    M, L = (-np.einsum("j,ijk,ijl->ikl", cloud.V, pair, cloud.grad_W) for pair in (cloud.x_ij, cloud.u_ij))
    B = np.linalg.inv(M[:, ::2, ::2])
    assert_same(rate, -cloud.rho * np.einsum("ikl,ilk->i", L[:, ::2, ::2], B))


def test_renormalised_continuity_is_exact_for_linear_velocities(make_cloud, lattice):
    """At the surface and in disorder, where the plain sum has lost half of it."""
    x = shake(lattice(9, 9))
    cloud = make_cloud(x, u=x @ np.array([[1.0, 0.0, -2.0], [0.0, 0.0, 0.0], [3.0, 0.0, 0.5]]).T)
    rate = cloud.rates(momentum=False, renormalised=True)[2]
    np.testing.assert_allclose(rate, -1.5 * cloud.rho, rtol=TOLERANCE)
    plain = cloud.rates(momentum=False)[2]
    assert np.abs(plain / cloud.rho + 1.5).max() > 0.5


def test_renormalised_continuity_in_space(make_cloud):
    """All three rows count: on a cube of which the corners have an eighth of a neighbourhood."""
    random = np.random.default_rng(5)
    cube = np.stack(np.meshgrid(*[np.arange(6)] * 3), axis=-1).reshape(-1, 3)
    x = 0.1 * (cube + random.uniform(-0.2, 0.2, cube.shape))
    G = random.normal(size=(3, 3))
    cloud = make_cloud(x, u=x @ G.T)
    cloud.parameters.gradient_norm = SMOOTHING["wendland_c2"].normalisation[3] / cloud.h**5
    cloud.parameters.mass = cloud.array([1.0, 1.0], float)
    cloud.position_volume = cloud.array(np.column_stack([cloud.x, np.full(216, 1e-3)]), wp.vec4)
    rate = cloud.rates(momentum=False, renormalised=True)[2]
    inside = (np.abs(cube - 2.5) < 2.0).all(axis=1)
    scale = 1000.0 * np.abs(G).sum()
    np.testing.assert_allclose(rate[inside], -1000.0 * np.trace(G), rtol=0, atol=TOLERANCE * scale)


def test_spray_keeps_the_plain_rate(make_cloud):
    x = np.array([[0, 0, 0], [0.12, 0, 0], [0, 0, 0.15], [0.14, 0, 0.13]])
    cloud = make_cloud(x, u=5.0 * x[:, ::-1] + x)
    plain, renormalised = (cloud.rates(momentum=False, renormalised=choice)[2] for choice in (False, True))
    assert_same(renormalised, plain)
    assert plain.all()


def test_kinetic_and_internal_energy_are_exchanged_without_loss(mixture):
    """sum m u . a by pressure + sum m p / rho^2 d rho/dt = 0: eq 43 is the partner of eq 38."""
    cloud = mixture()
    by_pressure, _ = cloud.acceleration()
    rate, _, _ = cloud.density_rate()
    kinetic = cloud.m * np.einsum("ik,ik->i", cloud.u, by_pressure)
    internal = cloud.m * cloud.p / cloud.rho**2 * rate
    assert abs(kinetic.sum() + internal.sum()) < TOLERANCE * np.abs(internal).sum()


# -------------------------------------------------------------------------------------------------------- diffusion


@pytest.mark.parametrize("model", ["molteni_colagrossi", "fourtakas", "antuono"])
def test_diffusion_is_its_formula(mixture, model):
    """2 delta h / c sum_j V_j psi_ij (x_ji . grad_i W_ij) / r_ij^2 within a fluid, beside continuity."""
    cloud = mixture(diffusion=0.1)
    rate, diffusion, _ = cloud.density_rate(model)
    psi = cloud.p - cloud.p[:, None]
    if model == "fourtakas":
        psi -= 1000.0 * np.array([1.0, 2.53])[cloud.fluid] * GRAVITY * cloud.x_ij[:, :, 2]
    if model == "antuono":
        G = cloud.pressure_gradient()
        psi += 0.5 * np.einsum("ijk,ijk->ij", G[:, None] + G, cloud.x_ij)
    psi *= cloud.fluid == cloud.fluid[:, None]
    slope = -np.einsum("ijk,ijk->ij", cloud.x_ij, cloud.grad_W) / cloud.r**2
    expected = 2 * 0.1 * cloud.h / cloud.c * ((cloud.V * psi * slope).sum(axis=1))
    assert_same(diffusion, expected)
    continuity, _, _ = cloud.density_rate()
    assert_same(rate, continuity)


@pytest.mark.parametrize("model", DENSITY_DIFFUSION)
def test_diffusion_conserves(mixture, model):
    """The sum of V_i d rho_i/dt over each fluid is zero."""
    cloud = mixture(diffusion=0.1)
    _, diffusion, _ = cloud.density_rate(model)
    for fluid in (0, 1):
        gained = (cloud.V * diffusion)[cloud.fluid == fluid]
        assert abs(gained.sum()) <= TOLERANCE * np.abs(gained).sum()


@pytest.mark.parametrize("model", ["molteni_colagrossi", "fourtakas", "antuono"])
def test_diffusion_smooths_a_checkerboard(make_cloud, lattice, model):
    """Where every other particle is pressed and the rest are in tension, each moves towards its neighbours."""
    x = lattice(9, 9)
    sign = 1.0 - 2.0 * (np.arange(len(x)) % 2)
    # The square lattice is a bipartite board: an odd number of columns makes the index alternate along both axes.
    _, diffusion, _ = make_cloud(x, p=1000.0 * sign, diffusion=0.1, gravity=wp.vec3()).density_rate(model)
    assert np.all(diffusion * sign < 0.0)


def test_diffusion_of_fourtakas_leaves_rest_alone(make_cloud, lattice):
    """Hydrostatic pressure, at the free surface and at any disorder; the older form does not."""
    x = shake(lattice(9, 9))
    cloud = make_cloud(x, p=1000.0 * GRAVITY * (1.0 - x[:, 2]), diffusion=0.1)
    _, older, _ = cloud.density_rate("molteni_colagrossi")
    _, diffusion, _ = cloud.density_rate("fourtakas")
    assert np.abs(diffusion).max() < TOLERANCE * np.abs(older).max()


def test_diffusion_of_antuono_leaves_any_linear_pressure_alone(make_cloud, lattice):
    """In any direction, at the free surface and at any disorder."""
    x = shake(lattice(9, 9))
    cloud = make_cloud(x, p=300.0 + x @ [4000.0, 0.0, -7000.0], diffusion=0.1)
    np.testing.assert_allclose(cloud.pressure_gradient(), np.tile([4000.0, 0.0, -7000.0], (len(x), 1)), atol=0.2)
    _, older, _ = cloud.density_rate("molteni_colagrossi")
    _, diffusion, _ = cloud.density_rate("antuono")
    assert np.abs(diffusion).max() < 2 * TOLERANCE * np.abs(older).max()


def test_gradient_looks_at_its_own_fluid(make_cloud, lattice):
    """A jump of pressure where two fluids meet is no gradient."""
    x = lattice(9, 9)
    fluid = (x[:, 0] > 0.0).astype(np.int32)
    cloud = make_cloud(x, p=500.0 + 8000.0 * fluid, fluid=fluid)
    assert not cloud.pressure_gradient().any()


# ------------------------------------------------------------------------------------------------------------- XSPH


@pytest.mark.parametrize("smoothing", SMOOTHING)
def test_xsph_is_eq_40_with_its_sign_put_right(mixture, smoothing):
    """du_i = epsilon sum_j m_j / rhobar_ij (u_j - u_i) W_ij."""
    cloud = mixture(smoothing=smoothing, xsph=0.5)
    _, _, correction = cloud.density_rate()
    mean_density = 0.5 * (cloud.rho[:, None] + cloud.rho)
    expected = -0.5 * np.einsum("ij,ijk->ik", cloud.m / mean_density * cloud.W, cloud.u_ij)
    assert_same(correction, expected)


def test_xsph_draws_towards_the_neighbours(make_cloud, lattice):
    """One fast particle among resting ones is slowed and the others are drawn along, at no change of momentum."""
    x = lattice(5, 5)
    middle = len(x) // 2
    u = np.zeros_like(x)
    u[middle, 0] = 1.0
    cloud = make_cloud(x, u=u, xsph=0.5)
    _, _, correction = cloud.density_rate()
    assert -1.0 < correction[middle, 0] < 0.0
    assert np.all(np.delete(correction[:, 0], middle)[np.delete(cloud.r[middle], middle) < 1.9 * cloud.h] > 0.0)


def test_xsph_conserves_momentum(mixture):
    cloud = mixture(xsph=0.5)
    _, _, correction = cloud.density_rate()
    momentum = cloud.m[:, None] * correction
    assert np.all(np.abs(momentum.sum(axis=0)) < TOLERANCE * np.abs(momentum).sum(axis=0).max())


def test_xsph_does_not_move_a_held_fluid(mixture):
    cloud = mixture(xsph=0.5, mobility=[1.0, 0.0])
    _, _, correction = cloud.density_rate()
    assert not correction[cloud.fluid == 1].any()
    assert correction[cloud.fluid == 0].any()


# ------------------------------------------------------------------------------------------------- density of rest


def test_density_of_rest_carries_the_weight(make_cloud, lattice):
    """p = rho0 g depth by each fluid's state equation; nothing above the level, nothing for what has no level."""
    x = lattice(3, 9)
    fluid = (np.arange(len(x)) % 2).astype(np.int32)
    cloud = make_cloud(x, fluid=fluid, still_level=[0.25, -np.inf])
    position = cloud.array(cloud.x, wp.vec3d)
    density = cloud.array(np.full(len(x), 1.0), wp.float64)
    rate, diffusion = (cloud.array(np.full(len(x), 1.0), float) for _ in range(2))
    cloud.launcher.record_in_order(
        rest_density, len(x), [cloud.parameters, position, cloud.fluids, density, rate, diffusion]
    )()
    rests = fluid == 0
    compression = density.numpy()[rests] / 1000.0 - 1.0
    pressure = 1000.0 * 20.0**2 / 7.0 * ((1.0 + compression) ** 7 - 1.0)  # Vasco (2014) eq 56
    expected = 1000.0 * GRAVITY * np.maximum(0.25 - cloud.x[rests, 2], 0.0)
    assert_same(pressure, expected)
    assert not rate.numpy()[rests].any() and not diffusion.numpy()[rests].any()
    for untouched in (density, rate, diffusion):
        assert np.all(untouched.numpy()[~rests] == 1.0)
