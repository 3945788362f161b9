"""What a scene will take: counts, memory, steps and time, found without running it."""

import math
import time
from dataclasses import dataclass

import numpy as np

from warpsph.device.launch import Launcher
from warpsph.memory import Memory, counts_of, memory_of, with_neighbours
from warpsph.placement.origin import localised
from warpsph.placement.place import Start
from warpsph.placement.sound import Need, chosen_sound, with_sound
from warpsph.rheology import kinematic_viscosities, viscous
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError
from warpsph.schemes.choice import scheme_of
from warpsph.simulation import Simulation, place_within


@dataclass(frozen=True)
class Forecast:
    """What a scene will take, found without running it."""

    particle_count: int
    counts: dict[str, int]  # particles of each fluid
    wall_count: int
    body_points: int
    memory: Memory
    first_dt: float  # [s]
    steps: int
    viscosities: dict[str, tuple[float, float]]  # of each material, its greatest own and the artificial one [m2/s]
    viscous_stages: int  # sweeps of a step for viscosity
    sound: dict[str, Need]  # of each material for which the scene has no speed of sound
    step_seconds: float  # that a step is expected to take on this machine [s]
    warnings: tuple[str, ...]


# How long steps are timed [s], and how many batches of five at most.
TIMED_SECONDS, MOST_BATCHES = 0.5, 40
# Scenes of more particles are timed on so many of them.
MOST_TIMED = 200_000
# How many times as coarse a scene may be rehearsed, and how long [s] and for what share of the time of the scene.
REHEARSALS, MOST_REHEARSAL, SHARE_OF_REHEARSAL = (2, 3, 4), 8.0, 0.15
# Of more particles than this even the coarsest rehearsal would be no more than its first steps.
MOST_REHEARSED = 50_000


def forecast(scene: Scene, launcher: Launcher) -> Forecast:
    """What the scene will take. Raises SceneError, and NoRoomError where it does not fit.

    The particles are placed, and a few steps timed, which nothing comes of: of the scene itself, or of a coarser one
    where it is a big one, by the particle. How steps shrink as the flow speeds up, and how often it wants new lists, is
    taken from a coarse rehearsal: both go by Mach numbers and by motion over the spacing, so that they
    change little with the spacing.
    """
    sound = chosen_sound(scene)
    scene = with_neighbours(localised(with_sound(scene, sound)), launcher.device)
    placement = place_within(scene, launcher.device)
    start, law = Start.of(placement), viscous(scene, launcher.device)
    memory = memory_of(scene, counts_of(scene, placement), shared=launcher.device.is_cpu)
    count = len(placement.position)
    times = (count / MOST_TIMED) ** (1.0 / scene.dimensions)
    simulation = None
    if times <= 1.0:
        simulation = Simulation(scene, str(launcher.device), launcher.threads, placement)
    del placement
    simulation = (
        simulation or _coarser(scene, launcher, times) or Simulation(scene, str(launcher.device), launcher.threads)
    )
    step_seconds, list_seconds = (
        seconds * count / simulation.model.particle_count for seconds in _time_steps(simulation)
    )
    del simulation
    dt = scheme_of(scene).longest_step(scene, law, start.top_speed)
    duration = scene.run.end_time - scene.start_time
    shrinking, lists_a_step = _rehearse(scene, launcher, count, duration / dt * step_seconds)
    return Forecast(
        particle_count=count,
        counts=dict(zip((fluid.name for fluid in scene.fluids), start.counts, strict=True)),
        wall_count=start.wall_count,
        body_points=sum(len(solid.body.surface.points) for solid in start.solids),
        memory=memory,
        first_dt=dt,
        # Whole numbers of equal steps end at each record: half a step more, on the average.
        steps=math.ceil(duration / dt * shrinking + 0.5 * _count_records(scene)),
        viscosities=kinematic_viscosities(scene),
        viscous_stages=law.stages if law else 0,
        sound=sound,
        step_seconds=step_seconds + lists_a_step * list_seconds,
        warnings=start.warnings,
    )


def _coarser(scene: Scene, launcher: Launcher, times: float) -> Simulation | None:
    """The scene with its spacing so many times as wide, or a little more where that does not fit between its walls.

    None where it cannot be: with a body of one spacing, say.
    """
    for more in (1.0, 1.04, 1.09, 1.15, 1.22, 1.3):
        coarse = scene.model_copy(update={"spacing": scene.spacing * times * more})
        try:
            return Simulation(coarse, str(launcher.device), launcher.threads)
        except SceneError:
            continue
    return None


def _count_records(scene: Scene) -> int:
    """At how many different times something is recorded."""
    rates = (scene.output.samples_per_second, scene.output.frames_per_second)
    starts = (scene.start_time, 0.0)
    times = [
        np.arange(math.ceil(t * rate), scene.run.end_time * rate) / rate for t, rate in zip(starts, rates, strict=True)
    ]
    return len(np.unique(np.round(np.concatenate(times), 9)))


def _time_steps(simulation: Simulation) -> tuple[float, float]:
    """How long one of the first steps takes without new lists, and how long these take [s]."""
    step = simulation.step
    step.aim_at(simulation.scene.run.end_time)
    step.run(2)  # in which kernels are compiled
    batches: list[tuple[float, int]] = []
    began = time.perf_counter()
    while len(batches) < MOST_BATCHES and (not batches or time.perf_counter() - began < TIMED_SECONDS):
        lists, start = step.neighbours.rebuilds, time.perf_counter()
        step.run(5)
        batches.append((time.perf_counter() - start, step.neighbours.rebuilds - lists))
    start = time.perf_counter()
    for _ in range(3):
        if simulation.bodies:
            simulation.bodies.note_places()
        step.neighbours.rebuild()
        if simulation.bodies:
            simulation.bodies.relist()
        step.neighbours.cells.start.numpy()  # a GPU has done it then
    list_seconds = (time.perf_counter() - start) / 3
    return float(np.median([(seconds - lists * list_seconds) / 5 for seconds, lists in batches])), list_seconds


def _rehearse(scene: Scene, launcher: Launcher, count: int, seconds: float) -> tuple[float, float]:
    """How many times as many steps as at the length of the first it takes, and how many lists a step.

    `seconds` is what the scene, of `count` particles, would take at that [s]. It is run more coarsely, to its end or as
    far as there is time for; where it cannot be (a body of one spacing, say) nothing is expected to change: 1 and 0.
    """
    most = min(MOST_REHEARSAL, SHARE_OF_REHEARSAL * seconds)
    affordable = (times for times in REHEARSALS if seconds < most * times ** (scene.dimensions + 1))
    coarsest = max(REHEARSALS[-1], (count / MOST_REHEARSED) ** (1.0 / scene.dimensions))
    simulation = _coarser(scene, launcher, next(affordable, coarsest))
    if simulation is None:
        return 1.0, 0.0
    step, end = simulation.step, simulation.scene.run.end_time
    ends, began = [*simulation.phase_changes(), end], time.perf_counter()
    step.aim_at(ends[0])
    while ends and time.perf_counter() - began < most and not simulation.state.clock()["fault"]:
        step.run(50)
        if simulation.time >= ends[0]:
            simulation.enter_phase()
            ends.pop(0)
            step.aim_at(ends[0] if ends else simulation.time)
    gone, steps = simulation.time - scene.start_time, simulation.step_count
    if not gone:
        return 1.0, 0.0
    dt = scheme_of(simulation.scene).longest_step(
        simulation.scene, simulation.model.viscous, simulation.start.top_speed
    )
    return max(1.0, steps * dt / gone), step.neighbours.rebuilds / steps
