"""Rheology: the laws against their closed forms, what keeps them finite, and the invariants of a velocity gradient."""

import numpy as np
import pytest
import warp as wp

from warpsph.device.launch import Launcher
from warpsph.kernels.rheology import REGULARISATION, RHEOLOGY, Rheology, apparent_viscosity_kernel

# Single precision; a power of a number far from 1 loses a digit. Relative.
TOLERANCE = 5e-6

K, TAU_Y, MU_MAX = 2.0, 50.0, 2000.0
RATES = np.concatenate([[0.0], np.geomspace(1e-6, 1e6, 200)])

every_law = pytest.mark.parametrize("law", RHEOLOGY)
every_regularisation = pytest.mark.parametrize("regularisation", REGULARISATION)


def shear(rates: np.ndarray) -> np.ndarray:
    """Velocity gradients of u = (rate z, 0, 0) [1/s], shape [n, 3, 3]."""
    L = np.zeros((len(rates), 3, 3))
    L[:, 0, 2] = rates
    return L


@pytest.fixture
def viscosity(device):
    """A function of law, regularisation and velocity gradients that gives mu [Pa s] as an array."""

    def evaluate(law, regularisation, gradients, *, dimensions=2, exponent=0.5, yield_stress=TAU_Y, maximum=MU_MAX):
        launcher, n = Launcher(device, threads=1), len(gradients)

        def array(values, dtype=float):
            return wp.array(np.asarray(values), dtype=dtype, device=device)

        rheology = Rheology()
        rheology.consistency, rheology.exponent = array([K]), array([exponent])
        rheology.yield_stress, rheology.viscosity_max = array([yield_stress]), array([maximum])
        mu = array(np.zeros(n))
        inputs = [rheology, array(np.zeros(n), int), array(gradients, wp.mat33), dimensions]
        launcher.record_in_order(apparent_viscosity_kernel(law, regularisation), n, [*inputs, mu])()
        return mu.numpy().astype(float)

    return evaluate


# ------------------------------------------------------------------------------------------------------------ laws


@every_law
def test_eq_107(viscosity, law):
    """mu = min(tau_y / rate + K rate^(N - 1), mu_max)."""
    rate = RATES[1:]
    N = 0.5 if law in ("power_law", "herschel_bulkley") else 1.0
    tau_y = TAU_Y if law in ("bingham", "herschel_bulkley") else 0.0
    mu = viscosity(law, "bi_viscous", shear(rate))
    np.testing.assert_allclose(mu, np.minimum(tau_y / rate + K * rate ** (N - 1.0), MU_MAX), rtol=TOLERANCE)


def test_papanastasiou(viscosity):
    """tau = K rate + tau_y (1 - exp(-m rate)) of a Bingham fluid, m = (mu_max - K) / tau_y."""
    rate = RATES[1:]
    mu = viscosity("bingham", "papanastasiou", shear(rate))
    expected = K - TAU_Y * np.expm1(-(MU_MAX - K) / TAU_Y * rate) / rate
    np.testing.assert_allclose(mu, expected, rtol=TOLERANCE)


def test_cross(viscosity):
    """(mu - K) / (mu_max - K) = 1 / (1 + k rate) of a Bingham fluid, k = (mu_max - K) / tau_y."""
    mu = viscosity("bingham", "cross", shear(RATES))
    expected = K + (MU_MAX - K) / (1.0 + (MU_MAX - K) / TAU_Y * RATES)
    np.testing.assert_allclose(mu, expected, rtol=TOLERANCE)


@every_regularisation
def test_exponent_of_one_is_bingham(viscosity, regularisation):
    found = viscosity("herschel_bulkley", regularisation, shear(RATES), exponent=1.0)
    expected = viscosity("bingham", regularisation, shear(RATES))
    np.testing.assert_allclose(found, expected, rtol=TOLERANCE)


@every_regularisation
@pytest.mark.parametrize("exponent", [0.5, 1.5])
def test_no_yield_stress_is_power_law(viscosity, regularisation, exponent):
    found = viscosity("herschel_bulkley", regularisation, shear(RATES), exponent=exponent, yield_stress=0.0)
    expected = viscosity("power_law", regularisation, shear(RATES), exponent=exponent)
    np.testing.assert_allclose(found, expected, rtol=TOLERANCE)


@every_regularisation
def test_newtonian_is_constant(viscosity, regularisation):
    mu = viscosity("newtonian", regularisation, shear(RATES))
    np.testing.assert_allclose(mu, K, rtol=TOLERANCE)


# -------------------------------------------------------------------------------------------------- regularisations


@every_law
@every_regularisation
@pytest.mark.parametrize("exponent", [0.5, 1.5])
def test_bounded_and_the_stress_grows(viscosity, law, regularisation, exponent):
    """0 <= mu <= mu_max, and more shear takes more stress: otherwise a flow would break up into bands."""
    mu = viscosity(law, regularisation, shear(RATES), exponent=exponent)
    assert np.all(mu >= 0.0) and np.all(mu <= MU_MAX * (1.0 + TOLERANCE))
    stress = mu * RATES
    assert np.all(np.diff(stress) >= -TOLERANCE * stress[1:])
    if exponent < 1.0:  # nothing thickens
        assert np.all(np.diff(mu) <= TOLERANCE * mu[1:])


@every_regularisation
@pytest.mark.parametrize("law", ["bingham", "herschel_bulkley"])
def test_at_rest_the_viscosity_is_the_largest(viscosity, law, regularisation):
    """Also in the slowest flow that single precision knows."""
    mu = viscosity(law, regularisation, shear(np.array([0.0, 1e-30, 1e-9])))
    np.testing.assert_allclose(mu, MU_MAX, rtol=TOLERANCE)


@every_regularisation
@pytest.mark.parametrize("law", ["bingham", "herschel_bulkley"])
def test_fast_flow_feels_the_whole_law(viscosity, law, regularisation):
    """tau = tau_y + K rate^N where mu_max rate is far above tau_y; Cross comes there last, as tau_y / (mu_max rate)."""
    rate = np.geomspace(1e3, 1e5, 20)
    mu = viscosity(law, regularisation, shear(rate))
    expected = TAU_Y + K * rate ** (0.5 if law == "herschel_bulkley" else 1.0)
    np.testing.assert_allclose(mu * rate, expected, rtol=TOLERANCE + TAU_Y / (MU_MAX * rate[0]))


@pytest.mark.parametrize(("regularisation", "order"), [("bi_viscous", None), ("papanastasiou", None), ("cross", 1.0)])
def test_more_viscosity_at_rest_is_closer_to_the_law(viscosity, regularisation, order):
    """At a rate that flows: Cross by 1 / mu_max, the others at once or exponentially."""
    rate = np.array([1.0])
    exact = TAU_Y / rate + K
    error = [
        abs(viscosity("bingham", regularisation, shear(rate), maximum=maximum) - exact)[0] / exact[0]
        for maximum in (1e3, 1e4, 1e5)
    ]
    if order is None:
        assert max(error[1:]) < TOLERANCE
    else:
        slope = np.diff(np.log10(error))
        np.testing.assert_allclose(slope, -order, atol=0.05)


# ------------------------------------------------------------------------------------------------------- invariants


def rate_of(viscosity, gradient: np.ndarray, dimensions: int = 2) -> float:
    """The rate that a law sees, from the viscosity of tau = K rate^2 [1/s]."""
    (mu,) = viscosity("power_law", "bi_viscous", gradient[None], dimensions=dimensions, exponent=2.0, maximum=1e9)
    return mu / K


def test_rate_of_simple_shear(viscosity):
    """|du/dz|, where the thesis's sqrt(D : D) has sqrt(2) |du/dz|."""
    assert rate_of(viscosity, shear(np.array([-3.0]))[0]) == pytest.approx(3.0, rel=TOLERANCE)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_rate_is_root_of_half_the_square(viscosity, dimensions):
    """sqrt(D : D / 2), D = L + L^T, of any flow without divergence."""
    L = np.random.default_rng(2).normal(size=(3, 3))
    if dimensions == 2:
        L[1, :] = L[:, 1] = 0.0
    L -= np.trace(L) / dimensions * np.diag([1.0, dimensions - 2.0, 1.0])
    D = L + L.T
    expected = np.sqrt(np.sum(D * D) / 2.0)
    assert rate_of(viscosity, L, dimensions) == pytest.approx(expected, rel=TOLERANCE)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_rotation_and_sound_are_no_shear(viscosity, dimensions):
    """Nor do they change the rate of a shear that they come with."""
    spin = np.array([[0.0, 0.0, 7.0], [0.0, 0.0, 0.0], [-7.0, 0.0, 0.0]])
    sound = 5.0 * np.diag([1.0, dimensions - 2.0, 1.0])
    assert rate_of(viscosity, spin + sound, dimensions) < 1e-5
    together = shear(np.array([3.0]))[0] + spin + sound
    assert rate_of(viscosity, together, dimensions) == pytest.approx(3.0, rel=TOLERANCE)


def test_each_fluid_has_its_numbers(device):
    launcher = Launcher(device, threads=1)
    rheology = Rheology()
    numbers = {"consistency": [2.0, 0.001], "exponent": [0.5, 1.0], "yield_stress": [50.0, 0.0]}
    for name, values in (numbers | {"viscosity_max": [2000.0, 1.0]}).items():
        setattr(rheology, name, wp.array(values, dtype=float, device=device))
    mu = wp.zeros(2, dtype=float, device=device)
    gradient = wp.array(shear(np.array([4.0, 4.0])), dtype=wp.mat33, device=device)
    inputs = [rheology, wp.array([0, 1], dtype=int, device=device), gradient, 2]
    launcher.record_in_order(apparent_viscosity_kernel("herschel_bulkley", "bi_viscous"), 2, [*inputs, mu])()
    np.testing.assert_allclose(mu.numpy(), [50.0 / 4.0 + 2.0 / 2.0, 0.001], rtol=TOLERANCE)
