"""A simulation in memory: model, state and step, with the phases of a scene and the watch over absurd particles."""

import math

import warp as wp

from warpsph.device.launch import Launcher
from warpsph.kernels import clock
from warpsph.measure.energy import Energy
from warpsph.measure.gauges import Gauges
from warpsph.measure.instruments import Instruments
from warpsph.memory import counts_of, refuse_too_big, rough_counts, with_neighbours
from warpsph.model import LEAST_COMPRESSION, MOST_COMPRESSION, Model
from warpsph.placement.origin import localised
from warpsph.placement.place import Placement, Start, place
from warpsph.placement.sound import with_sound
from warpsph.rheology import Viscous, viscous
from warpsph.scene.scene import Scene
from warpsph.schemes.choice import scheme_of
from warpsph.state import State
from warpsph.step.bodies import Coupling
from warpsph.step.leaving import Leaving
from warpsph.step.step import Step

_FAULTS = {
    int(clock.NOT_FINITE): "its position, velocity or density is not a finite number",
    int(clock.TOO_LIGHT): f"its density fell below {LEAST_COMPRESSION:g} of its material's",
    int(clock.TOO_DENSE): f"its density rose above {MOST_COMPRESSION:g} times its material's",
    int(clock.TOO_FAST): "it moves faster than sound in its material",
    int(clock.OUTSIDE): "it left the box around walls and fluid",
}

# A run of more steps is a mistake: at a millisecond each it takes a day, and rounding adds up.
MOST_STEPS = 1e8
# By how much a count from the drawing alone may be too high.
ROUGH = 1.3


class BlowUpError(Exception):
    """A particle became absurd; the text says which, where, when and how."""


def place_within(scene: Scene, device: wp.Device) -> Placement:
    """Place a scene that can be run, within the memory that there is; whatever can be told from the drawing first.

    Raises:
        SceneError: the scene cannot be set up.
        NoRoomError: there is not enough memory.
    """
    refuse_endless(scene, viscous(scene, device))
    refuse_too_big(scene, rough_counts(scene), device, slack=ROUGH)
    placement = place(scene)
    refuse_too_big(scene, counts_of(scene, placement), device)
    return placement


def refuse_endless(scene: Scene, viscous: Viscous | None) -> None:
    """Raises SceneError where the longest step of all would be taken too often."""
    dt = scheme_of(scene).longest_step(scene, viscous)
    steps = (scene.run.end_time - scene.start_time) / dt
    if min(steps, scene.run.max_steps or math.inf) > MOST_STEPS:
        raise scene.error("run.end_time", f"needs {steps:.1e} steps of {dt:.1e} s, more than {MOST_STEPS:.0e}")


class Simulation:
    """A scene that can be advanced in time.

    Attributes:
        scene: The scene as it is seen from its origin, from which all places in here count.
        start: What there was before the first step.
        leaving: What has left since.
    """

    def __init__(
        self, scene: Scene, device: str = "cpu", threads: int | None = None, placement: Placement | None = None
    ) -> None:
        """Place the particles, unless that has been done, and make everything ready for the first step.

        Raises:
            SceneError: the scene cannot be set up.
            DeviceError: there is no such device.
            NoRoomError: there is not enough memory.
        """
        self.launcher = Launcher(device, threads)
        self.scene = scene = with_neighbours(localised(with_sound(scene)), self.launcher.device)
        placement = placement or place_within(scene, self.launcher.device)
        self.start = Start.of(placement)
        self.model = Model(scene, placement, self.launcher)
        del placement  # the state copies what it needs, and lets go of it before it allocates the rest
        chosen = scheme_of(scene)
        self.state = State(self.model, chosen.fields)
        self.bodies = Coupling(self.model, self.state, self.start) if scene.bodies else None
        scheme = chosen(self.model, self.state, self.bodies)
        self.step = Step(self.model, self.state, scheme, self.bodies)
        read = (self.model, self.state, self.step.neighbours)
        self.gauges = Gauges(*read)
        self.instruments = Instruments(*read, self.bodies)
        self.energy = Energy(self.model, self.state)
        self.leaving = Leaving(self.model, self.state, self.start.box)
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
        self.step.settling = bool(warm_up and warming and now < self.scene.start_time + warm_up.settling_time)
        self.state.damping.fill_(warm_up.damping if warm_up and warming else 0.0)
        held = [warming and fluid.hold for fluid in self.scene.fluids]
        self.model.parameters.mobility.assign([*(0.0 if holding else 1.0 for holding in held), 0.0])
        if now == 0.0:
            self.state.work.zero_()  # the energy budget begins at the release
            self.state.energy_gone.zero_()
            if self.bodies:
                self.bodies.release()

    def kept(self) -> dict[str, wp.array]:
        """The arrays that a checkpoint keeps, by name."""
        arrays = {name: getattr(self.state, name) for name in self.state.kept_names}
        return arrays | (self.bodies.kept() if self.bodies else {}) | self.instruments.kept()

    def advance(self, time: float) -> None:
        """Step until `time` [s], exactly; energy, gauges and instruments are of that time too, then.

        Raises:
            BlowUpError: a particle became absurd on the way.
        """
        self.step.aim_at(time)
        self.step.run()
        while fault := int(self.state.clock()["fault"]):
            if not self._let_go():
                raise BlowUpError(self._describe(fault))
            self.step.aim_at(time)
            self.step.run()
        self.step.find_viscosity()

    def _let_go(self) -> bool:
        """Let what left the box go, with the energy that it has; whether the run can go on."""
        before = self.energy.measure()[0]
        if not self.leaving.let_go(self.scene.run.absurd == "drop"):
            return False
        lost = before.total - self.energy.measure()[0].total
        if math.isfinite(lost):  # what was absurd may have any energy
            self.state.energy_gone.fill_(float(self.state.energy_gone.numpy()[0]) + lost)
        return True

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
        x = s.position.numpy()[slot]
        u, _, w = s.velocity.numpy()[slot]
        return (
            f"particle {int(s.id.numpy()[slot])} of '{fluid}' at t = {self.time:.5f} s (step {self.step_count}): "
            f"{_FAULTS[fault]}; {self.scene.spot(x)}, u = {u:.4g} m/s, w = {w:.4g} m/s, "
            f"density {float(s.density.numpy()[slot]):.5g} kg/m3"
        )
