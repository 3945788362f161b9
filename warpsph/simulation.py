"""A simulation in memory: model, state and step, with the phases of a scene and the watch over absurd particles."""

import math
import time
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpsph.device.launch import Launcher
from warpsph.kernels import integrators
from warpsph.measure.energy import Energy
from warpsph.measure.gauges import Gauges
from warpsph.model import LEAST_COMPRESSION, MOST_COMPRESSION, Model
from warpsph.placement.place import Placement, place
from warpsph.rheology import kinematic_viscosities
from warpsph.scene.scene import Scene, SceneError
from warpsph.state import State
from warpsph.step.bodies import Coupling
from warpsph.step.neighbours import Neighbours
from warpsph.step.step import Step
from warpsph.step.viscosity import Viscosity

_FAULTS = {
    int(integrators.NOT_FINITE): "its position, velocity or density is not a finite number",
    int(integrators.TOO_LIGHT): f"its density fell below {LEAST_COMPRESSION:g} of its material's",
    int(integrators.TOO_DENSE): f"its density rose above {MOST_COMPRESSION:g} times its material's",
    int(integrators.TOO_FAST): "it moves faster than sound in its material",
    int(integrators.OUTSIDE): "it left the box around walls and fluid",
}


class BlowUpError(Exception):
    """A particle became absurd; the text says which, where, when and how."""


class Simulation:
    """A scene that can be advanced in time."""

    def __init__(
        self, scene: Scene, device: str = "cpu", threads: int | None = None, placement: Placement | None = None
    ) -> None:
        """Place the particles and make everything ready for the first step.

        Raises:
            SceneError: the scene cannot be set up.
            DeviceError: there is no such device.
        """
        self.scene = scene
        self.placement = placement or place(scene)
        self.launcher = Launcher(device, threads)
        self.model = Model(scene, self.placement, self.launcher)
        self.state = State(self.model)
        self.bodies = Coupling(self.model, self.state, self.placement) if scene.bodies else None
        self.step = Step(self.model, self.state, self.bodies)
        self.gauges = Gauges(self.model, self.state, self.step.neighbours)
        self.energy = Energy(self.model, self.state)
        self.enter_phase()

    @property
    def time(self) -> float:
        """[s]; negative during the warm-up."""
        return float(self.state.clock()["time"])

    @property
    def step_count(self) -> int:
        """Steps done."""
        return int(self.state.clock()["step"])

    def phase_changes(self) -> list[float]:
        """Times at which `enter_phase` must be called [s]: the end of settling and the release."""
        warm_up = self.scene.warm_up
        return [self.scene.start_time + warm_up.settling_time, 0.0] if warm_up else []

    def enter_phase(self) -> None:
        """Set what depends on the phase: settling at the density of rest, warming up with damping, or released."""
        warm_up, now = self.scene.warm_up, self.time
        warming = warm_up is not None and now < 0.0
        self.step.settling = warming and now < self.scene.start_time + warm_up.settling_time
        self.state.damping.fill_(warm_up.damping if warming else 0.0)
        held = [warming and fluid.hold for fluid in self.scene.fluids]
        self.model.parameters.mobility.assign([0.0 if holding else 1.0 for holding in held])
        if now == 0.0:
            self.state.work.zero_()  # the energy budget begins at the release
            if self.bodies:
                self.bodies.release()

    def kept(self) -> dict[str, wp.array]:
        """The arrays that a checkpoint keeps, by name."""
        arrays = {name: getattr(self.state, name) for name in self.state.kept_names}
        return arrays | (self.bodies.kept() if self.bodies else {})

    def advance(self, time: float) -> None:
        """Step until `time` [s], exactly; what outputs show besides the state is of that time then.

        Raises:
            BlowUpError: a particle became absurd on the way.
        """
        self.step.aim_at(time)
        self.step.run()
        fault = int(self.state.clock()["fault"])
        if fault:
            raise BlowUpError(self._describe(fault))
        self.step.find_viscosity()

    def reach(self, time: float) -> None:
        """Step until `time` [s], exactly, and enter the phases that begin on the way.

        Raises:
            BlowUpError: a particle became absurd on the way.
        """
        for change in self.phase_changes():
            if self.time < change <= time:
                self.advance(change)
                self.enter_phase()
        if self.time < time:
            self.advance(time)

    def _describe(self, fault: int) -> str:
        s, slot = self.state, int(self.state.clock()["fault_slot"])
        fluid = self.model.fluid_names[int(s.fluid.numpy()[slot])]
        x, _, z = s.position.numpy()[slot]
        u, _, w = s.velocity.numpy()[slot]
        return (
            f"particle {int(s.id.numpy()[slot])} of '{fluid}' at t = {self.time:.5f} s (step {self.step_count}): "
            f"{_FAULTS[fault]}; x = {x:.4g} m, z = {z:.4g} m, u = {u:.4g} m/s, w = {w:.4g} m/s, "
            f"density {float(s.density.numpy()[slot]):.5g} kg/m3"
        )


@dataclass(frozen=True)
class Forecast:
    """What a scene will take, found without running it."""

    particle_count: int
    counts: dict[str, int]  # particles of each fluid
    wall_count: int
    body_points: int
    memory: int  # of all arrays [bytes]
    first_dt: float  # [s]
    steps: int
    viscosities: dict[str, tuple[float, float]]  # of each material, its greatest own and the artificial one [m2/s]
    viscous_stages: int  # sweeps of a step for viscosity
    step_seconds: float  # that a step is expected to take on this machine [s]
    warnings: tuple[str, ...]


# How long steps are timed [s], and how many batches of five at most.
TIMED_SECONDS, MOST_BATCHES = 0.5, 40
# How many times as coarse a scene may be rehearsed, and how long [s] and for what share of the time of the scene.
REHEARSALS, MOST_REHEARSAL, SHARE_OF_REHEARSAL = (2, 3, 4), 8.0, 0.15


def forecast(scene: Scene, launcher: Launcher) -> Forecast:
    """What the scene will take. Raises SceneError.

    The particles are placed, their neighbours listed, and a few steps timed, which nothing comes of. How steps shrink
    as the flow speeds up, and how often it wants new lists, is taken from a coarse rehearsal: both go by speeds over
    that of sound and by motion over the spacing, so that they change little with the spacing.
    """
    placement = place(scene)
    model = Model(scene, placement, launcher)
    state = State(model)
    neighbours = Neighbours(model, state)
    neighbours.rebuild()
    owners = (model, state, neighbours, neighbours.cells)
    arrays = [array for owner in owners for array in vars(owner).values() if isinstance(array, wp.array)]
    if model.viscous:
        arrays += Viscosity(model, state, neighbours).arrays()
    first_dt = _first_dt(model, placement)
    duration = scene.run.end_time - scene.start_time
    step_seconds, list_seconds = _time_steps(scene, launcher, placement)
    seconds = duration / first_dt * step_seconds
    shrinking, lists_a_step = _rehearse(scene, launcher, seconds)
    return Forecast(
        particle_count=model.particle_count,
        counts={name: int(np.sum(placement.fluid == f)) for f, name in enumerate(model.fluid_names)},
        wall_count=len(placement.wall_position),
        body_points=sum(len(solid.body.surface.points) for solid in placement.solids),
        memory=sum(array.capacity for array in arrays if array.deleter),
        first_dt=first_dt,
        # Whole numbers of equal steps end at each record: half a step more, on the average.
        steps=math.ceil(duration / first_dt * shrinking + 0.5 * _count_records(scene)),
        viscosities=kinematic_viscosities(scene),
        viscous_stages=model.viscous.stages if model.viscous else 0,
        step_seconds=step_seconds + lists_a_step * list_seconds,
        warnings=placement.warnings,
    )


def _first_dt(model: Model, placement: Placement) -> float:
    """The longest step of particles as they start [s]."""
    speed = float(np.linalg.norm(placement.velocity, axis=1).max())
    fastest = float(model.parameters.sound_speed.numpy().max()) + speed
    dt = model.scene.run.courant * model.scene.smoothing_length / fastest
    return min(dt, model.viscous.longest_step) if model.viscous else dt


def _count_records(scene: Scene) -> int:
    """At how many different times something is recorded."""
    rates = (scene.output.samples_per_second, scene.output.frames_per_second)
    starts = (scene.start_time, 0.0)
    times = [
        np.arange(math.ceil(t * rate), scene.run.end_time * rate) / rate for t, rate in zip(starts, rates, strict=True)
    ]
    return len(np.unique(np.round(np.concatenate(times), 9)))


def _time_steps(scene: Scene, launcher: Launcher, placement: Placement) -> tuple[float, float]:
    """How long one of the first steps takes without new lists, and how long these take [s]."""
    simulation = Simulation(scene, str(launcher.device), launcher.threads, placement)
    step = simulation.step
    step.aim_at(scene.run.end_time)
    step.run(2)  # in which kernels are compiled
    batches, began = [], time.perf_counter()
    while len(batches) < MOST_BATCHES and (not batches or time.perf_counter() - began < TIMED_SECONDS):
        lists, start = step.neighbours.rebuilds, time.perf_counter()
        step.run(5)
        batches.append((time.perf_counter() - start, step.neighbours.rebuilds - lists))
    start = time.perf_counter()
    for _ in range(3):
        step.neighbours.rebuild()
        if simulation.bodies:
            simulation.bodies.rebuild()
        step.neighbours.cells.start.numpy()  # a GPU has done it then
    list_seconds = (time.perf_counter() - start) / 3
    return float(np.median([(seconds - lists * list_seconds) / 5 for seconds, lists in batches])), list_seconds


def _rehearse(scene: Scene, launcher: Launcher, seconds: float) -> tuple[float, float]:
    """How many times as many steps as at the length of the first it takes, and how many lists a step.

    `seconds` is what the scene would take at that [s]. It is run more coarsely, to its end or as far as there is time
    for; where it cannot be (a body of one spacing, say) nothing is expected to change: 1 and 0.
    """
    most = min(MOST_REHEARSAL, SHARE_OF_REHEARSAL * seconds)
    affordable = (times for times in REHEARSALS if seconds < most * times ** (scene.dimensions + 1))
    coarse = scene.model_copy(update={"spacing": scene.spacing * next(affordable, REHEARSALS[-1])})
    try:
        simulation = Simulation(coarse, str(launcher.device), launcher.threads)
    except SceneError:
        return 1.0, 0.0
    step, ends, began = simulation.step, [*simulation.phase_changes(), coarse.run.end_time], time.perf_counter()
    step.aim_at(ends[0])
    while ends and time.perf_counter() - began < most and not simulation.state.clock()["fault"]:
        step.run(50)
        if simulation.time >= ends[0]:
            simulation.enter_phase()
            ends.pop(0)
            step.aim_at(ends[0] if ends else simulation.time)
    gone, steps = simulation.time - coarse.start_time, simulation.step_count
    if not gone:
        return 1.0, 0.0
    first_dt = _first_dt(simulation.model, simulation.placement)
    return max(1.0, steps * first_dt / gone), step.neighbours.rebuilds / steps
