"""The kernels of Braga (2018): integrals, slopes, the Laplacian, and what walls do to a particle that went through."""

import math

import numpy as np
import pytest
import warp as wp

from warpsph.device.launch import Launcher
from warpsph.kernels.mueller import POLY6, SPIKY, VISCOUS, viscous_laplacian, within_walls

# Evaluated in single precision.
TOLERANCE = 2e-6
KERNELS = {"poly6": POLY6, "spiky": SPIKY, "viscous": VISCOUS}
every_kernel = pytest.mark.parametrize("name", KERNELS)


@pytest.fixture(scope="module")
def tabulated(device):
    """q [n] up to the support, and by name the shape, the slope and the Laplacian there, all from one launch."""
    shapes = [function for kernel in KERNELS.values() for function in (kernel.shape, kernel.slope)]
    a, b, c, d, e, f = shapes

    @wp.kernel(module="unique", enable_backward=False)
    def tabulate(first: int, q: wp.array[float], out: wp.array2d[float]):
        i = first + wp.tid()
        out[i, 0] = a(q[i])
        out[i, 1] = b(q[i])
        out[i, 2] = c(q[i])
        out[i, 3] = d(q[i])
        out[i, 4] = e(q[i])
        out[i, 5] = f(q[i])
        out[i, 6] = viscous_laplacian(q[i])

    # Nodes that are exact for polynomials, crowded at 0, where two of the kernels have a pole of their slope.
    node, weight = np.polynomial.legendre.leggauss(64)
    root, beyond = (node + 1) / 2, np.array([1.0, 1.001, 2.0, 1e6])
    q = np.append(root**2, beyond).astype(np.float32)
    out = wp.zeros((len(q), 7), dtype=float, device=device)
    Launcher(device).record_in_order(tabulate, len(q), [wp.array(q, dtype=float, device=device), out])()
    found = dict(zip(KERNELS, out.numpy()[:, :6].astype(float).reshape(len(q), 3, 2).transpose(1, 2, 0), strict=True))
    return q.astype(float), root * weight, found | {"laplacian": out.numpy()[:, 6].astype(float)}


@every_kernel
def test_integral_is_one(tabulated, name):
    q, weight, values = tabulated
    shape = values[name][0][:64]
    assert KERNELS[name].normalisation[2] * np.sum(weight * 2 * math.pi * q[:64] * shape) == pytest.approx(
        1.0, abs=1e-5
    )


@every_kernel
def test_nothing_beyond_the_support(tabulated, name):
    assert np.abs(tabulated[2][name][:, 64:]).max() < TOLERANCE
    assert np.all(tabulated[2]["laplacian"][64:] == 0.0)


@every_kernel
def test_slope_is_the_derivative_of_the_thesis_formula(tabulated, name):
    """Eq 3.25 to 3.27, differentiated by hand; no pair is nearer than a millionth of h."""
    q, _, values = tabulated
    apart = np.flatnonzero((q > 1e-6) & (q <= 1.0))
    q = q[apart]
    shape, derivative = {
        "poly6": ((1 - q**2) ** 3, -6 * q * (1 - q**2) ** 2),
        "spiky": ((1 - q) ** 3, -3 * (1 - q) ** 2),
        "viscous": (q**2 / 4 - q**3 / 9 - np.log(q) / 6 - 5 / 36, q / 2 - q**2 / 3 - 1 / (6 * q)),
    }[name]
    np.testing.assert_allclose(values[name][0][apart], shape, atol=TOLERANCE)
    np.testing.assert_allclose(values[name][1][apart] * q, derivative, rtol=2e-5, atol=TOLERANCE)


def test_gradient_integrates_by_parts(tabulated):
    """The integral of x dW/dx is -1, so that the gradient of a linear pressure is exact."""
    q, weight, values = tabulated
    q = q[:64]
    for name, kernel in KERNELS.items():
        moment = kernel.normalisation[2] * np.sum(weight * math.pi * q**3 * values[name][1][:64])
        assert moment == pytest.approx(-1.0, abs=1e-5), name


def test_second_moment_of_the_laplacian_is_exact(tabulated):
    """The integral of x^2 lap W is 2: viscosity is mu, neither more nor less."""
    q, weight, values = tabulated
    q = q[:64]
    np.testing.assert_allclose(values["laplacian"][:64], 1 - q, atol=TOLERANCE)
    moment = VISCOUS.normalisation[2] * np.sum(weight * math.pi * q**3 * values["laplacian"][:64])
    assert moment == pytest.approx(2.0, abs=1e-5)


# ------------------------------------------------------------------------------------------------------------- walls


def damp_reflect(axis: int, barrier: float, x: np.ndarray, v: np.ndarray, half: np.ndarray) -> None:
    """As the program of the thesis does it, appendix A, in place."""
    if v[axis] == 0.0:
        return
    bounce = (x[axis] - barrier) / v[axis]
    x -= v * 0.25 * bounce
    x[axis] = 2 * barrier - x[axis]
    for one in (v, half):
        one[axis] = -one[axis]
        one *= 0.75


def test_walls_throw_back_as_the_program_does(device):
    random = np.random.default_rng(3)
    x = random.uniform(-0.1, 1.1, (200, 2))
    v, half = random.normal(size=(2, 200, 2))
    v[:20, 0], v[20:40, 1] = 0.0, 0.0  # along a wall

    @wp.kernel(module="unique", enable_backward=False)
    def throw(first: int, x: wp.array[wp.vec3d], v: wp.array[wp.vec3], half: wp.array[wp.vec3]):
        i = first + wp.tid()
        lower, upper = wp.vec3d(), wp.vec3d(wp.float64(1.0))
        x_end, v_end, half_end = within_walls(lower, upper, 0.75, x[i], v[i], half[i])
        x[i] = x_end
        v[i] = v_end
        half[i] = half_end

    types = (wp.vec3d, wp.vec3, wp.vec3)
    arrays = [
        wp.array(np.insert(values, 1, 0.0, axis=1), dtype=dtype, device=device)
        for values, dtype in zip((x, v, half), types, strict=True)
    ]
    Launcher(device).record_in_order(throw, len(x), arrays)()
    for one in zip(x, v, half, strict=True):
        for axis, barrier, beyond in ((0, 0.0, -1), (0, 1.0, 1), (1, 0.0, -1), (1, 1.0, 1)):
            if (one[0][axis] - barrier) * beyond > 0:
                damp_reflect(axis, barrier, *one)
    for array, expected in zip(arrays, (x, v, half), strict=True):
        np.testing.assert_allclose(array.numpy()[:, [0, 2]], expected, rtol=2e-5, atol=2e-5)
