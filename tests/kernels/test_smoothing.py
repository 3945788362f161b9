"""Smoothing kernels: their integrals, slopes and supports."""

import math
from itertools import pairwise

import numpy as np
import pytest
import warp as wp

from warpsph.device.launch import Launcher
from warpsph.kernels.smoothing import SMOOTHING

# Shapes are of order 1 and evaluated in single precision, to about 1e-7; quadrature is exact beyond that.
TOLERANCE = 2e-6

KNOTS = {
    "wendland_c2": [0, 2],
    "cubic_spline": [0, 1, 2],
    "quintic_spline": [0, 2 / 3, 4 / 3, 2],
    "gaussian": [0, 1, 2, 3],
}

pytestmark = pytest.mark.parametrize("name", SMOOTHING)


@pytest.fixture
def evaluate(device):
    """A function that evaluates a wp.func of q on the device, as float64."""

    def on_device(function: wp.Function, q: np.ndarray) -> np.ndarray:
        @wp.kernel(module="unique", enable_backward=False)
        def tabulate(first: int, q: wp.array[float], value_out: wp.array[float]):
            i = first + wp.tid()
            value_out[i] = function(q[i])

        q = wp.array(np.asarray(q, np.float32), device=device)
        value = wp.zeros_like(q)
        Launcher(device).record_in_order(tabulate, len(q), [q, value])()
        return value.numpy().astype(float)

    return on_device


def gauss(knots: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of a quadrature, exact for polynomials of degree 63 between `knots`."""
    node, weight = np.polynomial.legendre.leggauss(32)
    pieces = [((b - a) / 2 * node + (a + b) / 2, (b - a) / 2 * weight) for a, b in pairwise(knots)]
    return np.concatenate([q for q, _ in pieces]), np.concatenate([w for _, w in pieces])


@pytest.mark.parametrize("dimensions", [2, 3])
def test_integral_is_one(evaluate, name, dimensions):
    q, weight = gauss(KNOTS[name])
    shell = 2 * math.pi * q if dimensions == 2 else 4 * math.pi * q**2
    integral = SMOOTHING[name].normalisation[dimensions] * np.sum(weight * shell * evaluate(SMOOTHING[name].shape, q))
    assert integral == pytest.approx(1.0, abs=TOLERANCE)


def test_slope_is_the_derivative_of_the_shape(evaluate, name):
    # Fourth-order differences over 0.02, exact to 1e-5 of the steepest slope next to rounding.
    step, knots = 0.02, np.array(KNOTS[name])
    q = np.linspace(0.1, SMOOTHING[name].support - 0.1, 200, dtype=np.float32).astype(float)
    q = q[np.abs(q[:, None] - knots).min(axis=1) > 2 * step]
    far_left, left, right, far_right = (
        evaluate(SMOOTHING[name].shape, q + k * step).astype(float) for k in (-2, -1, 1, 2)
    )
    derivative = (far_left - 8 * left + 8 * right - far_right) / (12 * step)
    slope = evaluate(SMOOTHING[name].slope, q) * q
    np.testing.assert_allclose(slope, derivative, rtol=0, atol=5e-5 * np.abs(slope).max())


def test_nothing_at_the_support_and_beyond(evaluate, name):
    kernel = SMOOTHING[name]
    q = kernel.support * np.array([1.0, 1.0001, 1.1, 2.0, 1e3, 1e9])
    assert np.all(evaluate(kernel.shape, q) == 0.0)
    assert np.all(evaluate(kernel.slope, q) == 0.0)


def test_falls_from_its_middle_to_its_support(evaluate, name):
    kernel = SMOOTHING[name]
    q = np.linspace(0.0, kernel.support - 1e-3, 500)
    shape, slope = evaluate(kernel.shape, q), evaluate(kernel.slope, q)
    assert np.all(shape > 0.0) and np.all(np.diff(shape) < 0.0)
    assert np.all(slope[1:] < 0.0) and np.isfinite(slope[0])


def test_formula(evaluate, name):
    """Vasco (2014) eq 30, 32 and section 5.4, with the constant of eq 32 put right; Morris, Fox & Zhu (1997).

    Eq 32 prints 10 / (7 pi), which integrates to 2/3 rather than to 1.
    """
    pi, cut = math.pi, 1 - math.exp(-9)
    formula, constant = {
        "wendland_c2": (lambda q: (1 - q / 2) ** 4 * (1 + 2 * q), 7 / (4 * pi)),
        "cubic_spline": (lambda q: np.where(q < 1, 2 / 3 - q**2 + q**3 / 2, (2 - q) ** 3 / 6), 15 / (7 * pi)),
        # Morris, Fox & Zhu have h two thirds of ours.
        "quintic_spline": (
            lambda q: sum(c * np.maximum(a - 1.5 * q, 0.0) ** 5 for a, c in ((3, 1), (2, -6), (1, 15))),
            1.5**2 * 7 / (478 * pi),
        ),
        "gaussian": (lambda q: np.exp(-(q**2)), 1 / (pi * cut)),
    }[name]
    q = np.linspace(0.0, SMOOTHING[name].support - 1e-3, 100, dtype=np.float32).astype(float)
    w = formula(q)
    np.testing.assert_allclose(evaluate(SMOOTHING[name].shape, q), w, rtol=0, atol=TOLERANCE * w.max())
    assert SMOOTHING[name].normalisation[2] == pytest.approx(constant, rel=1e-12)
    if name == "cubic_spline":
        q, weight = gauss(KNOTS[name])
        assert 10 / (7 * pi) * np.sum(weight * 2 * pi * q * formula(q)) == pytest.approx(2 / 3, rel=1e-12)
