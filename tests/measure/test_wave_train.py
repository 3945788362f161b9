"""Trains of waves found in records that are known, and records held against others."""

import math

import numpy as np
import pytest

from warpsph.measure.compare import compared, read_observed
from warpsph.measure.wave_train import find_train, harmonic, phase_speed, reflected, reflected_sea, spectrum
from warpsph.output.records import is_rising
from warpsph.scene.instruments import Observed
from warpsph.theory.waves import elevation, sea, wavelength, wavenumber

TIME = np.arange(0.0, 20.0, 0.01)


def test_a_sine_is_its_own_train():
    train = find_train(TIME, 0.3 + 0.01 * np.cos(2.0 * math.pi * TIME / 0.8 + 0.3))
    assert train.count in (23, 24)
    assert train.height == pytest.approx(0.02, rel=1e-3) and train.period == pytest.approx(0.8, rel=1e-3)
    assert train.significant == pytest.approx(0.02, rel=1e-3)
    assert train.spectral == pytest.approx(0.02 * math.sqrt(2.0), rel=5e-3)
    assert train.peak_period == pytest.approx(0.8, rel=0.05)


def test_ripples_make_no_waves():
    slow = 0.01 * np.cos(2.0 * math.pi * TIME / 2.0) + 1e-4 * np.cos(2.0 * math.pi * TIME / 0.05)
    assert find_train(TIME, slow).period == pytest.approx(2.0, rel=0.01)
    assert find_train(TIME, np.zeros_like(TIME)) is None


def test_integral_of_a_spectrum_is_the_variance():
    level = elevation(1.0, TIME, sea(height=0.05, period=1.0, spectrum="jonswap"), depth=0.4)
    f, density = spectrum(TIME, level)
    assert np.trapezoid(density, f) == pytest.approx(level.var(), rel=0.15)  # a window sees the middle of a record


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5])
def test_celerity_and_reflection_of_regular_waves(share):
    period, depth = 1.0, 0.3
    omega, k = 2.0 * math.pi / period, float(wavenumber(2.0 * math.pi / period, depth=depth))
    x = np.array([2.0, 2.15, 2.4])
    angle = omega * TIME - k * x[:, None]
    records = 0.01 * np.cos(angle) + share * 0.01 * np.cos(omega * TIME + k * x[:, None] + 0.4)
    onward, back = reflected(x, records, TIME, omega, depth, 9.81)
    assert onward == pytest.approx(0.02, rel=1e-6) and back == pytest.approx(share * 0.02, abs=1e-8)
    if not share:
        speed = phase_speed(*(harmonic(TIME, r, omega) for r in records[:2]), 0.15, omega, depth, 9.81)
        assert speed == pytest.approx(wavelength(period, depth=depth) / period, rel=1e-6)


def test_reflection_of_a_sea():
    waves, depth, x = sea(height=0.05, period=1.0, spectrum="jonswap", seed=2), 0.3, np.array([2.0, 2.15, 2.4])
    records = np.array(
        [elevation(at, TIME, waves, depth=depth) + 0.2 * elevation(9.0 - at, TIME, waves, depth=depth) for at in x]
    )
    onward, back = reflected_sea(x, records, TIME, depth, 9.81, 0.6, 2.0)
    assert back / onward == pytest.approx(0.2, rel=0.15)


def test_a_record_against_itself_and_against_a_late_one():
    wave = 0.01 * np.exp(-((TIME - 8.0) ** 2))
    same = compared(TIME, wave, TIME[::5], wave[::5])
    assert same.rms == pytest.approx(0.0, abs=1e-12) and same.skill == pytest.approx(1.0)
    assert same.bias == pytest.approx(0.0, abs=1e-12) and same.lag == 0.0 and same.peak_error == pytest.approx(0.0)
    late = compared(TIME + 0.3, 1.1 * wave + 0.002, TIME[::5], wave[::5])
    assert late.lag == pytest.approx(0.3, abs=0.02) and late.peak_error == pytest.approx(0.3, rel=0.01)
    assert 0.0 < late.skill < 1.0 and late.bias > 0.002
    assert compared(TIME + 100.0, wave, TIME, wave) is None


def test_observed_columns_are_found_and_brought_to_our_units(tmp_path):
    path = tmp_path / "seen.csv"
    path.write_text("# a comment\ntime [ms], g4 [mm],note\n0,1.0,a\n500,2.5,b\n,3.0,c\n1000,4.0,d\n", encoding="utf-8")
    time, value = read_observed(Observed(file=str(path), columns=("time", "g4"), shift=1.0, offset=0.2))
    np.testing.assert_allclose(time, [1.0, 1.5, 2.0])
    np.testing.assert_allclose(value, [0.201, 0.2025, 0.204])
    with pytest.raises(ValueError, match="no column is named 'g5'; it can be time"):
        read_observed(Observed(file=str(path), columns=("time", "g5")))
    with pytest.raises(ValueError, match="no such file"):
        read_observed(Observed(file=str(tmp_path / "none.csv"), columns=("time", "g5")))


@pytest.mark.parametrize(
    ("end", "expected"), [(4.0, True), (5.0, True), (6.0, False), (9.0, False)], ids=lambda value: str(value)
)
def test_a_crest_that_is_yet_to_come_is_told(end, expected):
    time = np.arange(0.0, end, 0.01)
    level = 0.2 + 0.01 * np.exp(-((time - 5.0) ** 2))
    assert is_rising(time, level) is expected
    assert not is_rising(time, np.full_like(time, 0.2))
