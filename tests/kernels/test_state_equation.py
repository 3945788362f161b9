"""Equations of state: pressure, its inverse, and the internal energy that goes with it, in the thesis's own form."""

import numpy as np
import pytest
import warp as wp

from warpsph.device.launch import Launcher
from warpsph.kernels.state_equation import density_of, internal_energy, pressure

# Pressure leaves the kernel in single precision; what comes before is in double.
TOLERANCE = 1e-6
REST_DENSITY, SOUND_SPEED = 1000.0, 22.0
TAIT, LINEAR = 1.0, 0.0

# From a thousandth of a millionth to far beyond what a liquid does, both ways.
SMALL = 10.0 ** np.arange(-9, -1)
COMPRESSION = np.sort(np.concatenate([-SMALL, SMALL, [0.0], np.linspace(-0.3, 0.5, 33)[1:]]))
both = pytest.mark.parametrize("stiffening", [TAIT, LINEAR], ids=["tait", "linear"])


@wp.kernel(enable_backward=False)
def evaluate(
    first: int,
    stiffening: float,
    density: wp.array[wp.float64],
    pressure_out: wp.array[float],
    energy_out: wp.array[wp.float64],
    density_out: wp.array[wp.float64],
):
    i = first + wp.tid()
    p = pressure(density[i], 1000.0, 22.0, stiffening)
    pressure_out[i] = p
    energy_out[i] = internal_energy(density[i], 1000.0, 22.0, stiffening)
    density_out[i] = density_of(p, 1000.0, 22.0, stiffening)


@pytest.fixture
def state_of(device):
    """A function of density [kg/m3] that gives p [Pa], e [J/kg] and the density regained from p, shape [n] each."""

    def on_device(density: np.ndarray, stiffening: float) -> list[np.ndarray]:
        density = wp.array(density, dtype=wp.float64, device=device)
        written = [wp.zeros(len(density), dtype=dtype, device=device) for dtype in (float, wp.float64, wp.float64)]
        Launcher(device).record_in_order(evaluate, len(density), [stiffening, density, *written])()
        return [array.numpy().astype(float) for array in written]

    return on_device


def thesis_pressure(s: np.ndarray, stiffening: float) -> np.ndarray:
    """Vasco (2014) eq 56 or 57 from s = rho / rho0 - 1 [Pa]."""
    if stiffening == LINEAR:
        return SOUND_SPEED**2 * REST_DENSITY * s
    return SOUND_SPEED**2 * REST_DENSITY / 7 * np.expm1(7 * np.log1p(s))


@both
def test_pressure_is_that_of_the_thesis(state_of, stiffening):
    density = REST_DENSITY * (1 + COMPRESSION)
    p, _, _ = state_of(density, stiffening)
    # The density itself, near 1000, resolves s to 1e-16.
    np.testing.assert_allclose(p, thesis_pressure(density / REST_DENSITY - 1, stiffening), rtol=TOLERANCE, atol=1e-9)


@both
def test_sound_speed_is_the_slope_at_rest(state_of, stiffening):
    s = 1e-5
    (low, high), _, _ = state_of(REST_DENSITY * np.array([1 - s, 1 + s]), stiffening)
    assert (high - low) / (2 * s * REST_DENSITY) == pytest.approx(SOUND_SPEED**2, rel=TOLERANCE)


@both
def test_density_is_regained_from_pressure(state_of, stiffening):
    density = REST_DENSITY * (1 + COMPRESSION)
    _, _, regained = state_of(density, stiffening)
    # Pressure carries s to single precision.
    np.testing.assert_allclose(regained / REST_DENSITY - 1, density / REST_DENSITY - 1, rtol=TOLERANCE, atol=1e-12)


@both
def test_internal_energy_is_the_work_of_compression(state_of, stiffening):
    s = COMPRESSION[np.abs(COMPRESSION) > 1e-5]  # below that the energy, ~ s^2, drowns in the rounding of 1 + s
    _, energy, _ = state_of(REST_DENSITY * (1 + s), stiffening)
    node, weight = np.polynomial.legendre.leggauss(32)
    along = s[:, None] * (node + 1) / 2
    integrand = thesis_pressure(along, stiffening) / (REST_DENSITY * (1 + along) ** 2)  # p / rho^2 d rho = this ds
    work = 0.5 * s * (integrand @ weight)
    np.testing.assert_allclose(energy, work, rtol=10 * TOLERANCE)


@both
def test_rest_has_neither_pressure_nor_energy(state_of, stiffening):
    p, energy, _ = state_of(np.array([REST_DENSITY]), stiffening)
    assert p[0] == 0.0 and energy[0] == pytest.approx(0.0, abs=1e-12)
