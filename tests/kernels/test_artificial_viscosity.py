"""Artificial viscosity: the formulas of the thesis, on the right pairs, and the shear viscosity they amount to."""

import math

import numpy as np
import pytest

from warpsph.kernels.artificial_viscosity import artificial_share
from warpsph.kernels.smoothing import SMOOTHING

# Single precision, sums of some thirty terms that nearly cancel: relative to the largest acceleration.
TOLERANCE = 1e-5

both = pytest.mark.parametrize("viscosity", ["signal", "monaghan"])


def mean(values: np.ndarray) -> np.ndarray:
    """(a_i + a_j) / 2 of each pair, shape [n, n]."""
    return 0.5 * (values[:, None] + values)


def viscous_acceleration(cloud, viscosity: str, beta: float) -> np.ndarray:
    """- sum_j m_j Pi_ij grad_i W_ij with Pi of Vasco (2014) eq 58 or 61 [m/s2], shape [n, 3]."""
    u_dot_x = np.einsum("ijk,ijk->ij", cloud.u_ij, cloud.x_ij)
    alpha, c, rho, h = mean(cloud.alpha), mean(cloud.c), mean(cloud.rho), cloud.h
    if viscosity == "signal":
        Pi = -alpha * c * u_dot_x / (rho * cloud.r)
    else:
        mu = h * u_dot_x / (cloud.r**2 + 0.01 * h**2)  # eq 59
        Pi = np.where(u_dot_x < 0, (-alpha * c * mu + beta * mu**2) / rho, 0.0)
    return -np.einsum("ij,ijk->ik", cloud.m * Pi, cloud.grad_W)


@both
def test_formula_of_the_thesis(mixture, viscosity):
    cloud = mixture(artificial_viscosity_beta=1.5)
    _, found = cloud.acceleration(viscosity)
    expected = viscous_acceleration(cloud, viscosity, beta=1.5)
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


@pytest.mark.parametrize(("speed", "acts"), [(-1.0, {"signal", "monaghan"}), (1.0, {"signal"})])
@both
def test_which_pairs_it_acts_on(make_cloud, viscosity, speed, acts):
    """Eq 58 on approaching pairs only, eq 61 on all; where it acts, it works against the motion."""
    cloud = make_cloud([[0, 0, 0], [0.1, 0, 0]], u=[[0, 0, 0], [speed, 0, 0]])
    _, (first, second) = cloud.acceleration(viscosity)
    if viscosity in acts:
        assert second[0] * speed < 0.0 < first[0] * speed
    else:
        assert not first.any() and not second.any()


@both
def test_takes_kinetic_energy(mixture, viscosity):
    cloud = mixture()
    _, viscous = cloud.acceleration(viscosity)
    power = cloud.m * np.einsum("ik,ik->i", viscous, cloud.u)
    assert power.sum() < -0.1 * np.abs(power).sum()


@both
def test_leaves_rigid_motion_alone(make_cloud, lattice, viscosity):
    """Rounding of u_ij . x_ij is left; next to the viscosity of a shear as fast as the spin it is nothing."""
    x = lattice(9, 9)
    still = np.zeros(len(x))
    spin = 3.0 * np.stack([-x[:, 2], still, x[:, 0]], axis=1) + [1.0, 0.0, 2.0]
    shear = 3.0 * np.stack([x[:, 2], still, x[:, 0]], axis=1)
    (_, by_spin), (_, by_shear) = (make_cloud(x, u=u).acceleration(viscosity) for u in (spin, shear))
    assert np.abs(by_spin).max() < TOLERANCE * np.abs(by_shear).max()


@pytest.mark.parametrize(
    ("viscosity", "share", "tolerance"),
    # The lattice's error at h = 3 dx and the finite wavelength; in eq 59 also the 0.01 h^2 beside r^2.
    [("signal", 1 / 8, 0.01), ("monaghan", 1 / 16, 0.04)],
)
def test_shear_viscosity(make_cloud, lattice, viscosity, share, tolerance):
    """nu = alpha c h / 8 of eq 61 with the Wendland kernel in the plane; the switch of eq 58 leaves half of it.

    From the decay of u = sin(k z) in the middle of a strip: du/dt = -nu k^2 u.
    """
    ratio, spacing = 3.0, 0.1
    h = ratio * spacing
    wavelength = 24 * h
    x, k = lattice(13, 49, spacing), 2 * math.pi / wavelength
    u = np.sin(k * x[:, 2:]) * [1.0, 0.0, 0.0]
    cloud = make_cloud(x, u=u, spacing=spacing, ratio=ratio)
    _, viscous = cloud.acceleration(viscosity)
    inside = (np.abs(cloud.x[:, 0]) < 1e-6) & (np.abs(cloud.x[:, 2]) < wavelength / 4)
    nu = -(viscous[inside, 0] @ u[inside, 0]) / (k**2 * u[inside, 0] @ u[inside, 0])
    assert nu == pytest.approx(share * cloud.alpha[0] * cloud.c[0] * h, rel=tolerance)


@pytest.mark.parametrize("smoothing", SMOOTHING)
@pytest.mark.parametrize(("viscosity", "error"), [("signal", 0.005), ("monaghan", 0.03)])
def test_artificial_viscosity_as_a_real_one(make_cloud, lattice, viscosity, error, smoothing):
    """nu = share alpha c h, measured as any other; the lattice's own error is larger where g is steeper."""
    x = lattice(25, 25)
    cloud = make_cloud(x, u=x[:, 2:] ** 2 * [1.0, 0.0, 0.0], ratio=3.0, smoothing=smoothing)
    _, found = cloud.acceleration(viscosity)
    share = found[len(x) // 2, 0] / 2.0 / (cloud.alpha[0] * cloud.c[0] * cloud.h)
    assert share == pytest.approx(artificial_share(viscosity, smoothing, 2), rel=error)


@pytest.mark.parametrize(
    ("viscosity", "smoothing", "share"),
    [("signal", "wendland_c2", 1 / 8), ("signal", "cubic_spline", 15 / 112)],
)
def test_artificial_share_in_closed_form(viscosity, smoothing, share):
    assert artificial_share(viscosity, smoothing, 2) == pytest.approx(share, rel=1e-6)
