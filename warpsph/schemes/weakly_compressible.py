"""Weakly compressible flow: pressure by a state equation, steps short enough for sound. Vasco (2014), chapter 4."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import warp as wp

from warpsph.kernels.integrators import REACH
from warpsph.model import Model
from warpsph.rheology import Viscous
from warpsph.scene.scene import Scene
from warpsph.state import State
from warpsph.step.act import Act, Part, Renamed, Stage, Together
from warpsph.step.bodies import Coupling, NoBodies
from warpsph.step.clock import Clock
from warpsph.step.fluid import DensityFilter, Fluid
from warpsph.step.ghosts import NoGhosts
from warpsph.step.neighbours import Neighbours
from warpsph.step.viscosity import NoViscosity, Viscosity
from warpsph.step.walls import DummyWalls, PointWalls, Walls


class WeaklyCompressible:
    """The scheme of a state.

    Attributes:
        evaluations, sweeps, acts: As of every `Scheme`.
        neighbours: The lists that steps read.
        viscosity: Of the materials themselves.
        fluid: What particles do in a step.
    """

    fields: Mapping[str, type] = {
        "acceleration": wp.vec3,  # of the last kick [m/s2]
        "density_rate": float,  # [kg/m3/s]
        "last_diffusion_rate": float,  # by diffusion, in the last step [kg/m3/s]
        "xsph_velocity": wp.vec3,  # [m/s]
    }

    def __init__(self, model: Model, state: State, bodies: Coupling | None = None) -> None:
        self._model, self._state = model, state
        self.neighbours = Neighbours(model, state, bodies)
        self.viscosity: Viscosity | NoViscosity = NoViscosity()
        if model.viscous:
            self.viscosity = Viscosity(model, state, self.neighbours, model.viscous)
        self._bodies = bodies or NoBodies()
        self._ghosts = self.neighbours.ghosts or NoGhosts()
        self.fluid = Fluid(model, state, self.neighbours)
        dummies = self.neighbours.dummies
        self._walls: Walls = (
            DummyWalls(dummies, bodies) if dummies else PointWalls(model, state, self.neighbours, self._bodies)
        )
        self._filter = DensityFilter(model, state, self.neighbours, self._ghosts)
        self._clock = Clock(model, state, self.neighbours, self._ghosts, self._bodies)
        integrator = INTEGRATORS[model.scene.run.integrator]
        self.evaluations, self.sweeps = integrator.evaluations, integrator.sweeps
        self.acts: Sequence[Act] = integrator.acts(self)

    # ---------------------------------------------------------------------------------------------- the integrators

    def verlet(self) -> list[Act]:
        """Drift, kick, drift: Vasco (2014) eq 76-80. Half of the rates at a time, momentum in the middle."""
        act, fluid, walls, bodies, clock = self._act, self.fluid, self._walls, self._bodies, self._clock
        # What does not wait for all particles goes together: threads that meet less often wait less.
        return [
            act("drift, pressure", fluid.drift_half),  # position and density to n+1/2
            act("ghosts", self._ghosts.moved),  # as mirrors and periodic edges show the particles now
            act("drift of bodies", bodies.drift_half),  # and the points of their surfaces
            self._filter,
            act("walls", walls.press),  # the fluid's pressure, carried on into walls that are dummy particles
            act("work of walls", partial(walls.book, 1.0)),
            *self.viscosity.see_walls(),
            act("pressure gradient", fluid.pressure_gradient),
            # Pressure, viscosity, tensile correction, diffusion of density; then the reactive walls, and bodies.
            act("pair loop: forces, walls", fluid.forces, walls.push, self.viscosity.prepare),
            self.viscosity.over(),  # the materials' own
            act("loads on bodies", walls.take_loads),
            act("kick, drift", fluid.kick),  # velocity and position to n+1, work, limits of the next step
            act("damping zones", fluid.damp),
            act("kick, contact, drift of bodies", bodies.kick_and_drift),
            act("ghosts at the end", self._ghosts.moved),
            act("walls at the end", walls.show),
            act("cover", fluid.cover),
            # Continuity, XSPH and shifting; density to n+1; how far particles have moved, the extremes of each block.
            act(
                "pair loop: continuity, density, watch",
                *(fluid.continuity, fluid.shift, fluid.finish_density, clock.bound_motion, clock.watch),
            ),
            clock,  # time and the next step
        ]

    def two_stage(self) -> list[Act]:
        """All rates where the step begins, then at the state predicted with them: Vasco (2014) 4.12.1, 4.12.3.

        Bodies drift, kick, drift: the rates in the middle of a step, where runge_kutta has them, give their loads.
        """
        act, fluid, bodies, clock = self._act, self.fluid, self._bodies, self._clock
        reach = REACH[self._model.scene.run.integrator]
        return [
            act("pressure", fluid.pack),
            act("ghosts", self._ghosts.moved),
            self._filter,
            *self._evaluation(share=reach, weight=1.0 - 0.5 / reach),
            act("predict", fluid.predict),
            act("ghosts ahead", self._ghosts.moved),
            act("drift of bodies", bodies.drift_half),
            *(Renamed(one, " ahead") for one in self._evaluation(share=1.0, weight=0.5 / reach)),
            act("loads on bodies", self._walls.take_loads),
            act("correct", fluid.correct),  # everything to n+1, work, limits of the next step
            act("damping zones", fluid.damp),
            act("kick, contact, drift of bodies", bodies.kick_and_drift),
            act("watch", clock.bound_motion, clock.watch),
            clock,
        ]

    def _evaluation(self, share: float, weight: float) -> list[Act]:
        """All rates, and XSPH, in one sweep.

        The velocity moves on from here by a `share` of the step, in which these rates have a `weight`.
        """
        act, fluid, walls = self._act, self.fluid, self._walls
        return [
            act("walls", walls.press),
            act("work of walls", partial(walls.book, weight)),
            *self.viscosity.see_walls(),
            act("pressure gradient", fluid.pressure_gradient),
            act("cover", fluid.cover),
            act("pair loop: rates, walls", fluid.sweep, fluid.shift, walls.push, self.viscosity.prepare),
            self.viscosity.over(share),
        ]

    def _act(self, name: str, *parts: Part) -> Act:
        return Together(self._model.launcher, name, *parts)

    # ------------------------------------------------------------------------------------------------ beside the acts

    def begin(self) -> list[Stage]:
        """The rate of the first half step: without it the run would be of first order."""
        # Dummies would be read as whatever memory holds.
        return [*self._walls.press(), *self.fluid.continuity()] if self.evaluations == 1 else []

    def settle(self) -> list[Stage]:
        """Density that does not go on."""
        return list(self.fluid.settle())

    def pack(self) -> list[Stage]:
        """Pack the ghosts of the particles packed."""
        return list(self._ghosts.moved())

    def show(self) -> list[Stage]:
        """The apparent viscosity and what has yielded."""
        shown = self.viscosity.shown()
        return [*self._ghosts.moved(), *shown] if shown else []

    # --------------------------------------------------------------------------------------------- limits of the step

    @staticmethod
    def longest_step(scene: Scene, viscous: Viscous | None, speed: float = 0.0) -> float:
        """The longest step that sound and viscosity allow while nothing is faster than `speed` [m/s], in s."""
        fastest = max(scene.materials[fluid.material].sound_speed for fluid in scene.fluids) + speed
        dt = scene.run.courant * scene.smoothing_length / fastest
        return min(dt, viscous.longest_step) if viscous else dt

    def first_dt(self) -> float:
        """Half of the step that sound allows, or the step that viscosity allows."""
        scene, viscous = self._model.scene, self._model.viscous
        by_sound = 0.5 * scene.run.courant * scene.smoothing_length / max(self._model.parameters.sound_speed.numpy())
        return min(by_sound, viscous.longest_step) if viscous else by_sound


@dataclass(frozen=True)
class Integrator:
    """A way to take a step.

    Attributes:
        acts: What a step does, in order.
        evaluations: Evaluations of the forces a step.
        sweeps: Sweeps over all pairs a step; each sweep of Verlet gives one half of the rates.
    """

    acts: Callable[[WeaklyCompressible], list[Act]]
    evaluations: int
    sweeps: int


INTEGRATORS: Mapping[str, Integrator] = {
    "verlet": Integrator(WeaklyCompressible.verlet, evaluations=1, sweeps=2),
    "predictor_corrector": Integrator(WeaklyCompressible.two_stage, evaluations=2, sweeps=2),
    "runge_kutta": Integrator(WeaklyCompressible.two_stage, evaluations=2, sweeps=2),
}
