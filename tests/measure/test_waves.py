"""What is read off the records of a block and its wave: instants, energies, and how fast the crest went."""

import math

import numpy as np
import pytest

from warpsph.measure.waves import celerity, find_impact, find_wave
from warpsph.theory.analytic import solitary_celerity, solitary_wave

# Records are sampled 100 times a second; relative.
TOLERANCE = 1e-3

WATER = {"depth": 0.2, "gravity": 9.81}
# Corners of bodies that 90 degrees turn so that x is up.
PLATE = np.array([[0.0, -0.3], [0.0, 0.3]])
SPOKE, LONG = (np.array([[-reach, 0.0], [0.1, 0.0]]) for reach in (0.15, 0.25))


def fall(heights) -> dict[str, np.ndarray]:
    """A body that is at `heights` [m] every 0.1 s, going at 3 m/s along and 4 m/s down, with a spin of 2 rad/s.

    It stays turned by 90 degrees.
    """
    z = np.array(heights, float)
    steady = {"u [m/s]": 3.0, "w [m/s]": -4.0, "spin [rad/s]": 2.0, "angle [deg]": 90.0}
    return {"time [s]": 0.1 * np.arange(len(z)), "z [m]": z} | {k: np.full_like(z, v) for k, v in steady.items()}


def test_impact_is_when_the_centre_sinks_through_the_still_level():
    found = find_impact(fall([0.5, 0.4, 0.1, 0.3, 0.0]), PLATE, level=0.2, mass=10.0, inertia=0.5, **WATER)
    assert found.time == pytest.approx(0.1 + 0.1 * 2 / 3)
    assert found.speed == pytest.approx(5.0)
    assert found.froude == pytest.approx(5.0 / math.sqrt(9.81 * 0.2))
    assert found.energy == found.arrival == pytest.approx(0.5 * 10.0 * 25.0 + 0.5 * 0.5 * 4.0)
    assert found.fall == pytest.approx(10.0 * 9.81 * 0.2)


@pytest.mark.parametrize(
    ("corners", "when"), [(PLATE, 0.2), (SPOKE, 0.05), (LONG, 0.0)], ids=["plate", "spoke", "long"]
)
def test_arrival_is_when_the_lowest_point_meets_still_water(corners, when):
    """A plate has no height once it lies, a spoke reaches 0.15 m below the centre, a long one into the water."""
    falling = fall([0.4, 0.3, 0.2, 0.1])
    falling["w [m/s]"] = -10.0 * falling["time [s]"]
    found = find_impact(falling, corners, level=0.2, mass=10.0, inertia=0.0, **WATER)
    assert found.arrival == pytest.approx(5.0 * (9.0 + 100.0 * when**2))
    assert found.energy == pytest.approx(5.0 * (9.0 + 4.0))


@pytest.mark.parametrize("heights", [[0.5, 0.4, 0.3], [0.1, 0.05, 0.0], [0.1, 0.3, 0.1]], ids=["above", "in", "out"])
def test_no_impact(heights):
    assert find_impact(fall(heights), PLATE, level=0.2, mass=10.0, inertia=0.5, **WATER) is None


def passing(x: float, time: np.ndarray) -> np.ndarray:
    """The record at x [m] of a solitary wave 0.04 m high that is at x = 0 when t = 0."""
    c = solitary_celerity(depth=0.2, amplitude=0.04)
    return solitary_wave(x - c * time, depth=0.2, amplitude=0.04)


def test_solitary_wave_is_found_with_its_energy_period_and_celerity():
    """Potential energy of sech^2: rho g a^2 / 2 x 4 / 3 x width; its kinetic energy is about as much."""
    t = np.arange(0.0, 6.0, 0.01)
    near, far = (find_wave(t, passing(x, t), density=1000.0, **WATER) for x in (3.0, 5.0))
    assert near.fit.amplitude == pytest.approx(0.04, rel=TOLERANCE) and near.fit.r2 > 1.0 - TOLERANCE
    c, width = solitary_celerity(depth=0.2, amplitude=0.04), 1.0 / math.sqrt(0.75 * 0.04 / 0.2**3)
    assert celerity(near, far, 2.0) == pytest.approx(c, rel=TOLERANCE)
    potential = 0.5 * 9810.0 * 0.04**2 * 4.0 / 3.0 * width
    assert near.potential == pytest.approx(potential, rel=6e-3)  # its foot, below a tenth, does not count
    assert near.kinetic == pytest.approx(near.potential, rel=0.1)
    assert near.period == pytest.approx(2.0 * math.acosh(math.sqrt(2.0)) * width / c, abs=0.02)


def test_still_water_has_no_wave():
    t = np.arange(0.0, 2.0, 0.01)
    assert find_wave(t, np.zeros_like(t), density=1000.0, **WATER) is None
