"""Müller, Charypar & Gross (2003) as Braga (2018) has it: density by summation, leapfrog, walls that throw back."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp

from warpsph.device.launch import Launch
from warpsph.kernels import integrators
from warpsph.kernels import mueller as kernels
from warpsph.model import Model
from warpsph.rheology import Viscous
from warpsph.scene.scene import Scene
from warpsph.state import State
from warpsph.step.act import Act, Part, Stage, Together
from warpsph.step.bodies import Coupling, NoBodies
from warpsph.step.clock import Clock
from warpsph.step.ghosts import NoGhosts
from warpsph.step.neighbours import Neighbours

# The clock takes equal steps of this at most: by so much more than is asked for that rounding adds no step [-].
ROUNDING = 1e-6


class Mueller:
    """The scheme of a state.

    All of it is of one material, and all particles have one mass.

    Attributes:
        evaluations, sweeps, acts: As of every `Scheme`.
        neighbours: The lists that steps read.
    """

    fields: Mapping[str, type] = {
        "acceleration": wp.vec3,  # of the last kick [m/s2]
        "half_velocity": wp.vec3,  # half a step before [m/s]
        "wall_impulse": wp.vec3d,  # that walls have given since the start [N s/m]
    }
    evaluations, sweeps = 1, 2

    def __init__(self, model: Model, state: State, bodies: Coupling | None = None) -> None:
        self._model, self._state = model, state
        self.neighbours = Neighbours(model, state)
        scene = model.scene
        self._viscosity = scene.materials[scene.fluids[0].material].dynamic_viscosity or 0.0
        state.particle_dt_limit.fill_(self.first_dt())
        clock = Clock(model, state, self.neighbours, NoGhosts(), NoBodies())
        act = self._act
        self.acts: Sequence[Act] = [
            act("pack", self._pack),
            act("pair loop: forces", self._forces),
            act("leapfrog, walls", self._leapfrog),
            act("pair loop: density, watch", self._sum_density, clock.bound_motion, clock.watch),
            act("pressure", self._pack),
            clock,
        ]

    def _act(self, name: str, *parts: Part) -> Act:
        return Together(self._model.launcher, name, *parts)

    def _record(self, kernel: wp.Kernel, **named: Any) -> list[Launch]:
        m = self._model
        return [m.launcher.record(kernel, m.particle_count, m, self._state, self.neighbours, **named)]

    def _pack(self) -> list[Launch]:
        """Place, velocity, volume and pressure as pair loops read them."""
        return self._record(integrators.pack)

    def _sum_density(self) -> list[Launch]:
        return self._record(kernels.summed_density_kernel(self._model.layout))

    def _forces(self) -> list[Launch]:
        return self._record(kernels.forces_kernel(self._model.layout), viscosity=self._viscosity)

    def _leapfrog(self) -> list[Launch]:
        scene = self._model.scene
        box = scene.walls[0].box
        assert box is not None, "a scene of this scheme has one"
        lower, upper = (wp.vec3d(corner[0], 0.0, corner[-1]) for corner in (box.min, box.max))
        restitution = scene.wall_model.restitution
        return self._record(kernels.leapfrog, restitution=restitution, lower_wall=lower, upper_wall=upper)

    # ------------------------------------------------------------------------------------------------ beside the acts

    def begin(self) -> list[Stage]:
        """The mass of particles, their density, and their velocity half a step before the start."""
        start = self._record(kernels.start_leapfrog, time_step=self._model.scene.run.time_step)
        density = self._sum_density()
        return [self._level_mass, *density, self._share_mass, *density, *self._pack(), *self._forces(), *start]

    def _level_mass(self) -> None:
        """One mass for all particles, whichever shape they fill."""
        parameters, dx = self._model.parameters, self._model.spacing
        parameters.mass.fill_(float(parameters.rest_density.numpy()[0]) * dx * dx)

    def _share_mass(self) -> None:
        """The mass of a particle with which the density is the material's on the average, eq 3.34."""
        parameters, density = self._model.parameters, self._state.density.numpy()
        rho0 = float(parameters.rest_density.numpy()[0])
        mass = float(parameters.mass.numpy()[0]) * rho0 * density.sum() / np.square(density).sum()
        parameters.mass.fill_(mass)

    def settle(self) -> list[Stage]:
        """Nothing: there is no warm-up."""
        return []

    def pack(self) -> list[Stage]:
        """Nothing else."""
        return []

    def show(self) -> list[Stage]:
        """Nothing that steps do not read."""
        return []

    # --------------------------------------------------------------------------------------------- limits of the step

    @staticmethod
    def longest_step(scene: Scene, viscous: Viscous | None, speed: float = 0.0) -> float:
        """The step that the scene asks for [s]: it is fixed."""
        assert scene.run.time_step is not None, "a scene of this scheme has one"
        return scene.run.time_step * (1.0 + ROUNDING)

    def first_dt(self) -> float:
        """The same [s]."""
        return self.longest_step(self._model.scene, None)
