"""The pair loop of momentum: each term against NumPy's sum over all pairs, what it conserves, which way it pushes."""

import numpy as np
import pytest

from warpsph.kernels.smoothing import SMOOTHING

# Single precision, sums of some thirty terms that nearly cancel: relative to the largest acceleration.
TOLERANCE = 1e-5


def assert_same(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


def tensile_acceleration(cloud, most: float = np.inf, in_compression: float = 0.01) -> np.ndarray:
    """Vasco (2014) eq 67 at a spacing of 0.1 m [m/s2], shape [n, 3].

    e = 0.01, or `in_compression`, where p > 0, and 0.2 where p < 0; (W_ij / W(dx))^4 is at most `most`.
    """
    R = np.where(cloud.p > 0, in_compression, 0.2) * np.abs(cloud.p)
    f = cloud.W / cloud.W_at(0.1)
    factor = cloud.m * (R[:, None] + R) / (cloud.rho[:, None] * cloud.rho) * np.minimum(f**4, most)
    return -np.einsum("ij,ijk->ik", factor, cloud.grad_W)


@pytest.mark.parametrize("smoothing", SMOOTHING)
def test_pressure_term_is_eq_38(mixture, smoothing):
    """du_i/dt = - sum_j m_j (p_i + p_j) / (rho_i rho_j) grad_i W_ij."""
    cloud = mixture(smoothing=smoothing)
    by_pressure, _ = cloud.acceleration()
    factor = cloud.m * (cloud.p[:, None] + cloud.p) / (cloud.rho[:, None] * cloud.rho)
    assert_same(by_pressure, -np.einsum("ij,ijk->ik", factor, cloud.grad_W))


@pytest.mark.parametrize("smoothing", SMOOTHING)
def test_tensile_correction_is_eq_67(mixture, smoothing):
    cloud = mixture(smoothing=smoothing, alpha=[0.0, 0.0])
    _, by_dissipation = cloud.acceleration(tensile_correction=True)
    assert_same(by_dissipation, tensile_acceleration(cloud))


def test_bounded_tensile_correction_is_eq_67_in_tension_up_to_a_factor_of_5(make_cloud, lattice):
    """In tension here and in compression there, every particle nearer than half the spacing of 0.1 m to another."""
    random = np.random.default_rng(1)
    x = lattice(9, 9, 0.04) + 0.01 * random.uniform(-1, 1, (81, 3)) * [1, 0, 1]
    cloud = make_cloud(x, p=random.uniform(-4000.0, 4000.0, 81), alpha=[0.0, 0.0])
    _, by_dissipation = cloud.acceleration(tensile_correction="bounded")
    assert_same(by_dissipation, tensile_acceleration(cloud, most=5.0, in_compression=0.0))
    assert np.abs(by_dissipation - tensile_acceleration(cloud)).max() > 0.5 * np.abs(by_dissipation).max()


@pytest.mark.parametrize("correction", [True, "bounded"])
@pytest.mark.parametrize("distance", [0.03, 0.06, 0.08])
def test_bounded_tensile_correction_leaves_tension_no_repulsion(make_cloud, correction, distance):
    """Pressure and correction together, of a pair in tension nearer than the spacing of 0.1 m."""
    by_pressure, correcting = make_cloud([[0, 0, 0], [distance, 0, 0]], p=-3000.0, alpha=[0.0, 0.0]).acceleration(
        tensile_correction=correction
    )
    together = (by_pressure + correcting)[0, 0] / by_pressure[0, 0]
    is_pushed_apart = together < -TOLERANCE
    assert is_pushed_apart == (correction != "bounded" and distance < 0.067)


def test_tensile_correction_comes_on_top_of_viscosity(mixture):
    cloud = mixture()
    (_, together), (_, viscous) = cloud.acceleration(tensile_correction=True), cloud.acceleration()
    np.testing.assert_allclose(together, viscous + tensile_acceleration(cloud), atol=TOLERANCE * np.abs(together).max())


@pytest.mark.parametrize("pressure", [3000.0, -3000.0])
def test_tensile_correction_pushes_apart(make_cloud, pressure):
    cloud = make_cloud([[0, 0, 0], [0.1, 0, 0]], p=pressure, alpha=[0.0, 0.0])
    (_, (first, second)) = cloud.acceleration(tensile_correction=True)
    assert first[0] < 0.0 < second[0]


@pytest.mark.parametrize("pressure", [3000.0, -3000.0])
def test_pressure_pushes_apart_and_tension_pulls_together(make_cloud, pressure):
    (first, second), _ = make_cloud([[0, 0, 0], [0.1, 0, 0]], p=pressure).acceleration()
    assert np.sign(second[0]) == np.sign(pressure) == -np.sign(first[0])


@pytest.mark.parametrize("viscosity", ["signal", "monaghan"])
def test_pairs_are_antisymmetric(mixture, viscosity):
    """The two forces of a pair are opposite, along the line between: momentum and angular momentum are conserved."""
    cloud = mixture()
    for acceleration in cloud.acceleration(viscosity, tensile_correction=True):
        force = cloud.m[:, None] * acceleration
        torque = np.cross(cloud.x, force)
        assert np.all(np.abs(force.sum(axis=0)) < TOLERANCE * np.abs(force).sum())
        assert np.all(np.abs(torque.sum(axis=0)) < TOLERANCE * np.abs(torque).sum())


def test_linear_pressure_carries_the_weight(make_cloud, lattice):
    """p = rho g depth pushes up with g inside a lattice, whose own error at h = 1.5 dx, in sum V x grad W, is 0.3 %."""
    x = lattice(9, 9)
    by_pressure, _ = make_cloud(x, p=1000.0 * 9.81 * (1.0 - x[:, 2])).acceleration()
    np.testing.assert_allclose(by_pressure[len(x) // 2], [0.0, 0.0, 9.81], rtol=0, atol=0.004 * 9.81)


def test_neighbour_list_by_columns(mixture):
    """As it lies on a GPU: the same terms, which a CPU adds up in another order."""
    for found, expected in zip(mixture(by_column=True).acceleration(), mixture().acceleration(), strict=True):
        assert_same(found, expected)
