"""A simulation as a whole: its phases, what it says when a particle becomes absurd, and every choice of formulas."""

import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from scenes import drop, scene
from warpsph.device.launch import DeviceError, Launcher
from warpsph.forecast import forecast
from warpsph.kernels.artificial_viscosity import ARTIFICIAL_VISCOSITY
from warpsph.kernels.density import DENSITY_DIFFUSION
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.placement.place import place
from warpsph.simulation import BlowUpError, Simulation

# Relative; what is read back is in single precision.
TOLERANCE = 1e-6

DROP = scene("A drop without walls", 0.05, [], [drop(0.3, hydrostatic=False)], sound_speed=40.0)


# ---------------------------------------------------------------------------------------------------------- phases


@pytest.fixture
def warming(make_release, device) -> Simulation:
    """At the start of its warm-up."""
    return Simulation(make_release(), device)


def test_phases(warming):
    assert warming.time == -0.1
    assert warming.phase_changes() == pytest.approx([-0.06, 0.0])
    damping = []
    for time in (*warming.phase_changes(), 0.02):
        damping.append((warming.step.settling, float(warming.state.damping.numpy()[0])))
        warming.advance(time)
        warming.enter_phase()
    assert damping == [(True, 50.0), (False, 50.0), (False, 0.0)]


def test_phases_on_the_way_are_entered(make_release, device, bits):
    """The same bits as by hand, whether one stops at the changes or not."""
    by_hand = Simulation(make_release(), device)
    for time in (*by_hand.phase_changes(), 0.02):
        by_hand.advance(time)
        by_hand.enter_phase()
    for stops in ([], by_hand.phase_changes()):
        simulation = Simulation(make_release(), device)
        for time in (*stops, 0.02):
            simulation.reach(time)
        assert bits(simulation) == bits(by_hand)
    simulation = Simulation(make_release(), device)
    simulation.reach(-0.03)
    assert simulation.time == -0.03 and not simulation.step.settling and simulation.state.damping.numpy()[0] == 50.0


def test_no_warm_up_begins_at_the_release(make_collapse, device):
    simulation = Simulation(make_collapse(), device)
    assert simulation.time == 0.0 and simulation.phase_changes() == []
    assert not simulation.step.settling and not simulation.state.damping.numpy()[0]


def test_held_fluid_waits_for_its_release(warming):
    """While the pool below it settles; then it falls with g."""
    start = warming.state.snapshot()
    held = start.fluid == 1
    warming.reach(0.0)
    released = warming.state.snapshot()
    np.testing.assert_array_equal(released.position[held], start.position[held])
    assert not released.velocity[held].any()
    assert np.abs(released.position[~held] - start.position[~held]).max() > 1e-5
    warming.advance(0.05)
    _, (_, block) = warming.energy.measure()
    # Nothing but gravity moves its centre: inner forces cancel, to single precision.
    assert block.velocity[2] == pytest.approx(-9.81 * 0.05, rel=1e-5)
    assert block.center[2] == pytest.approx(0.33 - 9.81 * 0.05**2 / 2, rel=1e-5)


def test_fill_keeps_the_density_of_rest_while_it_settles(warming):
    """The pair loops read p = rho g depth as the particles find their places; thereafter p follows from continuity."""

    def stray() -> float:
        """Farthest from the pressure of rest that a particle of the pool is [Pa]."""
        pool = warming.state.fluid.numpy() == 0
        depth = 0.2 - warming.state.position.numpy()[pool, 2]
        return np.abs(warming.state.velocity_pressure.numpy()[pool, 3] - 1000.0 * 9.81 * depth).max()

    # At 0.5 m/s a particle moves 0.1 mm within the step, whose pressure is that of its beginning.
    a_step_away = 1000.0 * 9.81 * 0.2e-3
    warming.advance(-0.09)
    assert stray() < a_step_away
    assert np.abs(warming.state.snapshot().position - place(warming.scene).position).max() > 1e-4
    warming.advance(-0.06)
    assert stray() < a_step_away
    warming.enter_phase()
    warming.advance(-0.05)
    assert stray() > 10 * a_step_away


def test_energy_budget_begins_at_the_release(warming):
    warming.advance(-0.06)
    warming.enter_phase()
    warming.advance(0.0)
    assert warming.energy.measure()[0].damped > 0.0
    warming.enter_phase()
    budget, _ = warming.energy.measure()
    assert (budget.dissipated, budget.wall_work, budget.damped) == (0.0, 0.0, 0.0)
    warming.advance(0.02)
    assert warming.energy.measure()[0].damped == 0.0


# -------------------------------------------------------------------------------------------------- what is read back


def test_snapshot_is_in_the_order_of_ids(make_collapse, device):
    simulation = Simulation(make_collapse(), device)
    simulation.advance(0.1)
    state, snapshot = simulation.state, simulation.state.snapshot()
    assert np.any(state.id.numpy() != np.arange(300)), "no particle has changed its slot"
    np.testing.assert_array_equal(snapshot.id, np.arange(300))
    np.testing.assert_array_equal(snapshot.fluid, place(simulation.scene).fluid)
    for name in ("position", "velocity", "density"):
        np.testing.assert_array_equal(getattr(snapshot, name)[state.id.numpy()], getattr(state, name).numpy())
    assert (snapshot.time, snapshot.step) == (0.1, simulation.step_count)


def test_pressure_on_the_host_is_that_of_the_kernels(make_collapse, device):
    simulation = Simulation(make_collapse(), device)
    simulation.advance(0.1)
    simulation.step.stages["drift, pressure"]()  # over no time: the target is reached
    of_kernels = simulation.state.velocity_pressure.numpy()[:, 3]
    snapshot = simulation.state.snapshot()
    scale = np.abs(of_kernels).max()
    np.testing.assert_allclose(
        snapshot.pressure[simulation.state.id.numpy()], of_kernels, rtol=0, atol=TOLERANCE * scale
    )


def test_no_such_device(make_collapse):
    with pytest.raises(DeviceError, match="no device named 'cuda:99'"):
        Simulation(make_collapse(), "cuda:99")


# -------------------------------------------------------------------------------------------------------- absurdity


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("velocity", [0.0, 0.0, 40.0], "it moves faster than sound in its material"),
        ("density", 400.0, "its density fell below 0.5 of its material's"),
    ],
)
def test_absurd_particle_is_named(make_collapse, device, name, value, words):
    simulation = Simulation(make_collapse(), device)
    simulation.advance(0.01)
    slot = 123
    array = getattr(simulation.state, name)
    values = array.numpy()
    values[slot] = value
    array.assign(values)
    particle = int(simulation.state.id.numpy()[slot])
    with pytest.raises(BlowUpError) as caught:
        simulation.advance(0.1)
    fluid = ("water", "brine")[place(simulation.scene).fluid[particle]]
    message = str(caught.value)
    assert message.startswith(f"particle {particle} of '{fluid}' at t = {simulation.time:.5f} s (step ")
    assert f": {words}; x = " in message
    assert simulation.time < 0.011, "the clock went on"


def test_not_a_number_is_found_at_once(make_collapse, device):
    """It spreads to the neighbours in the very step, so that any of them may be the one that is named."""
    simulation = Simulation(make_collapse(), device)
    velocity = simulation.state.velocity.numpy()
    velocity[123] = np.nan
    simulation.state.velocity.assign(velocity)
    with pytest.raises(BlowUpError, match="position, velocity or density is not a finite number; x = "):
        simulation.advance(0.1)
    assert simulation.step_count == 1


def test_sound_that_is_too_slow_blows_up(make_collapse, device):
    """And the message tells who, when, what, where, how fast and how dense."""
    simulation = Simulation(
        make_collapse("materials.water.sound_speed=1.0", "materials.brine.sound_speed=1.0", "allow=[low_sound_speed]"),
        device,
    )
    with pytest.raises(BlowUpError) as caught:
        simulation.advance(1.0)
    number = r"-?[\d.e+-]+"
    assert re.fullmatch(
        rf"particle \d+ of '(water|brine)' at t = [\d.]+ s \(step \d+\): (its|it) [a-z0-9 .']+; "
        rf"x = {number} m, z = {number} m, u = {number} m/s, w = {number} m/s, density {number} kg/m3",
        str(caught.value),
    )
    assert 0.0 < simulation.time < 1.0


def test_without_walls_there_is_nothing_to_leave(make_scene, device):
    """A drop falls through five of its own radii, far out of where it began."""
    simulation = Simulation(make_scene(DROP), device)
    simulation.advance(0.55)
    _, (drop,) = simulation.energy.measure()
    assert drop.center[2] == pytest.approx(-9.81 * 0.55**2 / 2, rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_bounded_tensile_correction_gives_a_drop_no_energy(make_scene, device, seed):
    """Six particles within half a spacing, none at rest: what a splash throws, alone. Viscosity takes four fifths of
    their energy before the first look; unbounded, the correction stirs them up, some of such drops to a hundredfold."""
    text = DROP.replace("disc: {center: [0.0, 0.0], radius: 0.3}", "box: {min: [0.0, 0.0], max: [0.15, 0.1]}")
    scene = make_scene(text, "tensile_correction=bounded", "xsph=0", "gravity=0")
    placed, random = place(scene), np.random.default_rng(seed)
    x, u = random.normal(size=(2, 6, 3)) * [1, 0, 1]
    x, u = (a - a.mean(axis=0) for a in (x, u))
    x *= 0.5 * scene.spacing / np.linalg.norm(x, axis=1).mean()
    simulation = Simulation(
        scene, device, placement=replace(placed, position=placed.position.mean(axis=0) + x, velocity=u)
    )
    start, _ = simulation.energy.measure()
    for time in np.arange(1, 11) * 0.1:
        simulation.advance(time)
        now, _ = simulation.energy.measure()
        assert now.kinetic + now.internal < 0.5 * start.kinetic


# -------------------------------------------------------------------------------------------------- every formula


@pytest.mark.parametrize(
    ("smoothing", "viscosity", "diffusion", "tensile"),
    [
        *product(SMOOTHING, ["signal"], ["fourtakas"], ["true"]),
        *product(["wendland_c2"], ARTIFICIAL_VISCOSITY, ["fourtakas"], ["false"]),
        *product(["wendland_c2"], ["signal"], DENSITY_DIFFUSION, ["true"]),
        ("wendland_c2", "signal", "fourtakas", "bounded"),
    ],
)
def test_every_formula_runs(make_collapse, device, smoothing, viscosity, diffusion, tensile):
    """A tenth of a second of a collapse; its front runs, and not faster than the 2 sqrt(g H) of a dam break."""
    scene = make_collapse(
        f"smoothing.kernel={smoothing}",
        f"artificial_viscosity={viscosity}",
        f"density_diffusion.model={diffusion}",
        f"tensile_correction={tensile}",
    )
    simulation = Simulation(scene, device)
    simulation.advance(0.1)
    _, (_, brine) = simulation.energy.measure()
    assert 0.31 < brine.front < 0.3 + 2.0 * np.sqrt(9.81 * 0.4) * 0.1


# --------------------------------------------------------------------------------------------------------- forecast


def test_forecast_is_what_comes(make_release, device):
    scene = make_release()
    expected, simulation = forecast(scene, Launcher(device)), Simulation(scene, device)
    assert expected.particle_count == simulation.model.particle_count == sum(expected.counts.values())
    assert expected.counts == {"pool": 200, "block": 12}
    assert expected.wall_count == simulation.start.wall_count
    assert expected.first_dt == pytest.approx(0.5 * 0.03 / 30.0)
    ends = {*simulation.phase_changes(), *(0.01 * np.arange(-9, 101)).round(9), 1.0}  # of samples, too
    for end in sorted(ends):
        simulation.reach(end)
    # The block splashes: more steps, and more lists, than a pool at rest would take.
    assert expected.steps == pytest.approx(simulation.step_count, rel=0.1)
    assert expected.step_seconds > 0.0


def test_forecast_without_a_rehearsal(make_release, device):
    """A block of one spacing is none of two: what cannot be rehearsed is told by its first steps."""
    scene = make_release("fluids[1].shape.box={min: [0.19, 0.31], max: [0.21, 0.33]}", "run.end_time=0.1")
    expected = forecast(scene, Launcher(device))
    assert expected.counts["block"] == 1
    assert expected.steps >= 0.2 / expected.first_dt
