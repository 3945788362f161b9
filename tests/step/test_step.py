"""The time step: its order, what it conserves, and that lists, threads and reruns leave no trace."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import warp as wp

import warpsph.model
from scenes import drop, scene
from warpsph.cli import SCENES
from warpsph.device import blocks
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.placement.place import place
from warpsph.scene.loading import load_scene
from warpsph.simulation import Simulation

# Relative, for sums over steps and particles in single precision. What must agree bit for bit has no tolerance.
TOLERANCE = 1e-5

DROP = scene(
    "A drop",
    0.05,
    [],
    [drop(0.4, hydrostatic=False)],
    "gravity: 0.0",
    "tensile_correction: false",
    "density_diffusion: {model: none}",
    "xsph: 0.0",
    alpha=0.0,
)
COLLISION = scene(
    "Two drops collide",
    0.02,
    [],
    [
        drop(0.12, [-0.2, 0.0], "left", velocity=[3.0, 0.0]),
        drop(0.12, [0.2, 0.0], "right", velocity=[-3.0, 0.0]),
    ],
    "gravity: 0.0",
    "tensile_correction: true",
    sound_speed=40.0,
)
INTEGRATORS = ("verlet", "predictor_corrector", "runge_kutta")
every_integrator = pytest.mark.parametrize("integrator", INTEGRATORS)
FILTERED = "density_filter={model: mls, every: 3}"
SCHEMES = {
    "verlet": [],
    "predictor_corrector": ["run.integrator=predictor_corrector"],
    "runge_kutta": ["run.integrator=runge_kutta"],
    "filter": [FILTERED],
    "filter, runge_kutta": [FILTERED, "run.integrator=runge_kutta"],
    "renormalised": ["continuity=renormalised"],
    "shifting": ["shifting.model=fickian", "xsph=0.0"],
    "shifting on top of xsph, runge_kutta": ["shifting.model=fickian", "run.integrator=runge_kutta"],
    "balanced weights": ["materials.water.dynamic_viscosity=5.0", "viscosity.weights=balanced"],
}
every_scheme = pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
FALLING = ["gravity=9.81", "materials.water.sound_speed=40.0"]


def step_by_step(simulation: Simulation, time: float):
    """Advance to `time` [s], stopping after each step to yield its length [s]."""
    simulation.step.aim_at(time)
    while (dt := float(simulation.state.dt.numpy()[0])) > 0.0:
        simulation.step.run(1)
        yield dt


# ------------------------------------------------------------------------------------------------------------ order


def orders(scene_of, device: str, courant: list[float]) -> np.ndarray:
    """Orders in time of position, velocity and density of a drop that is stretched, by slope; `scene_of` a Courant
    number. The error is that against a run with steps 8 times finer than the finest."""

    def stretched(scene) -> tuple[np.ndarray, ...]:
        placement = place(scene)
        placement = replace(placement, velocity=4.0 * placement.position * [1.0, 0.0, -1.0])
        simulation = Simulation(scene, device, placement=placement)
        simulation.advance(0.03)
        drop = simulation.state.snapshot()
        return drop.position, drop.velocity, drop.density

    exact = stretched(scene_of(courant[-1] / 8))
    runs = [stretched(scene_of(C)) for C in courant]
    errors = [[np.sqrt(np.mean((a - b) ** 2)) for a, b in zip(run, exact, strict=True)] for run in runs]
    return np.polyfit(np.log2(courant), np.log2(errors), 1)[0]


@every_integrator
@pytest.mark.parametrize(
    "overrides",
    [[], ["density_diffusion={model: antuono, delta: 0.1}", "materials.water.alpha=0.1"]],
    ids=["plain", "diffusion"],
)
def test_every_integrator_is_of_order_two(make_scene, device, integrator, overrides):
    """By a step that is halved three times; with diffusion from a sweep of its own too."""
    overrides = [*overrides, f"run.integrator={integrator}"]
    found = orders(lambda C: make_scene(DROP, f"run.courant={C}", *overrides), device, [0.4, 0.2, 0.1, 0.05])
    assert found == pytest.approx([2.0, 2.0, 2.0], abs=0.1)


@pytest.mark.parametrize("integrator", INTEGRATORS[1:])
def test_xsph_moves_particles_at_order_two(make_scene, device, integrator):
    """Where all rates are of one instant."""
    overrides = ["xsph=0.5", f"run.integrator={integrator}"]
    found = orders(lambda C: make_scene(DROP, f"run.courant={C}", *overrides), device, [0.4, 0.2, 0.1, 0.05])
    assert found == pytest.approx([2.0, 2.0, 2.0], abs=0.1)


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["materials.water.state_equation=linear"],
        ["materials.water.alpha=0.1"],
        ["tensile_correction=true"],
        ["density_diffusion={model: fourtakas, delta: 0.1}"],
        ["xsph=0.5"],
        ["continuity=renormalised"],
    ],
    ids=["tait", "linear", "viscosity", "tensile correction", "diffusion", "xsph", "renormalised"],
)
def test_order_two(make_scene, device, overrides):
    """A drop that is stretched: halving the step quarters the error against a run with steps 8 times finer still.

    Only the places of particles under XSPH, which drift with the correction of the step before, are of order one.
    """

    position, *others = orders(lambda C: make_scene(DROP, f"run.courant={C}", *overrides), device, [0.5, 0.25, 0.125])
    assert others == pytest.approx([2.0, 2.0], abs=0.2)
    assert position > 0.8 if overrides == ["xsph=0.5"] else position == pytest.approx(2.0, abs=0.2)


# ---------------------------------------------------------------------------------------------------- conservation


@every_integrator
def test_free_fall(make_scene, device, integrator):
    """Every particle by g t^2 / 2, to 1e-6 m."""
    simulation = Simulation(make_scene(DROP, *FALLING, f"run.integrator={integrator}"), device)
    start = simulation.state.snapshot().position
    simulation.advance(0.15)
    assert simulation.step_count > 50
    fallen = start - simulation.state.snapshot().position
    np.testing.assert_allclose(fallen[:, 2], 9.81 * 0.15**2 / 2, rtol=0, atol=1e-6)
    np.testing.assert_allclose(fallen[:, :2], 0.0, rtol=0, atol=1e-6)


@dataclass
class Collapse:
    """A collapse until t = 0.2 s, step by step.

    Attributes:
        masses: Of each fluid, before [kg/m].
        gained: Momentum at the end less that before [kg/s], shape [3].
        impulse: Of gravity and walls, over all steps [kg/s], shape [3].
        exchanged: The same by size, summed over steps and directions [kg/s].
    """

    simulation: Simulation
    masses: list[float]
    gained: np.ndarray
    impulse: np.ndarray
    exchanged: float


@pytest.fixture(scope="module")
def collapsed(make_collapse, device) -> Callable[[list[str]], Collapse]:
    """A function of a scheme that gives its collapse, run once for all tests that look at one."""

    @cache
    def run(scheme: tuple[str, ...]) -> Collapse:
        simulation = Simulation(make_collapse(*scheme), device)
        masses = [motion.mass for motion in simulation.energy.measure()[1]]
        state, mass = simulation.state, simulation.model.parameters.mass.numpy()

        def momentum() -> np.ndarray:
            return mass[state.fluid.numpy()] @ state.velocity.numpy().astype(float)

        before, impulse, exchanged = momentum(), np.zeros(3), 0.0
        for dt in step_by_step(simulation, 0.2):
            m = mass[state.fluid.numpy()].astype(float)
            by_walls = state.wall_acceleration.numpy().astype(float)
            if "run.integrator=predictor_corrector" in scheme:
                by_walls = 0.5 * (state.first_wall.numpy() + by_walls)
            step = dt * (m.sum() * np.array([0.0, 0.0, -9.81]) + m @ by_walls)
            impulse, exchanged = impulse + step, exchanged + np.abs(step).sum()
        return Collapse(simulation, masses, momentum() - before, impulse, exchanged)

    return lambda scheme: run(tuple(scheme))


@every_scheme
def test_momentum_changes_by_gravity_and_walls_alone(collapsed, scheme):
    collapse = collapsed(scheme)
    assert np.linalg.norm(collapse.gained) > 1.0  # [kg/s]
    np.testing.assert_allclose(collapse.gained, collapse.impulse, rtol=0, atol=TOLERANCE * collapse.exchanged)


@every_scheme
def test_mass_is_exact(collapsed, scheme):
    """Of each fluid, and of each particle: it stays what it was and keeps its fluid."""
    collapse = collapsed(scheme)
    simulation = collapse.simulation
    assert simulation.step.neighbours.rebuilds > 10
    after = simulation.state.snapshot()
    np.testing.assert_array_equal(after.id, np.arange(simulation.model.particle_count))
    np.testing.assert_array_equal(after.fluid, place(simulation.scene).fluid)
    now = [motion.mass for motion in simulation.energy.measure()[1]]
    assert now == pytest.approx(collapse.masses, rel=1e-14)


@every_scheme
def test_plane_stays_plane(collapsed, scheme):
    assert not collapsed(scheme).simulation.state.position.numpy()[:, 1].any()


# ------------------------------------------------------------------------------------------------------- the clock


def test_time_and_limits_of_the_step(make_collapse, device):
    """Targets are met exactly, and no step is above the limit of sound."""
    simulation = Simulation(make_collapse(), device)
    for target in (0.001, 0.0123, 1 / 30, 0.05):
        steps = list(step_by_step(simulation, target))
        assert simulation.time == target
        assert steps and max(steps) <= 0.5 * 0.03 / 30.0 * (1 + TOLERANCE)
    simulation.advance(0.05)
    assert simulation.time == 0.05


# --------------------------------------------------------------------------------------------------- density filter


def test_density_is_filtered_in_every_nth_step(make_collapse, device):
    """Until then nothing has happened, to the bit; and then it has."""
    off, on = (
        Simulation(make_collapse(*overrides), device)
        for overrides in ([], ["density_filter={model: shepard, every: 7}"])
    )
    steps = zip(step_by_step(off, 0.02), step_by_step(on, 0.02), strict=False)
    same = [off.state.density.numpy().tobytes() == on.state.density.numpy().tobytes() for _ in steps]
    assert same[:6] == [True] * 6 and not any(same[6:])


# --------------------------------------------------------------------------------------------------------- shifting


@pytest.mark.parametrize("integrator", ["verlet", "runge_kutta"])
def test_shifting_keeps_a_stretched_drop_in_order(make_scene, device, integrator):
    """Columns of particles that drift apart are filled again; the drop as a whole goes as it did, and stays."""
    found = []
    for model in ("none", "fickian"):
        overrides = ["materials.water.alpha=0.1", "density_diffusion.model=fourtakas", f"shifting.model={model}"]
        scene = make_scene(DROP, "spacing=0.04", f"run.integrator={integrator}", "run.courant=0.25", *overrides)
        placement = place(scene)
        velocity = placement.position * [1.0, 0.0, -1.0]
        simulation = Simulation(scene, device, placement=replace(placement, velocity=velocity))
        simulation.advance(1.0)
        drop = simulation.state.snapshot()
        x = drop.position
        inside = (x[:, 0] / np.ptp(x[:, 0])) ** 2 + (x[:, 2] / np.ptp(x[:, 2])) ** 2 < 0.3**2
        apart = np.linalg.norm(x[:, None] - x, axis=2) + 1e9 * np.eye(len(x))
        found.append((apart.min(axis=1)[inside].min() / 0.04, np.ptp(x, axis=0), drop.velocity.mean(axis=0)))
    (closest, extent, _), (closest_shifted, extent_shifted, velocity) = found
    assert closest < 0.6 and closest_shifted > 1.25 * closest
    np.testing.assert_allclose(extent_shifted, extent, atol=0.04)
    np.testing.assert_allclose(velocity, 0.0, atol=TOLERANCE * 1e-1)


# ------------------------------------------------------------------------------------------------ neighbour lists


def test_lists_hold_every_pair_within_the_support(make_scene, device):
    """At the end of every step while two drops collide, though lists are built anew only after some motion."""
    simulation = Simulation(make_scene(COLLISION), device)
    p, neighbours = simulation.model.parameters, simulation.step.neighbours
    support = SMOOTHING["wendland_c2"].support * p.smoothing_length
    steps, built = 0, neighbours.rebuilds
    for _ in step_by_step(simulation, 0.06):
        x = simulation.state.position_volume.numpy()[:, :3].astype(float)
        missing = np.linalg.norm(x[:, None] - x, axis=2) < support
        np.fill_diagonal(missing, False)
        count = neighbours.neighbour_count.numpy()
        i = np.repeat(np.arange(len(x)), count)
        k = np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)
        missing[i, neighbours.rows()[i, k]] = False
        assert not missing.any()
        steps += 1
    assert np.ptp(simulation.state.velocity.numpy()[:, 0]) > 5.0, "they have not met"
    assert 10 < neighbours.rebuilds - built < 0.8 * steps


def test_lists_that_grow_on_the_way(make_collapse, device, bits, monkeypatch):
    """A row that becomes too short is found, and the steps that follow read the longer one: the same bits."""
    runs, rooms = [], []
    for room in (1.5, 0.85):  # with room for the lattice at the start, and no more
        monkeypatch.setattr(warpsph.model, "ROOM", room)
        simulation = Simulation(make_collapse(), device)
        for time in (0.0, 0.2):
            simulation.advance(time)
            rows = simulation.step.neighbours.neighbour_list
            rooms.append(rows.short_rows.size + rows.long_rows.size)
        runs.append(bits(simulation))
    assert rooms[0] == rooms[1] and rooms[2] < rooms[3]
    assert runs[0] == runs[1]


@every_scheme
def test_a_step_reads_nothing_back_and_allocates_nothing(make_collapse, device, monkeypatch, scheme):
    """So that it can be captured as a graph: time, step and the state of the lists stay on the device."""
    simulation = Simulation(make_collapse(*scheme), device)
    simulation.advance(0.01)
    simulation.step.aim_at(1.0)
    done: list[str] = []
    for holder, name in ((wp.array, "numpy"), (wp.array, "__init__"), (wp, "synchronize"), (wp, "copy")):
        whole = getattr(holder, name)
        note = lambda *args, name=name, whole=whole, **kwargs: (done.append(name), whole(*args, **kwargs))[1]  # noqa: E731
        monkeypatch.setattr(holder, name, note)
    for _ in range(3):
        simulation.step()
    assert done == []
    wp.zeros(1, device=device).numpy()
    assert {"__init__", "numpy"} <= set(done), "the test does not notice"


# Scenes with more and more in them; the most kernels of a step and of a rebuild. Sorts and scans are Warp's own.
COUNTED = {
    "still_water": (["wall_model.force=radial"], 11, 6),
    "dam_break": (["spacing=0.02"], 11, 9),
    "column_3d": (["spacing=0.05", "wall_model.force=radial"], 10, 6),
    "couette": ([], 32, 14),
    "sinking_disc": (["wall_model.force=radial"], 28, 8),
    "wave_maker": (["spacing=0.03"], 30, 20),
}


@pytest.mark.parametrize("name", COUNTED)
def test_how_much_a_step_and_a_rebuild_ask(device, monkeypatch, name):
    """Launches are counted. A step reads nothing; a rebuild asks once what lists came to, once for each of ghosts and
    bodies of points, and twice more where few rows had to be longer than the others. Beyond what Warp's
    scans and sorts take a step allocates nothing, and a rebuild no more than is given back in it, for such rows."""
    overrides, most_in_a_step, most_in_a_rebuild = COUNTED[name]
    launched: list[str] = []
    whole = wp.Launch.launch
    monkeypatch.setattr(
        wp.Launch, "launch", lambda self, *args: (launched.append(self.kernel.key), whole(self, *args))[1]
    )
    simulation = Simulation(load_scene(SCENES / f"{name}.yaml", overrides), device, 1)
    step = simulation.step
    simulation.advance(simulation.time + 0.002)
    step.aim_at(simulation.time + 0.1)
    read: list[int] = []
    numpy = wp.array.numpy
    monkeypatch.setattr(wp.array, "numpy", lambda array: (read.append(array.size), numpy(array))[1])
    allocated: list[int] = []
    make = wp.array.__init__

    def note(array, *args, **kwargs):
        make(array, *args, **kwargs)
        if array.deleter:  # others look at memory that is there
            allocated.append(array.size)

    monkeypatch.setattr(wp.array, "__init__", note)
    launched.clear()
    step()
    assert read == allocated == []
    more = len(simulation.state.stages) + len(simulation.state.strain_stages)  # on a GPU
    assert len(launched) <= most_in_a_step + more, launched
    launched.clear()
    if simulation.bodies:
        simulation.bodies.note_places()
    assert not step.neighbours.rebuild(), "arrays have grown"
    if simulation.bodies:
        assert not simulation.bodies.relist()
    monkeypatch.setattr(wp.array, "__init__", make)
    bodies_of_points = bool(simulation.bodies) and not step.neighbours.dummies
    asked = list(read)
    has_longer_rows = bool((step.neighbours.neighbour_list.long_row.numpy() >= 0).any())
    assert len(allocated) == has_longer_rows
    assert len(asked) == 1 + bool(step.neighbours.ghosts) + bodies_of_points + 2 * has_longer_rows
    assert max(asked) <= 3, "an array went to the host for a number"
    assert len(launched) <= most_in_a_rebuild, launched


@every_scheme
def test_a_loop_of_steps_gives_the_same_bits(make_collapse, device, bits, scheme):
    """Handed to the device as a whole from one list to the next, a graph for each thread of a CPU."""
    runs = []
    for threads, loops in ((1, False), (1, True), (2, True)):
        simulation = Simulation(make_collapse(*scheme), device, threads)
        simulation.step.loops &= loops
        for time in (0.01, 0.05):
            simulation.advance(time)
        simulation.step.aim_at(1.0)
        simulation.step.run(5)
        runs.append(bits(simulation))
    assert simulation.step.neighbours.rebuilds > 3
    assert runs[0] == runs[1] == runs[2]


# ------------------------------------------------------------------------------------------------ reproducibility


@pytest.mark.parametrize(
    "overrides", [*SCHEMES.values(), ["artificial_viscosity=monaghan", "density_diffusion.model=molteni_colagrossi"]]
)
def test_same_bits_on_any_number_of_threads_and_again(make_collapse, device, bits, overrides):
    runs = []
    for threads in (1, 2, 1, 3):
        simulation = Simulation(make_collapse(*overrides), device, threads)
        simulation.advance(0.08)
        runs.append(bits(simulation))
    assert runs[0] == runs[1] == runs[2] == runs[3]


# -------------------------------------------------------------------------------------------------------- the clock


@pytest.mark.parametrize("text", [DROP, COLLISION])
def test_collected_blocks_make_the_same_steps(make_scene, bits, monkeypatch, text):
    """As on a GPU, up to the particle that becomes absurd."""
    scene = make_scene(text)
    found = []
    for collects in (False, True):
        monkeypatch.setattr(blocks, "is_interleaved", lambda device, collects=collects: collects)
        monkeypatch.setattr(blocks, "CUDA_SIZE", 4)
        simulation = Simulation(scene, "cpu")
        assert (len(simulation.state.stages) > 1) == collects
        simulation.step.aim_at(1.0)
        simulation.step.run(20)
        density = simulation.state.density.numpy()
        density[7] *= 3.0
        simulation.state.density.assign(density)
        simulation.step.run(5)
        fault = int(simulation.state.fault.numpy()[0]), int(simulation.state.fault_slot.numpy()[0])
        assert fault[0] != 0
        kept = bits(simulation)
        done = np.frombuffer(kept.pop("work"), dtype=float).reshape(-1, 3).sum(axis=0)  # summed in another order
        found.append((kept, fault, done))
    assert found[0][:2] == found[1][:2]
    assert found[0][2] == pytest.approx(found[1][2], rel=1e-12)
