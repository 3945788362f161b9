"""Balance: its sweep against NumPy, that sweeps converge, and that a lattice needs none."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.balance import INNER_MOMENT, SURFACE_MOMENT, balance_kernel
from warpsph.kernels.images import Images
from warpsph.kernels.smoothing import SMOOTHING

# Single precision, sums of some thirty terms that nearly cancel: relative to the largest of what is compared.
TOLERANCE = 1e-4


def sweep(cloud, balance: np.ndarray, dimensions: int = 2) -> np.ndarray:
    """lambda [1/m] from that of the sweep before, shape [n, 3]."""
    quadruples = np.column_stack([cloud.u, cloud.p])
    if dimensions == 2:
        quadruples[:, 1] = cloud.x[:, 0]
    packed = [cloud.launcher.packed(array) for array in (cloud.position_volume, cloud.array(quadruples, wp.vec4))]
    cloud.parameters.dimensions, nobody = dimensions, cloud.array([0], int)
    lists = [cloud.neighbour_count, cloud.neighbour_count, cloud.neighbour_list, nobody, nobody]
    inputs = [Images(), len(cloud.x), *packed, cloud.position_volume, *lists, cloud.array(balance.ravel(), float)]
    return cloud.run(balance_kernel(cloud.smoothing, dimensions, cloud.layout), inputs, [wp.vec3])[0]


def sweeps(cloud, count: int) -> np.ndarray:
    """lambda [1/m] after so many sweeps from 0, shape [n, 3]."""
    found = np.zeros((len(cloud.x), 3))
    for _ in range(count):
        found = sweep(cloud, found)
    return found


def imbalance(cloud, balance: np.ndarray) -> np.ndarray:
    """sum_j V_j f_ij grad_i W_ij by NumPy [1/m], shape [n, 3]."""
    f = 1.0 + np.einsum("ijk,ijk->ij", balance[:, None] - balance, cloud.x_ij)
    return np.einsum("j,ij,ijk->ik", cloud.V, f, cloud.grad_W)


def expected_sweep(cloud, before: np.ndarray, dimensions: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """A sweep by NumPy, and by how much it fades, shape [n, 3] and [n]."""
    M = -np.einsum("j,ijk,ijl->ikl", cloud.V, cloud.x_ij, cloud.grad_W)
    moment = np.trace(M, axis1=1, axis2=2) / dimensions
    inside = np.clip((moment - SURFACE_MOMENT) / (INNER_MOMENT - SURFACE_MOMENT), 0.0, 1.0)
    B = np.linalg.inv(M + np.diag([0.0, 1.0 if dimensions == 2 else 0.0, 0.0])) * inside[:, None, None]
    weight = cloud.V * (1.0 - np.einsum("jk,ijk->ij", before, cloud.x_ij))
    return np.einsum("ikl,ij,ijl->ik", B, weight, cloud.grad_W), inside


@pytest.mark.parametrize("smoothing", SMOOTHING)
def test_a_sweep_is_its_formula(mixture, smoothing):
    """B_i sum_j V_j (1 - lambda_j . x_ij) grad_i W_ij, less near the surface and nothing at it."""
    cloud = mixture(smoothing=smoothing)
    before = np.random.default_rng(2).normal(size=cloud.x.shape) * [1, 0, 1]
    expected, inside = expected_sweep(cloud, before)
    assert (inside == 0.0).any() and (inside == 1.0).any()
    np.testing.assert_allclose(sweep(cloud, before), expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


def test_a_sweep_in_space(make_cloud):
    random = np.random.default_rng(5)
    cube = np.stack(np.meshgrid(*[np.arange(6)] * 3), axis=-1).reshape(-1, 3)
    cloud = make_cloud(0.1 * (cube + random.uniform(-0.2, 0.2, cube.shape)), rho=np.full(216, 21.0))
    before = random.normal(size=cloud.x.shape)
    expected, inside = expected_sweep(cloud, before, dimensions=3)
    assert (inside > 0.0).any()
    np.testing.assert_allclose(sweep(cloud, before, 3), expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


def test_sweeps_converge(make_cloud, lattice):
    """In disorder, far from the surface; what is left of sum_j V_j f_ij grad_i W_ij after twenty is little."""
    x = lattice(23, 23)
    cloud = make_cloud(x + 0.01 * np.random.default_rng(3).uniform(-1, 1, x.shape) * [1, 0, 1], ratio=1.5)
    inside = np.abs(x).max(axis=1) < 0.45
    left = [np.abs(imbalance(cloud, sweeps(cloud, count))[inside]).max() for count in (0, 1, 4, 20)]
    assert left[1] < 0.6 * left[0] and left[2] < 0.2 * left[0] and left[3] < 0.05 * left[0]


def test_a_lattice_needs_none(make_cloud, lattice):
    cloud = make_cloud(lattice(15, 15))
    inside = np.abs(cloud.x).max(axis=1) < 0.15
    assert np.abs(sweeps(cloud, 1)[inside]).max() < TOLERANCE / cloud.h


def test_neighbour_list_by_columns(mixture):
    """As it lies on a GPU: the same terms, which a CPU adds up in another order."""
    expected, found = sweeps(mixture(), 2), sweeps(mixture(by_column=True), 2)
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())
