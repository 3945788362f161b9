"""Shifting: its formula, where it must do nothing, that nothing goes through a surface, and that it brings order."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.layout import Layout
from warpsph.kernels.rates import Formulas
from warpsph.kernels.shifting import (
    MOST_DRIFT,
    PAIRING,
    SPRAY,
    SURFACE,
    change_with_place,
    cover_kernel,
    shifting_kernel,
)
from warpsph.kernels.smoothing import SMOOTHING

# Single precision, sums of some thirty terms that nearly cancel: relative to the largest of what is compared.
TOLERANCE = 1e-5

every_smoothing = pytest.mark.parametrize("smoothing", SMOOTHING)
SHEAR = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # u = 2 z: a shear rate of 2 / s


def shaken(x: np.ndarray, share: float = 0.2) -> np.ndarray:
    """`x` with every point moved by up to `share` of the lattice's 0.1 m."""
    return x + 0.1 * share * np.random.default_rng(3).uniform(-1, 1, x.shape) * [1, 0, 1]


def chosen(cloud, dimensions: int = 2) -> tuple[Formulas, Layout]:
    """What the kernels close over."""
    return Formulas(smoothing=cloud.smoothing, dimensions=dimensions), cloud.layout


def packed(cloud, dimensions: int = 2) -> list[wp.array]:
    """What pair loops read; in a plane x stands in the place of v."""
    quadruples = np.column_stack([cloud.u, cloud.p])
    if dimensions == 2:
        quadruples[:, 1] = cloud.x[:, 0]
    velocity_pressure = cloud.array(quadruples, wp.vec4)
    return [cloud.launcher.packed(array) for array in (cloud.position_volume, velocity_pressure)]


def cover(cloud, dimensions: int = 2) -> np.ndarray:
    """Least eigenvalue of the moments, shape [n]."""
    inputs = [*packed(cloud, dimensions), cloud.neighbour_count, cloud.neighbour_list]
    return cloud.run(cover_kernel(*chosen(cloud, dimensions)), inputs, [float])[0]


def drift(cloud, strength: float = 1.0, count: int | None = None) -> np.ndarray:
    """du_i [m/s], shape [n, 3]."""
    inputs = [len(cloud.x) if count is None else count, strength, *packed(cloud), cloud.fluids]
    inputs += [cloud.neighbour_count, cloud.neighbour_list, cloud.array(cover(cloud), float)]
    return cloud.run(shifting_kernel(*chosen(cloud)), inputs, [wp.vec3])[0]


def moments(cloud) -> np.ndarray:
    """sum V_j (x_j - x_i) (x) grad W of the plane, shape [n, 2, 2]."""
    return -np.einsum("j,ijk,ijl->ikl", cloud.V, cloud.x_ij, cloud.grad_W)[:, ::2, ::2]


@every_smoothing
def test_cover_is_the_least_eigenvalue(mixture, smoothing):
    cloud = mixture(smoothing=smoothing)
    M = moments(cloud)
    np.testing.assert_allclose(
        cover(cloud), np.linalg.eigvalsh(0.5 * (M + M.swapaxes(1, 2)))[:, 0], rtol=0, atol=10 * TOLERANCE
    )


def test_cover_in_space(make_cloud):
    random = np.random.default_rng(5)
    cube = np.stack(np.meshgrid(*[np.arange(6)] * 3), axis=-1).reshape(-1, 3)
    cloud = make_cloud(0.1 * (cube + random.uniform(-0.2, 0.2, cube.shape)))
    cloud.parameters.gradient_norm = SMOOTHING["wendland_c2"].normalisation[3] / cloud.h**5
    cloud.position_volume = cloud.array(np.column_stack([cloud.x, np.full(216, 1e-3)]), wp.vec4)
    scale = SMOOTHING["wendland_c2"].normalisation[3] / (cloud.h * SMOOTHING["wendland_c2"].normalisation[2])
    M = -1e-3 * scale * np.einsum("ijk,ijl->ikl", cloud.x_ij, cloud.grad_W)
    found = cover(cloud, dimensions=3)
    np.testing.assert_allclose(found, np.linalg.eigvalsh(0.5 * (M + M.swapaxes(1, 2)))[:, 0], atol=10 * TOLERANCE)
    assert found.max() > 0.8 and found.min() < 0.3


def test_cover_tells_rows_from_each_other(make_cloud, lattice):
    """Of a lattice: a corner, the surface, the row below it, and what has neighbours all around."""
    found = cover(make_cloud(lattice(13, 13))).reshape(13, 13)
    assert found[0, 0] < SPRAY < found[0, 6] < SURFACE < found[1, 6] < 0.9 < 0.99 < found[6, 6]


@every_smoothing
def test_drift_is_its_formula(make_cloud, lattice, smoothing):
    """-A h^2 g sum V_j (1 + R (W / W(dx))^4) grad W inside a fluid in shear, where nothing bounds it."""
    half = int(np.ceil(2 * SMOOTHING[smoothing].support * 1.5)) + 3
    x = shaken(lattice(2 * half + 1, 2 * half + 1))
    cloud = make_cloud(x, u=x @ SHEAR.T, smoothing=smoothing)
    inside = np.abs(x).max(axis=1) < 0.25
    pairs = cloud.V * (1.0 + PAIRING * (cloud.W / cloud.W_at(0.1)) ** 4)
    expected = -0.1 * cloud.h**2 * 2.0 * np.einsum("ij,ijk->ik", pairs, cloud.grad_W)
    found = drift(cloud, strength=0.1)
    scale = np.abs(expected[inside]).max()
    assert 0.0 < scale < MOST_DRIFT * 2.0 * cloud.h
    np.testing.assert_allclose(found[inside], expected[inside], rtol=0, atol=10 * TOLERANCE * scale)


def test_it_is_bounded(make_cloud, lattice):
    x = shaken(lattice(11, 11), 0.45)
    cloud = make_cloud(x, u=x @ SHEAR.T)
    speed = np.linalg.norm(drift(cloud, strength=1e3), axis=1)
    assert speed.max() == pytest.approx(MOST_DRIFT * 2.0 * cloud.h, rel=TOLERANCE)


def test_what_is_not_strained_is_left_alone(make_cloud, lattice):
    """At rest, in uniform motion and in rotation, however disordered."""
    x = shaken(lattice(11, 11))
    still = np.zeros(len(x))
    largest = np.abs(drift(make_cloud(x, u=x @ SHEAR.T))).max()
    for u in (0.0, [5.0, 0.0, -2.0], 3.0 * np.stack([-x[:, 2], still, x[:, 0]], axis=1)):
        assert np.abs(drift(make_cloud(x, u=u))).max() < 100 * TOLERANCE * largest


def test_no_frame_of_reference_is_preferred(make_cloud, lattice):
    x = shaken(lattice(11, 11))
    u = x @ SHEAR.T
    at_rest, moving = drift(make_cloud(x, u=u)), drift(make_cloud(x, u=u + np.array([5.0, 0.0, -2.0])))
    np.testing.assert_allclose(moving, at_rest, rtol=0, atol=100 * TOLERANCE * np.abs(at_rest).max())


def test_a_held_fluid_does_not_drift(make_cloud, lattice):
    x = shaken(lattice(11, 11))
    assert not drift(make_cloud(x, u=x @ SHEAR.T, mobility=[0.0, 1.0])).any()


def test_nothing_goes_through_a_surface(make_cloud, lattice):
    """A lattice is even: what is left of the drift lies along its surface, and spray in its corners stays."""
    x = lattice(15, 15)
    cloud = make_cloud(x, u=x @ SHEAR.T)
    found = drift(cloud, strength=0.1).reshape(15, 15, 3)
    pairs = cloud.V * (1.0 + PAIRING * (cloud.W / cloud.W_at(0.1)) ** 4)
    unhindered = 0.1 * cloud.h**2 * 2.0 * np.abs(np.einsum("ij,ijk->ik", pairs, cloud.grad_W)).max()
    assert np.abs(found[0, 5:-5]).max() < 0.01 * unhindered
    assert np.abs(found[1:4, 4:-4, 2]).max() < 0.02 * unhindered
    assert not found[0, 0].any()


def test_an_image_has_no_cover_of_its_own(make_cloud, lattice):
    """Entries behind the particles are read for what is packed alone: their cover may be anything."""
    x = shaken(lattice(15, 15))
    cloud = make_cloud(x, u=x @ SHEAR.T)
    inside = np.abs(x).max(axis=1) < 0.3
    np.testing.assert_array_equal(drift(cloud, count=0)[inside], drift(cloud)[inside])


def test_velocity_changes_with_the_place(make_cloud):
    """L du, on top of the acceleration that is there."""
    random = np.random.default_rng(6)
    L, du, a = random.normal(size=(5, 3, 3)), random.normal(size=(5, 3)), random.normal(size=(5, 3))
    cloud = make_cloud(random.normal(size=(5, 3)))
    found = cloud.array(a, wp.vec3)
    cloud.launcher.record_in_order(change_with_place, 5, [cloud.array(L, wp.mat33), cloud.array(du, wp.vec3), found])()
    np.testing.assert_allclose(found.numpy(), a + np.einsum("nab,nb->na", L, du), rtol=0, atol=TOLERANCE)


def test_a_jittered_block_becomes_even(make_cloud, lattice):
    """The concentration scatters less and the closest come apart, by nothing but the drift; the surface stays."""
    x = shaken(lattice(21, 21), 0.3)
    inside = np.abs(lattice(21, 21)).max(axis=1) < 0.65

    def evenness(x) -> tuple[float, float]:
        cloud = make_cloud(x)
        return float((cloud.W * 0.01).sum(axis=1)[inside].std()), float(cloud.r[inside].min())

    scatter, closest = evenness(x)
    extent = np.ptp(x, axis=0)
    for _ in range(150):
        cloud = make_cloud(x, u=x @ SHEAR.T)
        x = x + 0.02 * drift(cloud, strength=3.0)
    scatter_after, closest_after = evenness(x)
    assert scatter_after < 0.5 * scatter
    assert closest_after > 1.3 * closest
    np.testing.assert_allclose(np.ptp(x, axis=0), extent, atol=0.05)


def test_neighbour_list_by_columns(mixture):
    """As it lies on a GPU: the same terms, which a CPU adds up in another order."""
    rows, columns = mixture(), mixture(by_column=True)
    expected = drift(rows)
    np.testing.assert_allclose(drift(columns), expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())
