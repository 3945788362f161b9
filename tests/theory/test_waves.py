"""Wave theory: dispersion, transfer of paddles, spectra, solitary and focused waves, reflection by gauges."""

import math

import numpy as np
import pytest

from warpsph.theory.waves import (
    bound_harmonic,
    components_paddle,
    elevation,
    focused,
    group_celerity,
    jonswap,
    madsen_stroke,
    miche_height,
    paddle_ratio,
    pierson_moskowitz,
    rayleigh_wave,
    reflection,
    sea,
    solitary_paddle,
    solitary_stroke,
    wavelength,
    wavenumber,
)

G = 9.81
# kd, H / S, w sqrt(d / g): Dean & Dalrymple (1991) eq 6.25 and the dispersion relation, in six digits.
PISTON = [(0.2, 0.199993, 0.198683), (1.0, 0.981789, 0.872694), (2.5, 1.84866, 1.57052), (4.0, 1.98799, 1.99933)]


@pytest.mark.parametrize(("kd", "ratio", "omega"), PISTON)
def test_dispersion_and_piston(kd, ratio, omega):
    assert float(wavenumber(omega, depth=1.0, gravity=1.0)) == pytest.approx(kd, rel=1e-5)
    assert float(paddle_ratio(kd / 0.3, depth=0.3)) == pytest.approx(ratio, rel=1e-5)


@pytest.mark.parametrize("kd", [0.3, 1.0, 3.0])
def test_flap_on_the_bed_and_far_below(kd):
    """Dean & Dalrymple (1991) eq 6.26; a hinge far below makes a piston of a flap."""
    flap = 4.0 * math.sinh(kd) / kd * (kd * math.sinh(kd) - math.cosh(kd) + 1.0) / (math.sinh(2 * kd) + 2 * kd)
    assert float(paddle_ratio(kd, depth=1.0, hinge=0.0)) == pytest.approx(flap, rel=1e-9)
    assert float(paddle_ratio(kd, depth=1.0, hinge=-1e6)) == pytest.approx(float(paddle_ratio(kd, depth=1.0)), rel=1e-5)


def test_hinge_above_the_bed_by_quadrature():
    k, depth, hinge = 2.0, 1.0, 0.4
    z = np.linspace(hinge, depth, 20001)
    integral = np.trapezoid((z - hinge) / (depth - hinge) * np.cosh(k * z), z)
    expected = 4.0 * k * math.sinh(k * depth) * integral / (math.sinh(2 * k * depth) + 2 * k * depth)
    assert float(paddle_ratio(k, depth=depth, hinge=hinge)) == pytest.approx(expected, rel=1e-7)


def test_speeds_of_long_and_of_short_waves():
    assert group_celerity(100.0, depth=0.2) == pytest.approx(math.sqrt(G * 0.2), rel=1e-3)
    assert group_celerity(0.2, depth=10.0) == pytest.approx(0.5 * wavelength(0.2, depth=10.0) / 0.2, rel=1e-6)
    assert miche_height(0.2, depth=10.0) == pytest.approx(0.142 * wavelength(0.2, depth=10.0))


def test_second_order_piston_moves_with_long_waves():
    """In shallow water a piston follows the water: its second harmonic is that of c eta / (d + eta) along it.

    xi' (d + eta) = c eta at the piston itself, to the second order in a, with the bound harmonic of Stokes.
    """
    depth, k, a = 1.0, 0.05, 1e-5
    t = np.linspace(0.0, 2.0 * math.pi, 4001)
    second = bound_harmonic(2.0 * a, k, depth=depth)
    way = a / k * np.sin(t) + madsen_stroke(2.0 * a, k, depth=depth) * np.sin(2.0 * t)
    eta = a * np.cos(t - k * way) + second * np.cos(2.0 * t)
    speed = np.gradient(way, t)
    residual = speed * (depth + eta) - eta / k
    assert abs(np.trapezoid(residual * np.cos(2.0 * t), t)) < 0.01 * second / k


@pytest.mark.parametrize("density", [jonswap, pierson_moskowitz])
def test_spectra_hold_their_energy(density):
    f = np.linspace(0.05, 20.0, 200000)
    values = density(f, height=0.1, period=1.5)
    assert 4.0 * math.sqrt(np.trapezoid(values, f)) == pytest.approx(0.1, rel=2e-3)
    assert f[values.argmax()] == pytest.approx(1.0 / 1.5, rel=1e-3)


def test_sea_is_the_same_by_its_seed_and_has_its_height():
    one, same, other = (sea(height=0.1, period=1.0, spectrum="jonswap", seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.phase, same.phase)
    assert np.any(one.phase != other.phase)
    record = elevation(2.0, np.linspace(0.0, 400.0, 40001), one, depth=0.5)
    assert 4.0 * record.std() == pytest.approx(0.1, rel=0.03)


def test_crests_meet_where_they_should():
    waves = focused(crest=0.05, period=1.0, place=4.0, time=12.0, depth=0.5, spectrum="jonswap")
    times = np.linspace(8.0, 16.0, 1601)
    record = elevation(4.0, times, waves, depth=0.5)
    assert record.max() == pytest.approx(0.05, rel=1e-6) and times[record.argmax()] == pytest.approx(12.0, abs=0.01)
    assert np.abs(elevation(0.0, times, waves, depth=0.5)).max() < 0.04


def test_paddle_of_one_component_is_the_regular_one():
    waves = sea(height=0.1, period=1.0, spectrum="jonswap", count=8)
    t = np.linspace(0.0, 3.0, 50)
    k = wavenumber(waves.omega, depth=0.4)
    expected = sum(
        a / paddle_ratio(kk, depth=0.4) * np.sin(w * t + p)
        for a, w, p, kk in zip(waves.amplitude, waves.omega, waves.phase, k, strict=True)
    )
    np.testing.assert_allclose(components_paddle(t, waves, depth=0.4), expected, atol=1e-12)


def test_solitary_piston_goes_with_the_water():
    """dx/dt = c eta / (d + eta), with eta that of the wave where the piston is (Goring 1978)."""
    height, depth = 0.06, 0.2
    t, way = solitary_paddle(height=height, depth=depth, count=4000)
    c = math.sqrt(G * (height + depth))
    middle = np.interp(0.5 * way[-1], way, t)
    eta = rayleigh_wave(way - 0.5 * way[-1] - c * (t - middle), height=height, depth=depth)
    np.testing.assert_allclose(np.gradient(way, t), c * eta / (depth + eta), atol=2e-3 * c * height / depth)
    assert way[-1] == pytest.approx(solitary_stroke(height, depth=depth), rel=2e-3)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_three_gauges_tell_there_from_back(noise):
    x, k = np.array([2.0, 2.17, 2.41]), 5.0
    record = 0.02 * np.exp(-1j * k * x) + 0.004 * np.exp(1j * (k * x + 0.7))
    record = record + noise * 0.02 * np.random.default_rng(1).normal(size=3)
    onward, back = reflection(x, record, k)
    assert onward == pytest.approx(0.02, rel=1e-9 + 3 * noise) and back == pytest.approx(0.004, rel=1e-9 + 10 * noise)
