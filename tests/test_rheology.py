"""What a scene says of viscosity: the stages of a step, and the laws, numbers and limits of its fluids."""

import numpy as np
import pytest

from warpsph.kernels.viscosity import viscous_courant
from warpsph.rheology import MARGIN, kinematic_viscosities, legendre_stages, needed_stages, step_in_courants, viscous
from warpsph.scene.numerics import MOST_STAGES

# Relative, for double precision.
TOLERANCE = 1e-12

POOL = """
title: Two fluids
spacing: 0.1
smoothing: {kernel: wendland_c2, ratio: 1.5}
materials:
  water: {density: 1000.0, sound_speed: 40.0, dynamic_viscosity: 1.0}
  mud: {density: 2000.0, sound_speed: 50.0, alpha: 0.1}
fluids:
  - {name: pool, material: water, shape: {box: {min: [0, 0], max: [1, 1]}}}
  - {name: bed, material: mud, shape: {box: {min: [0, -1], max: [1, 0]}}}
run: {end_time: 1.0}
"""
BINGHAM = "{law: bingham, consistency: 2.0, yield_stress: 50.0, viscosity_max: 4000.0}"


def super_step(decay: np.ndarray, force: float, dt: float, stages: int) -> np.ndarray:
    """The change of u = 1 in one step of du/dt = force - decay u, as `viscous_stage` makes it."""
    rates, a, before = [], np.zeros_like(decay), np.zeros_like(decay)
    u = np.ones_like(decay)
    for stage in legendre_stages(stages):
        rates.append(-decay * u)
        a, before = (
            stage.before * a + stage.second * before + stage.rate * rates[-1] + stage.first * rates[0],
            a,
        )
        u = 1.0 + dt * (a + stage.elapsed * force)
    return u


@pytest.mark.parametrize("stages", [3, 4, 7, 31, MOST_STAGES])
def test_a_constant_force_is_stepped_exactly(stages):
    found = super_step(np.zeros(1), 3.0, 0.5, stages)
    assert found == pytest.approx(2.5, rel=TOLERANCE)
    assert legendre_stages(stages)[-1].elapsed == pytest.approx(1.0, rel=TOLERANCE)


@pytest.mark.parametrize("stages", [3, 5, 9])
def test_order_two(stages):
    """Halving the step quarters the error at a given time, with a force beside the decay."""
    errors = []
    for count in (20, 40, 80):
        u = np.ones(1)
        for _ in range(count):
            # u, whose step is linear in u and the force: du/dt = 2 - 3 u.
            u = u * super_step(np.array([3.0]), 2.0 / u[0], 1.0 / count, stages)
        errors.append(abs(u[0] - (2 / 3 + np.exp(-3.0) / 3)))
    order = np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])
    assert order == pytest.approx([2.0, 2.0], abs=0.1)


@pytest.mark.parametrize("stages", [3, 5, 9, 31, MOST_STAGES])
def test_stable_up_to_the_limit_and_not_beyond(stages):
    """Every rate of decay up to 2 (s^2 + s - 2) / 4 over dt: Meyer, Balsara & Aslam (2014), eq 15."""
    limit = 2.0 * (stages**2 + stages - 2) / 4.0
    growth = np.abs(super_step(np.linspace(0.0, limit, 2000), 0.0, 1.0, stages))
    assert growth.max() < 1.0 + 1e-9
    assert growth[1000:].max() < 0.9
    assert np.abs(super_step(np.array([1.4 * limit]), 0.0, 1.0, stages)) > 1.0
    assert step_in_courants(stages) == pytest.approx(MARGIN * limit)


@pytest.mark.parametrize(("ratio", "stages"), [(0.1, 1), (1.0, 1), (1.01, 3), (4.5, 3), (4.6, 5), (1e9, MOST_STAGES)])
def test_as_many_stages_as_are_needed(ratio, stages):
    assert needed_stages(ratio) == stages


def test_no_viscosity(make_scene, device):
    assert viscous(make_scene(POOL, "materials.water.dynamic_viscosity=0.0"), device) is None


@pytest.mark.parametrize(
    ("mean", "greatest"), [("arithmetic", 1.0 / 1000.0), ("harmonic", 1.0 / 1000.0)], ids=["arithmetic", "harmonic"]
)
def test_constant_viscosities(make_scene, device, mean, greatest):
    made = make_scene(POOL, f"viscosity.mean={mean}")
    found = viscous(made, device)
    assert found.law is None and found.stages == 1
    assert list(found.rheology.consistency.numpy()) == [1.0, 0.0, 1.0]  # the last is for particles that have left
    assert found.greatest == pytest.approx(greatest)
    assert found.longest_step == pytest.approx(viscous_courant("morris", made.smoothing.kernel) * 0.15**2 / greatest)


@pytest.mark.parametrize(("mean", "greatest"), [("arithmetic", 2000.5 / 1000.0), ("harmonic", 4000.0 / 2000.0)])
def test_fluids_of_two_laws(make_scene, device, mean, greatest):
    """One law that holds both; the greatest viscosity of a pair, which a heavy plug lends to light water."""
    scene = make_scene(POOL, f"materials.mud.rheology={BINGHAM}", f"viscosity.mean={mean}")
    found = viscous(scene, device)
    assert (found.law, found.regularisation) == ("herschel_bulkley", "bi_viscous")
    numbers = found.rheology
    assert list(numbers.consistency.numpy()) == [1.0, 2.0, 1.0] and list(numbers.exponent.numpy()) == [1.0, 1.0, 1.0]
    assert list(numbers.yield_stress.numpy()) == [0.0, 50.0, 0.0]
    assert list(numbers.viscosity_max.numpy()) == [np.inf, 4000.0, np.inf]
    assert found.greatest == pytest.approx(greatest)


def test_stages_by_hand(make_scene, device):
    found = viscous(make_scene(POOL, f"materials.mud.rheology={BINGHAM}", "viscosity.stages=1"), device)
    more = viscous(make_scene(POOL, f"materials.mud.rheology={BINGHAM}", "viscosity.stages=3"), device)
    assert (found.stages, more.stages) == (1, 3)
    assert more.longest_step == pytest.approx(4.5 * found.longest_step)


def test_viscosities_to_print(make_scene):
    """nu = mu / rho, and alpha c h / 8 by the Wendland kernel in the plane."""
    found = kinematic_viscosities(make_scene(POOL))
    assert found["water"] == pytest.approx((1e-3, 0.025 * 40.0 * 0.15 / 8.0), rel=1e-6)
    assert found["mud"] == pytest.approx((0.0, 0.1 * 50.0 * 0.15 / 8.0), rel=1e-6)
