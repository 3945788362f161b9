"""Corrections: what Shepard, moving least squares and renormalised gradients reproduce; Vasco (2014), appendix B."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.corrections import density_filter_kernel, take_filtered_density
from warpsph.kernels.smoothing import SMOOTHING

# Single precision, moments of some fifty terms, their eigenvalues up to 10 times apart: relative to the largest value.
TOLERANCE = 1e-5
MLS_TOLERANCE = 1e-6  # what is asked of appendix B, of the value itself

every_smoothing = pytest.mark.parametrize("smoothing", SMOOTHING)
jitter = pytest.mark.parametrize("jitter", [0.0, 0.25], ids=["ordered", "jittered"])


def interpolate(cloud, values: np.ndarray, correction: str) -> np.ndarray:
    """`values` at the particles, interpolated from all of them, shape [n]."""
    return filtered(cloud, values, correction, 0, 1, by_volume=False)


def filtered(cloud, values: np.ndarray, correction: str, steps: int, every: int, by_volume: bool = True) -> np.ndarray:
    """What the stage of a step makes of densities, here m / V, after `steps` others; shape [n]."""
    inputs = [every, cloud.array([steps], int), cloud.position_volume, cloud.fluids, cloud.neighbour_count]
    inputs += [cloud.neighbour_list, cloud.array(values, wp.float64)]
    return cloud.run(density_filter_kernel(cloud.smoothing, correction, by_volume, cloud.layout), inputs, [wp.float64])[
        0
    ]


def gradients(cloud, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """grad f at the particles, renormalised as that of a pressure is, and by NumPy as it is not, each [n, 3]."""
    cloud.velocity_pressure = cloud.array(np.column_stack([cloud.u, f]), wp.vec4)
    return cloud.pressure_gradient(), np.einsum("j,ij,ijk->ik", cloud.V, f[None] - f[:, None], cloud.grad_W)


def plane(values: np.ndarray) -> np.ndarray:
    """The x-z part of vectors or matrices."""
    return values[..., [0, 2]] if values.ndim == 2 else values[:, [0, 2]][:, :, [0, 2]]


@pytest.fixture
def appendix_b(make_cloud, lattice):
    """A function that makes the 361 particles of (0.5, 1.5) x (0.5, 1.5), h = 2 dx, moved by up to `jitter` dx."""

    def make(jitter: float, **fields):
        x = lattice(19, 19, 0.05) + np.array([1.0, 0.0, 1.0])
        x += jitter * 0.05 * np.random.default_rng(4).uniform(-1, 1, x.shape) * [1, 0, 1]
        return make_cloud(x, spacing=0.05, ratio=2.0, **({"smoothing": "cubic_spline"} | fields))

    return make


def linear(cloud) -> np.ndarray:
    """f = x + y of appendix B; here y is z."""
    return cloud.x[:, 0] + cloud.x[:, 2]


def relative_error(cloud, correction: str) -> np.ndarray:
    return np.abs(interpolate(cloud, linear(cloud), correction) / linear(cloud) - 1.0)


# ------------------------------------------------------------------------------------------------------- appendix B


@jitter
def test_mls_of_appendix_b(appendix_b, jitter):
    """The thesis: nothing where ordered, 1e-4 % where jittered."""
    assert relative_error(appendix_b(jitter), "mls").max() < MLS_TOLERANCE


@pytest.mark.parametrize(
    ("constant", "corner", "tolerance", "inside"),
    [(1.0, 0.561, 0.002, 1e-4), (2.0 / 3.0, 0.707, 0.003, 0.334)],
    ids=["right", "eq32"],
)
def test_plain_sums_of_appendix_b(appendix_b, constant, corner, tolerance, inside):
    """The thesis's "more than 70 %" in the corners, and a third inside, come from the constant of its eq 32."""
    cloud = appendix_b(0.0)
    cloud.parameters.kernel_norm *= constant
    error = relative_error(cloud, "plain")
    assert error.argmax() == 360  # the corner (1.45, 1.45)
    assert error.max() == pytest.approx(corner, abs=tolerance)
    assert error[180] < inside


def test_renormalised_gradient_of_appendix_b(appendix_b):
    """First order, exact for f = x + y: eq 53 with eq 54."""
    cloud = appendix_b(0.25)
    gradient, plain = gradients(cloud, linear(cloud))
    np.testing.assert_allclose(gradient, np.tile([1.0, 0.0, 1.0], (361, 1)), rtol=0, atol=TOLERANCE)
    assert np.abs(plain - gradient).max() > 0.5


# ---------------------------------------------------------------------------------------------------------- density


@every_smoothing
@jitter
def test_shepard_reproduces_a_constant(appendix_b, smoothing, jitter):
    """Up to the surface, where the plain sum has lost more than half."""
    cloud = appendix_b(jitter, smoothing=smoothing)
    for correction in ("shepard", "mls"):
        found = interpolate(cloud, np.full(361, 1000.0), correction)
        np.testing.assert_allclose(found, 1000.0, rtol=TOLERANCE)
    found = interpolate(cloud, np.full(361, 1000.0), "plain")
    assert found.min() < 600.0


@every_smoothing
@jitter
def test_mls_reproduces_a_linear_field(appendix_b, smoothing, jitter):
    """Hydrostatic density, up to the surface; Shepard does not."""
    cloud = appendix_b(jitter, smoothing=smoothing)
    rho = 1000.0 + 30.0 * (1.5 - cloud.x[:, 2]) - 12.0 * cloud.x[:, 0]
    error = {name: np.abs(interpolate(cloud, rho, name) - rho).max() / np.ptp(rho) for name in ("shepard", "mls")}
    assert error["mls"] < TOLERANCE < 0.01 < error["shepard"]


@every_smoothing
@pytest.mark.parametrize("correction", ["shepard", "mls"])
def test_the_filter_of_a_step_is_the_same_interpolation(mixture, smoothing, correction):
    """Of m / V of each fluid, and nothing in a step that is not due."""
    cloud = mixture(smoothing=smoothing)
    expected = interpolate(cloud, cloud.rho, correction)
    np.testing.assert_allclose(filtered(cloud, cloud.rho, correction, 19, 20), expected, rtol=TOLERANCE * 0.1)
    assert np.abs(expected - cloud.rho).max() > 1e-3 * 2530.0
    for steps in (0, 18, 20):
        assert not filtered(cloud, cloud.rho, correction, steps, 20).any()


def test_the_filter_leaves_a_uniform_density_to_the_bit(appendix_b):
    cloud = appendix_b(0.25)
    for correction in ("shepard", "mls"):
        np.testing.assert_array_equal(filtered(cloud, cloud.rho, correction, 0, 1), cloud.rho)


@pytest.mark.parametrize("steps", [3, 4])
def test_what_the_filter_takes_is_dissipated(make_cloud, steps):
    """Volume and pressure follow the density; the loss is that of the integral of p / rho^2, here by c^2 s^2 / 2."""
    cloud = make_cloud(np.zeros((1, 3)), u=[0.5, 0.0, 0.25])
    arrays = {
        "filtered": cloud.array([1001.0], wp.float64),
        "fluid": cloud.fluids,
        "density": cloud.array([1002.0], wp.float64),
        "position_volume": cloud.array([[1.0, 2.0, 3.0, 10.0 / 1002.0]], wp.vec4),
        "velocity_pressure": cloud.array([[0.5, 0.0, 0.25, 800.0]], wp.vec4),
        "work": cloud.array([[0.0, 0.0, 0.0]], wp.vec3),
    }
    due = [5, cloud.array([steps], int)]
    cloud.launcher.record_in_order(take_filtered_density, 1, [cloud.parameters, *due, *arrays.values()])()
    found = {name: array.numpy()[0] for name, array in arrays.items()}
    is_due = steps == 4
    assert found["density"] == (1001.0 if is_due else 1002.0)
    assert found["position_volume"][:3].tolist() == [1.0, 2.0, 3.0]
    assert found["position_volume"][3] == pytest.approx(10.0 / found["density"], rel=TOLERANCE)
    assert found["velocity_pressure"][:3].tolist() == [0.5, 0.0, 0.25]
    assert found["velocity_pressure"][3] == pytest.approx(400.0 if is_due else 800.0, rel=0.01)
    lost = 10.0 * 20.0**2 * (0.002**2 - 0.001**2) / 2 if is_due else 0.0
    assert found["work"].tolist() == pytest.approx([lost, 0.0, 0.0], rel=0.01)


def test_mls_in_space(make_cloud):
    """The y row counts there, and the corners have an eighth of a neighbourhood."""
    random = np.random.default_rng(5)
    cube = np.stack(np.meshgrid(*[np.arange(7)] * 3), axis=-1).reshape(-1, 3)
    x = 0.1 * (cube + random.uniform(-0.2, 0.2, cube.shape))
    cloud = make_cloud(x)
    cloud.parameters.kernel_norm = SMOOTHING["wendland_c2"].normalisation[3] / cloud.h**3
    cloud.parameters.gradient_norm = cloud.parameters.kernel_norm / cloud.h**2
    cloud.position_volume = cloud.array(np.column_stack([cloud.x, np.full(343, 1e-3)]), wp.vec4)
    rho = 1000.0 + cloud.x @ [10.0, -20.0, 30.0]
    found = interpolate(cloud, rho, "mls")
    np.testing.assert_allclose(found, rho, rtol=0, atol=TOLERANCE * np.ptp(rho))
    support = interpolate(cloud, np.ones(343), "plain")
    assert support[171] == pytest.approx(1.0, abs=0.1) and support.min() < 0.4
    # The gradient too.
    gradient, _ = gradients(cloud, cloud.x @ [10.0, -20.0, 30.0])
    np.testing.assert_allclose(gradient, np.tile([10.0, -20.0, 30.0], (343, 1)), rtol=0, atol=30.0 * TOLERANCE)


def test_support_is_shepards_sum(mixture):
    """sum V_j W_ij, the plain sum of 1, the particle itself among them, and no particle of another fluid."""
    cloud = mixture()
    support = interpolate(cloud, np.ones(len(cloud.x)), "plain")
    same = cloud.fluid[:, None] == cloud.fluid
    expected = np.sum(same * cloud.V * cloud.W, axis=1) + cloud.V * cloud.W_at(0.0)
    np.testing.assert_allclose(support, expected, rtol=TOLERANCE)


@pytest.mark.parametrize("correction", ["shepard", "mls"])
def test_fluids_do_not_mix(mixture, correction):
    """Water beside rock stays water."""
    cloud = mixture()
    rho = np.where(cloud.fluid == 0, 1000.0, 2530.0)
    found = interpolate(cloud, rho, correction)
    np.testing.assert_allclose(found, rho, rtol=TOLERANCE)


def test_plain_is_eq_42(mixture):
    """rho_i = sum_j m_j W_ij of one fluid."""
    cloud = mixture(fluid=0)
    found = interpolate(cloud, cloud.rho, "plain")
    expected = cloud.W @ cloud.m + cloud.m * cloud.W_at(0.0)
    np.testing.assert_allclose(found, expected, rtol=TOLERANCE)


@pytest.mark.parametrize("correction", ["shepard", "mls"])
def test_right_density_is_left_to_the_last_digit(appendix_b, correction):
    """A double that no float can hold comes back with an error far below single precision."""
    rho = 1000.0 + 1e-7
    found = interpolate(appendix_b(0.25), np.full(361, rho), correction)
    np.testing.assert_allclose(found, rho, rtol=5e-7)


# ------------------------------------------------------------------------------------- where neighbours do not span


@pytest.mark.parametrize(
    "x",
    [[[0, 0, 0]], [[0, 0, 0], [0.1, 0, 0]], [[0.1 * k, 0, 0.05 * k] for k in range(5)]],
    ids=["alone", "pair", "line"],
)
def test_falls_back_where_neighbours_do_not_span(make_cloud, x):
    """MLS becomes Shepard's, and a gradient what it is without B."""
    cloud = make_cloud(np.array(x, float))
    rho = 1000.0 + 10.0 * np.arange(len(x))
    by_mls, by_shepard = (interpolate(cloud, rho, name) for name in ("mls", "shepard"))
    np.testing.assert_array_equal(by_mls, by_shepard)
    gradient, plain = gradients(cloud, rho)
    np.testing.assert_allclose(gradient, plain, rtol=TOLERANCE, atol=TOLERANCE)


def test_spray_on_the_rim_of_a_support(make_cloud):
    """Neighbours so far that they hardly count: nothing is blown up."""
    far = 2.0 * 0.15 * (1.0 - 1e-3)
    cloud = make_cloud(np.array([[0, 0, 0], [far, 0, 0], [0, 0, far]], float))
    rho = np.array([1000.0, 1010.0, 990.0])
    assert interpolate(cloud, rho, "mls")[0] == pytest.approx(1000.0, abs=1e-3)
    assert np.abs(gradients(cloud, rho)[0][0]).max() < 1e-3


# --------------------------------------------------------------------------------------------------------- gradient


@every_smoothing
def test_renormalised_gradient_is_eq_53_with_eq_54(mixture, smoothing):
    """[sum V_j (x_j - x_i) (x) grad_i W_ij]^-1 sum V_j (p_j - p_i) grad_i W_ij, in the plane."""
    cloud = mixture(smoothing=smoothing, fluid=0)
    M = -np.einsum("j,ijk,ijl->ikl", cloud.V, cloud.x_ij, cloud.grad_W)
    found, plain = gradients(cloud, cloud.p)
    expected = np.linalg.solve(plane(M), plane(plain)[:, :, None])[:, :, 0]
    np.testing.assert_allclose(plane(found), expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


@every_smoothing
def test_inside_a_lattice_nothing_is_corrected(make_cloud, lattice, smoothing):
    """Inside B is the identity but for the lattice's own error."""
    cloud = make_cloud(lattice(13, 13), smoothing=smoothing, ratio=1.9)
    gradient, plain = gradients(cloud, linear(cloud))
    np.testing.assert_allclose(gradient[84], plain[84], rtol=0, atol=0.02)


def test_neighbour_list_by_columns(mixture):
    """As it lies on a GPU: the same terms in the same order, so the same bits."""
    rows, columns = mixture(), mixture(by_column=True)
    np.testing.assert_array_equal(interpolate(rows, rows.rho, "mls"), interpolate(columns, rows.rho, "mls"))
    np.testing.assert_array_equal(rows.pressure_gradient(), columns.pressure_gradient())
