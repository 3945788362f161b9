"""Viscosity in a scene: what it conserves, the energy that it takes, its order in time, its limit, flows of it."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from warpsph.placement.place import place
from warpsph.scene.source import SceneError
from warpsph.schemes.weakly_compressible import WeaklyCompressible
from warpsph.simulation import Simulation
from warpsph.step.step import Step
from warpsph.theory.analytic import couette, periodic_shear, poiseuille

# Relative, for sums over steps and particles in single precision.
TOLERANCE = 2e-5

DROP = """
title: A viscous drop
spacing: 0.05
gravity: 0.0
materials: {oil: {density: 1000.0, sound_speed: 20.0, alpha: 0.0, dynamic_viscosity: 100.0}}
tensile_correction: false
density_diffusion: {model: none}
xsph: 0.0
fluids: [{name: drop, material: oil, hydrostatic: false, shape: {disc: {center: [0, 0], radius: 0.4}}}]
run: {end_time: 1.0}
"""
BINGHAM = [
    "materials.oil.dynamic_viscosity=",
    "materials.oil.rheology={law: bingham, consistency: 20.0, yield_stress: 100.0, viscosity_max: 4000.0, "
    "regularisation: papanastasiou}",
]
every_form = pytest.mark.parametrize("form", ["morris", "cleary", "stress"])
BALANCED = "viscosity.weights=balanced"


def stretched(scene, device, shear: float = 0.0) -> Simulation:
    """The drop in stagnation flow and, if told so, turning."""
    placement = place(scene)
    x, _, z = placement.position.T
    velocity = np.stack([4.0 * x + shear * z, np.zeros_like(x), -4.0 * z - shear * x], axis=1)
    return Simulation(scene, device, placement=replace(placement, velocity=velocity))


def test_off_is_off(make_collapse, device):
    step = Simulation(make_collapse(), device).step
    assert not any("viscosity" in stage for stage in step.stages)


@pytest.mark.parametrize(
    ("form", "overrides"),
    [
        *product(("morris", "cleary", "stress"), ([], ["viscosity.stages=5"], BINGHAM)),
        *product(("morris", "stress"), ([BALANCED], [BALANCED, "viscosity.stages=5"])),
    ],
)
def test_momentum_and_energy_are_accounted_for(make_scene, device, form, overrides):
    """Nothing is lost or gained but what is dissipated; along the line between the turning stays too."""
    scene = make_scene(DROP, f"viscosity.form={form}", *overrides)
    simulation = stretched(scene, device, shear=3.0)
    m = simulation.model.parameters.mass.numpy()[0].astype(float)

    def moments() -> tuple[np.ndarray, float]:
        drop = simulation.state.snapshot()
        u = drop.velocity.astype(float)
        return m * u.sum(axis=0), m * np.cross(drop.position, u)[:, 1].sum()

    before, turning = moments()
    speed = np.abs(simulation.state.snapshot().velocity.astype(float)).sum()
    start = simulation.energy.measure()[0]
    simulation.advance(0.05)
    after, still_turning = moments()
    end = simulation.energy.measure()[0]
    scale = m * speed
    np.testing.assert_allclose(after, before, rtol=0, atol=TOLERANCE * scale)
    if form == "cleary":
        assert still_turning == pytest.approx(turning, abs=TOLERANCE * scale)
    assert end.dissipated > 0.05 * start.kinetic
    assert end.total == pytest.approx(start.total, abs=TOLERANCE * start.kinetic)


@pytest.mark.parametrize(
    "overrides",
    [["viscosity.stages=1"], ["viscosity.stages=3"], ["viscosity.stages=7", "viscosity.form=cleary"], BINGHAM],
    ids=["explicit", "3 stages", "7 stages", "bingham"],
)
def test_order_two(make_scene, device, overrides):
    """A drop that is stretched: halving the step quarters the error against steps 8 times finer still."""

    def at_the_end(courant: float) -> tuple[np.ndarray, np.ndarray]:
        simulation = stretched(make_scene(DROP, *overrides, f"run.courant={courant}"), device)
        simulation.advance(0.03)
        drop = simulation.state.snapshot()
        return drop.position, drop.velocity

    courant = np.array([0.4, 0.2, 0.1])
    exact = at_the_end(courant[-1] / 8)
    errors = [[np.sqrt(np.mean((a - b) ** 2)) for a, b in zip(at_the_end(C), exact, strict=True)] for C in courant]
    slopes = np.polyfit(np.log2(courant), np.log2(errors), 1)[0]
    assert slopes == pytest.approx([2.0, 2.0], abs=0.25)


@every_form
@pytest.mark.parametrize("stages", [1, 3, 9])
def test_stable_at_the_limit(make_scene, device, form, stages):
    """Fifty steps of the longest length by viscosity, so viscous that it alone limits them, from random velocities."""
    scene = make_scene(
        DROP, f"viscosity.form={form}", f"viscosity.stages={stages}", "materials.oil.dynamic_viscosity=1.0e6"
    )
    placement = place(scene)
    noise = np.random.default_rng(2).normal(size=placement.position.shape) * [0.1, 0.0, 0.1]
    simulation = Simulation(scene, device, placement=replace(placement, velocity=noise))
    longest = simulation.model.viscous.longest_step
    assert longest < 0.5 * WeaklyCompressible.longest_step(scene, None)
    before = simulation.energy.measure()[0].kinetic
    simulation.advance(50 * longest)
    assert simulation.step_count in (50, 51)
    assert simulation.energy.measure()[0].kinetic < 0.5 * before


def test_stages_agree_with_single_sweeps(make_scene, device):
    """Nine stages against the dozens of single sweeps that they stand for."""
    ends = []
    for stages in (1, 9):
        simulation = stretched(make_scene(DROP, f"viscosity.stages={stages}", *BINGHAM), device)
        simulation.advance(0.02)
        ends.append((simulation.state.snapshot().velocity, simulation.step_count))
    (single, many), (by_stages, few) = ends
    assert many > 8 * few
    assert np.abs(by_stages - single).max() < 0.01 * np.abs(single).max()


def test_a_run_without_end_is_refused(make_scene, device):
    scene = make_scene(DROP, "viscosity.stages=1", "materials.oil.dynamic_viscosity=1.0e12")
    with pytest.raises(SceneError, match=r"run.end_time: needs 1\.4e\+12 steps of 7\.0e-13 s, more than 1e\+08"):
        Simulation(scene, device)
    Simulation(
        make_scene(DROP, "viscosity.stages=1", "materials.oil.dynamic_viscosity=1.0e12", "run.max_steps=5"), device
    )


def test_fields_of_a_snapshot(make_scene, device):
    """In id order, before the first step and later; none without a rheology."""
    assert stretched(make_scene(DROP), device).state.snapshot().apparent_viscosity is None
    simulation = stretched(make_scene(DROP, *BINGHAM), device)
    # Rate of shear 8 1/s everywhere: mu = K + (mu_max - K) relaxed; tau = tau_y + K rate, nearly.
    for time in (0.0, 0.001):
        simulation.advance(time)
        drop = simulation.state.snapshot()
        np.testing.assert_allclose(drop.apparent_viscosity, 20.0 + 100.0 / 8.0, rtol=0.1)
        assert drop.yielded.all()
    assert (make_resting(make_scene, device).yielded == 0).all()


def make_resting(make_scene, device):
    """A drop of the same fluid at rest."""
    simulation = Simulation(make_scene(DROP, *BINGHAM), device)
    simulation.advance(0.002)
    return simulation.state.snapshot()


SLIDING = """
title: A mud slides past a wall
spacing: 0.05
gravity: 0.0
body_force: [20.0, 0.0]
materials:
  mud:
    density: 1000.0
    sound_speed: 20.0
    alpha: 0.0
    rheology: {law: bingham, consistency: 20.0, yield_stress: 3000.0, viscosity_max: 2000.0}
fluids: [{name: mud, material: mud, jitter: 0.2, shape: {box: {min: [0, 0], max: [0.5, 0.5]}}}]
images:
  - {name: bed, mirror: {point: [0, 0], normal: [0, 1], velocity_rule: no_slip_opposite}}
  - {name: along, periodic: {start: [0, 0], end: [0.5, 0]}}
run: {end_time: 1.0}
"""


@pytest.mark.parametrize("integrator", ["verlet", "runge_kutta"])
def test_what_is_shown_is_of_the_same_time_as_the_velocity(make_scene, device, integrator):
    """As it is found for a new simulation of the same particles and velocities, among images too."""
    scene = make_scene(SLIDING, f"run.integrator={integrator}")
    simulation = Simulation(scene, device)
    simulation.advance(0.1)
    found = simulation.state.snapshot()
    again = Simulation(scene, device, placement=replace(place(scene), position=found.position, velocity=found.velocity))
    again.state.density.assign(found.density[again.state.id.numpy()])
    again.step._pack()
    again.step.find_viscosity()
    other = again.state.snapshot()
    assert 0.1 < found.yielded.mean() < 0.9
    np.testing.assert_allclose(found.apparent_viscosity, other.apparent_viscosity, rtol=1e-3)
    assert np.mean(found.yielded == other.yielded) > 0.99


def test_what_is_shown_leaves_no_trace(make_scene, device, bits, monkeypatch):
    runs = []
    for looks in (True, False):
        if not looks:
            monkeypatch.setattr(Step, "find_viscosity", lambda step: None)
        simulation = Simulation(make_scene(SLIDING), device)
        for time in (0.01, 0.02, 0.05):
            simulation.advance(time)
        runs.append(bits(simulation))
    assert runs[0] == runs[1]


# ------------------------------------------------------------------------------------------------------- with images

CHANNEL = """
title: A channel
spacing: 0.03125
gravity: 0.0
materials: {oil: {density: 1000.0, sound_speed: 10.0, alpha: 0.0, dynamic_viscosity: 500.0}}
tensile_correction: false
xsph: 0.0
fluids: [{name: oil, material: oil, hydrostatic: false, shape: {box: {min: [0, 0], max: [0.5, 1.0]}}}]
images:
  - {name: along, periodic: {start: [0, 0], end: [0.5, 0]}}
run: {end_time: 100.0}
"""
UP = "{name: up, periodic: {start: [0, 0], end: [0, 1.0]}}"
ALONG = "{name: along, periodic: {start: [0, 0], end: [0.5, 0]}}"


def wall(name: str, z: float, up: int, speed: float = 0.0) -> str:
    moving = f", velocity: [{speed}, 0.0]" if speed else ""
    return f"{{name: {name}, mirror: {{point: [0, {z}], normal: [0, {up}], velocity_rule: no_slip_opposite{moving}}}}}"


@pytest.mark.parametrize(
    ("overrides", "error"),
    [
        ([], 0.007),
        (["materials.oil.dynamic_viscosity=1000.0"], 0.008),
        (["viscosity.form=stress"], 0.007),
        (["spacing=0.015625", "viscosity.form=stress"], 0.002),
        (["viscosity.form=cleary", "smoothing.ratio=2.5"], 0.03),
    ],
    ids=["explicit", "stages", "stress", "finer", "cleary"],
)
def test_shear_wave_decays(make_scene, device, overrides, error):
    """u = exp(-nu k^2 t) sin k z in a periodic box, at 32 particles a wave and at 64; what is left is smoothed."""
    scene = make_scene(CHANNEL, f"images=[{ALONG}, {UP}]", *overrides)
    placement = place(scene)
    k = 2.0 * np.pi
    u = np.sin(k * placement.position[:, 2:]) * [1.0, 0.0, 0.0]
    simulation = Simulation(scene, device, placement=replace(placement, velocity=u))
    nu = scene.materials["oil"].dynamic_viscosity / 1000.0
    end = 1.0 / (nu * k**2)
    simulation.advance(end)
    found = simulation.state.snapshot()
    amplitude = 2.0 * np.mean(np.sin(k * found.position[:, 2]) * found.velocity[:, 0])
    assert -np.log(amplitude) == pytest.approx(1.0, rel=error)


@every_form
@pytest.mark.parametrize("flow", ["couette", "poiseuille"])
def test_flow_between_walls(make_scene, device, form, flow):
    """Profiles on their way to the steady state, root mean square over the largest, at 32 particles across: 0.5 %.

    `cleary` is 3 % off, though on a wider kernel: its sum over a lattice depends on the direction.
    """
    lid = wall("lid", 1.0, -1, 0.1 if flow == "couette" else 0.0)
    force = [] if flow == "couette" else ["body_force=[0.5, 0.0]"]
    wider = ["smoothing.ratio=2.5"] if form == "cleary" else []
    images = f"images=[{ALONG}, {wall('bed', 0.0, 1)}, {lid}]"
    scene = make_scene(CHANNEL, images, f"viscosity.form={form}", *force, *wider)
    simulation = Simulation(scene, device)
    for time in (0.2, 0.5):
        simulation.advance(time)
        found = simulation.state.snapshot()
        z = found.position[:, 2]
        if flow == "couette":
            exact = couette(z, time, height=1.0, speed=0.1, viscosity=0.5)
        else:
            exact = poiseuille(z, time, height=1.0, acceleration=0.5, viscosity=0.5)
        assert (
            np.sqrt(np.mean((found.velocity[:, 0] - exact) ** 2)) < (0.03 if form == "cleary" else 0.005) * exact.max()
        )


@pytest.mark.parametrize("form", ["morris", "stress"])
def test_balanced_weights_do_without_order(make_scene, device, form):
    """Couette flow, particles 0.1 dx off their lattice: nearly the error of the lattice, of which plain weights make 3
    times as much; and still less than theirs when particles have gone past each other and been sorted anew."""
    images = f"images=[{ALONG}, {wall('bed', 0.0, 1)}, {wall('lid', 1.0, -1, 0.5)}]"
    starts = {"lattice": [], "plain": ["fluids[0].jitter=0.1"], "balanced": ["fluids[0].jitter=0.1", BALANCED]}
    errors = {}
    for name, start in starts.items():
        simulation = Simulation(make_scene(CHANNEL, images, f"viscosity.form={form}", *start), device)
        for time in (0.1, 0.5):
            simulation.advance(time)
            found = simulation.state.snapshot()
            exact = couette(found.position[:, 2], time, height=1.0, speed=0.5, viscosity=0.5)
            errors[name, time] = np.sqrt(np.mean((found.velocity[:, 0] - exact) ** 2)) / exact.max()
    assert np.any(simulation.state.id.numpy() != np.arange(512)), "the particles were never sorted"
    assert errors["plain", 0.1] > 2.5 * errors["lattice", 0.1]
    assert errors["balanced", 0.1] < 1.25 * errors["lattice", 0.1]
    assert errors["balanced", 0.5] < 0.5 * errors["plain", 0.5]


def test_balance_is_sorted_with_its_particles(make_scene, device):
    simulation = Simulation(make_scene(DROP, BALANCED, "fluids[0].jitter=0.1"), device)
    simulation.advance(0.01)
    state = simulation.state

    def by_id() -> np.ndarray:
        return state.balance.numpy()[np.argsort(state.id.numpy())]

    before, slots = by_id(), state.id.numpy().copy()
    state.position.assign(-state.position.numpy())
    simulation.step.neighbours.rebuild()
    assert np.any(state.id.numpy() != slots) and np.any(before)
    np.testing.assert_array_equal(by_id(), before)


@pytest.mark.parametrize("integrator", ["verlet", "runge_kutta"])
def test_velocity_of_the_place_that_shifting_moves_to(make_scene, device, integrator):
    """A shear wave of thin fluid, particles 0.1 dx off their lattice, stays smoother if they take on velocities."""
    scatter = {}
    for velocity in ("own", "local"):
        scene = make_scene(
            CHANNEL,
            f"images=[{ALONG}, {UP}]",
            "materials.oil.dynamic_viscosity=0.5",
            f"shifting={{model: fickian, velocity: {velocity}}}",
            "fluids[0].shear_wave={speed: 1.0, wavelength: 1.0}",
            "fluids[0].jitter=0.1",
            f"run.integrator={integrator}",
        )
        simulation = Simulation(scene, device)
        simulation.advance(0.4)
        found = simulation.state.snapshot()
        exact = periodic_shear(found.position[:, 2], 0.4, speed=1.0, wavelength=1.0, viscosity=5e-4)
        scatter[velocity] = np.std(found.velocity[:, 0] - exact)
    assert scatter["local"] < 0.5 * scatter["own"]
