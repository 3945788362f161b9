"""The energy budget of a run, and the motion of each fluid as a whole."""

import numpy as np
import pytest

from warpsph.measure.energy import drift_and_converted
from warpsph.simulation import Simulation

# Share of the energy converted that the budget may lose: what a step of second order leaves.
TOLERANCE = 1e-3


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["artificial_viscosity=monaghan", "xsph=0.0", "tensile_correction=false"],
        ["run.integrator=predictor_corrector"],
        ["density_filter={model: mls, every: 20}", "xsph=0.0"],
        ["run.integrator=runge_kutta", "xsph=0.0"],
    ],
    ids=["as shipped", "monaghan", "predictor_corrector", "filter", "runge_kutta"],
)
def test_budget_is_kept(make_collapse, device, overrides):
    """Through fall, impact and splash, while most of it changes its form; at a step of half the usual length."""
    simulation = Simulation(make_collapse("run.courant=0.25", *overrides), device)
    start, _ = simulation.energy.measure()
    least = start.potential
    for time in np.arange(1, 11) * 0.05:
        simulation.advance(time)
        budget, _ = simulation.energy.measure()
        least = min(least, budget.potential)
        converted = start.potential - least
        assert abs(budget.total - start.total) < TOLERANCE * converted
    assert converted > 0.4 * start.potential
    assert budget.dissipated > 0.2 * converted and budget.kinetic > 0.1 * converted


def test_damping_is_in_the_budget(make_collapse, device):
    """To the first order in damping times step, 1 % here: a step's path is counted before it is damped."""
    simulation = Simulation(make_collapse(), device)
    simulation.state.damping.fill_(20.0)
    start, _ = simulation.energy.measure()
    simulation.advance(0.2)
    budget, _ = simulation.energy.measure()
    assert budget.damped > 5.0 * budget.kinetic
    assert budget.total == pytest.approx(start.total, abs=0.01 * (start.potential - budget.potential))


def test_walls_give_back_what_they_take(make_collapse, device):
    """A wall that stands still has a potential: without XSPH its work is what that loses, and nothing more."""
    simulation = Simulation(make_collapse("xsph=0.0", "run.courant=0.25"), device)
    model, state = simulation.model, simulation.state
    m, c = (a.numpy().astype(float) for a in (model.parameters.mass, model.parameters.sound_speed))

    # phi(q) = K / beta times the integral of W(q) / q from q to 2: the force of Vasco (2014) eq 66 is W / r.
    q = np.linspace(0.1, 2.0, 20_000)
    force = 1.77 / 32 * (1 + 2.5 * q + 2 * q**2) * (2 - q) ** 5 / q
    pieces = 0.5 * (force[1:] + force[:-1]) * np.diff(q)
    work_to_leave = np.append(np.cumsum(pieces[::-1])[::-1], 0.0)

    def potential() -> float:
        fluid, x = state.fluid.numpy(), state.position.numpy()
        r = np.linalg.norm(x[:, None] - model.wall_position.numpy(), axis=2)
        phi = np.interp(r / model.parameters.smoothing_length, q, work_to_leave, right=0.0).sum(axis=1)
        return float(np.sum(m[fluid] * 0.01 / 3.0 * c[fluid] ** 2 * phi))

    start, moved = potential(), 0.0
    for time in (0.05, 0.1, 0.2, 0.3, 0.4):
        simulation.advance(time)
        moved = max(moved, abs(start - potential()))
        assert simulation.energy.measure()[0].wall_work == pytest.approx(start - potential(), abs=TOLERANCE * moved)
    assert moved > 1.0  # [J/m]


def test_parts_add_up_to_the_total(make_collapse, device):
    simulation = Simulation(make_collapse(), device)
    simulation.advance(0.05)
    budget, _ = simulation.energy.measure()
    kinetic, potential, internal, dissipated, wall_work, damped, gone = budget.parts()
    assert budget.total == kinetic + potential + internal + dissipated + damped + gone - wall_work


def test_motion_of_each_fluid(make_collapse, device):
    simulation = Simulation(make_collapse(), device)
    simulation.advance(0.15)
    snapshot, (_, motions) = simulation.state.snapshot(), simulation.energy.measure()
    assert len(motions) == 2
    for index, (motion, density) in enumerate(zip(motions, (1000.0, 1200.0), strict=True)):
        mine = snapshot.fluid == index
        assert motion.mass == pytest.approx(density * 0.02**2 * mine.sum(), rel=1e-6)
        np.testing.assert_allclose(motion.center, snapshot.position[mine].mean(axis=0), rtol=0, atol=1e-12)
        np.testing.assert_allclose(motion.velocity, snapshot.velocity[mine].mean(axis=0, dtype=float), atol=1e-9)
        assert motion.front == snapshot.position[mine, 0].max()
        fastest = np.linalg.norm(snapshot.velocity[mine], axis=1).max()
        assert motion.top_speed == pytest.approx(fastest, rel=1e-6)


def test_drift_is_a_share_of_what_is_converted_wherever_heights_count_from():
    """10 N fall by 1 m, and 0.5 J of 10 J are lost; then water that a paddle drives; then water at rest."""
    time = np.linspace(0.0, 1.0, 11)
    for datum in (0.0, 1e6, -1e6):
        total = {"total [J]": 10.0 * datum - 0.5 * time}
        fallen = total | {"kinetic [J]": 10.0 * time, "potential [J]": 10.0 * (datum - time)}
        assert drift_and_converted(fallen, at_stake=10.0) == pytest.approx((0.5, 10.0), rel=1e-6)
        driven = fallen | {"kinetic [J]": 80.0 * time}
        assert drift_and_converted(driven, at_stake=10.0) == pytest.approx((0.5, 80.0), rel=1e-6)
        rest = total | {"kinetic [J]": 1e-6 * time, "potential [J]": 10.0 * datum - 1e-4 * time}
        assert drift_and_converted(rest, at_stake=10.0)[1] == 0.0
    assert drift_and_converted({name: time[:0] for name in rest}, at_stake=10.0) == (0.0, 0.0)
