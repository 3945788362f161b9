"""The stage of a step that adds the acceleration by the materials' own viscosities."""

from __future__ import annotations

from typing import Any

import warp as wp

from warpsph.device.launch import Launch
from warpsph.kernels import stress, viscosity
from warpsph.kernels.balance import balance_kernel, keep_balance
from warpsph.kernels.images import Images
from warpsph.kernels.layout import Layout
from warpsph.kernels.rheology import apparent_viscosity_kernel
from warpsph.kernels.shifting import change_with_place
from warpsph.model import Model
from warpsph.rheology import Viscous, legendre_stages
from warpsph.state import State
from warpsph.step.act import Act, Stage, Together
from warpsph.step.neighbours import Neighbours


class Viscosity:
    """Acceleration by viscosity, given positions, velocity, the other accelerations and dt.

    One sweep where sound limits the step. Where viscosity would, the stages of a Runge-Kutta-Legendre scheme carry
    du/dt = F + L(u) over the step at the positions of its middle, and the acceleration is their mean over the step:
    a step by sound costs the square root of as many single sweeps. The apparent viscosity of the velocity that is
    predicted for the middle of the step holds for all stages, so that L is linear.

    Where walls are dummy particles, fluid sticks to them: before every sweep they are given its velocity anew.

    Attributes:
        velocity_viscosity: What the sweeps read, (u, v, w, mu), in a plane (u, x, w, mu); two in turn with stages.
        seen_velocity: The same of `velocity_pressure`, dummies' too; only the dummies' mu means anything.
        material_viscosity: mu_i [Pa s].
        viscosity: The same over the second moment of W around the particle [Pa s].
        rate: L [m/s2], of the first stage and of the last.
        mean_rate: Of the stages so far [m/s2], two in turn.
        balance: lambda of balance.py, now [1/m]; `state.balance` is lambda of the step before.
    """

    def __init__(self, model: Model, state: State, neighbours: Neighbours, viscous: Viscous) -> None:
        self.model, self.state, self.neighbours, self.viscous = model, state, neighbours, viscous
        count, device = model.particle_count, model.launcher.device
        by_stages, by_stress = self.viscous.stages > 1, self.viscous.form == "stress"

        def zeros(dtype: type, wanted: bool = True) -> wp.array:
            return wp.zeros(count if wanted else 1, dtype=dtype, device=device)

        self._dummies = neighbours.dummies
        behind = self._dummies.count if self._dummies else 0

        def packed(wanted: bool) -> wp.array:
            return wp.zeros(count + behind if wanted else 1, dtype=wp.vec4, device=device)

        self.velocity_viscosity = (packed(True), packed(by_stages))
        self.seen_velocity = packed(behind > 0)
        self.material_viscosity = state.apparent_viscosity if self.viscous.law else zeros(float)
        self.viscosity, self.second_moment = zeros(float), zeros(float)
        self.rate = (zeros(wp.vec3), zeros(wp.vec3, by_stages))
        self.mean_rate = (zeros(wp.vec3, by_stages), zeros(wp.vec3, by_stages))
        self.velocity_gradient = zeros(wp.mat33)
        rows = 1 if model.formulas.dimensions == 2 else 3
        self.stress = wp.zeros(rows * count if by_stress else 1, dtype=wp.vec4, device=device)
        self.balance = zeros(wp.vec3, self.viscous.balanced)
        self.images = model.images or Images()
        self._no_ghosts = wp.zeros(1, dtype=int, device=device)

    @property
    def inner_count(self) -> wp.array:
        """How many entries of a row of the lists are particles."""
        ghosts = self.neighbours.ghosts
        return ghosts.inner_count if ghosts else self.neighbours.neighbour_count

    @property
    def ghost_source(self) -> wp.array:
        """The particle that each ghost shows."""
        return self.neighbours.ghosts.source if self.neighbours.ghosts else self._no_ghosts

    @property
    def ghost_image(self) -> wp.array:
        """The image in which each ghost is seen."""
        return self.neighbours.ghosts.image if self.neighbours.ghosts else self._no_ghosts

    def arrays(self) -> list[wp.array]:
        """What it has allocated."""
        mine = [*self.velocity_viscosity, self.seen_velocity, *self.rate, *self.mean_rate, self.velocity_gradient]
        mine += [self.stress, self.viscosity, self.second_moment, self.balance]
        return mine if self.viscous.law else [*mine, self.material_viscosity]

    def see_walls(self) -> list[Act]:
        """The acts by which walls are seen as fluid that goes on: with the velocity in `velocity_pressure`."""
        if not self._dummies:
            return []
        launcher = self.model.launcher
        return [
            Together(launcher, "velocity that walls see", lambda: [self._see()]),
            Together(launcher, "velocity of walls", lambda: [self._carry(self.seen_velocity)]),
        ]

    def _see(self) -> Launch:
        """The launch that packs `seen_velocity`."""
        named = {"viscosity": self.material_viscosity, "velocity_viscosity": self.seen_velocity}
        return self._record(viscosity.with_viscosity, **named)

    def _carry(self, packed_velocity: wp.array) -> Launch:
        """The launch that gives dummies the velocity and viscosity that fluid would have there."""
        assert self._dummies
        return self._dummies.carry_velocity(packed_velocity)

    def prepare(self) -> list[Launch]:
        """Launches that may run beside the forces: the viscosity of each particle, and what the first sweep reads.

        With the velocity gradient that it takes go the velocities of particles that shifting moves.
        """
        start = self._record(
            viscosity.with_viscosity if self.viscous.stages == 1 else viscosity.start_stages,
            velocity_viscosity=self.velocity_viscosity[0],
        )
        normalise = self._record(
            viscosity.normalised_viscosity, viscosity=self.material_viscosity, normalised_viscosity=self.viscosity
        )
        return [*self._apparent(), *self._change_with_place(), normalise, start, *self._find_balance()]

    def _apparent(self) -> list[Launch]:
        """Launches that find the viscosity of each particle for the velocity in `velocity_pressure`."""
        viscous = self.viscous
        found = {"rheology": viscous.rheology, "viscosity": self.material_viscosity}
        gradient = self._gradient(self.seen_velocity if self._dummies else self.state.velocity_pressure)
        if viscous.law is None:
            return [gradient, self._record(viscosity.newtonian_viscosity, **found)]
        law = apparent_viscosity_kernel(viscous.law, viscous.regularisation)
        return [gradient, self._record(law, dimensions=self.model.parameters.dimensions, **found)]

    def shown(self) -> list[Launch]:
        """Launches that find what outputs show, for the velocity in `velocity_pressure`; none for constant viscosities.

        That is the apparent viscosity, and what has yielded: steps make the former for themselves, at their middle.
        """
        m, s = self.model, self.state
        if self.viscous.law is None:
            return []
        tell = self._record(
            stress.yielding_kernel(m.formulas.smoothing, self.viscous.mean, *self._flow, self._walled),
            packed_velocity=self.seen_velocity if self._dummies else s.velocity_pressure,
            place=s.position_volume,
            viscosity=self.material_viscosity,
            yield_stress=self.viscous.rheology.yield_stress,
        )
        seen = [self._see(), self._carry(self.seen_velocity)] if self._dummies else []
        return [*seen, *self._apparent(), *seen, tell]

    def over(self, share: float = 1.0) -> ViscousAct:
        """The act that adds the acceleration by viscosity, over a `share` of the step."""
        return ViscousAct(self, share)

    def stages(self, share: float = 1.0) -> dict[str, Stage]:
        """Launches that add the acceleration by viscosity to `state.dissipative_acceleration`, in order.

        With stages it is the mean over `share` of the step that begins with `state.velocity`, with the other
        accelerations of the state.
        """
        chain, count = self.model.launcher.chain, self.viscous.stages
        if count == 1:
            *before, sweep = self._sweep(self.velocity_viscosity[0], self.rate[0])
            last = [self._add(self.rate[0]), *self._keep_balance()]
            walls = self._with_walls("viscosity", self.velocity_viscosity[0])
            return {**walls, **self._named("viscosity, stress", before), "viscosity": chain(sweep, *last)}
        launches: dict[str, Stage] = {}
        for j, stage in enumerate(legendre_stages(count), 1):
            read, written = self.velocity_viscosity[(j + 1) % 2], self.velocity_viscosity[j % 2]
            rate = self.rate[0] if j == 1 else self.rate[1]
            *before, sweep = self._sweep(read, rate)
            mean = self.mean_rate[j % 2]
            update = self._record(
                viscosity.viscous_stage,
                share=share,
                weight_before=stage.before,
                weight_second=stage.second,
                weight_rate=stage.rate,
                weight_first=stage.first,
                elapsed=stage.elapsed,
                rate=rate,
                first_rate=self.rate[0],
                before=self.mean_rate[(j + 1) % 2],
                viscous_acceleration=mean,
                velocity_viscosity=written,
            )
            last = [self._add(mean), *self._keep_balance()] if j == count else []
            name = f"viscosity, stage {j} of {count}"
            launches |= self._with_walls(name, read)
            launches |= {**self._named(f"{name}, stress", before), name: chain(sweep, update, *last)}
        return launches

    # ---------------------------------------------------------------------------------------------------- the launches

    def _record(self, kernel: wp.Kernel, **named: Any) -> Launch:
        """A launch over all particles."""
        m = self.model
        return m.launcher.record(kernel, m.particle_count, m, self.state, self.neighbours, self, **named)

    def _add(self, acceleration: wp.array) -> Launch:
        total = self.state.dissipative_acceleration
        return self._record(viscosity.add_acceleration, acceleration=acceleration, acceleration_inout=total)

    @property
    def _walled(self) -> bool:
        """Whether rows of the lists end with dummies of walls."""
        return self._dummies is not None

    def _with_walls(self, name: str, packed_velocity: wp.array) -> dict[str, Stage]:
        return self._named(f"{name}, walls", [self._carry(packed_velocity)]) if self._dummies else {}

    @property
    def _flow(self) -> tuple[int, Layout, bool]:
        """What all pair loops of velocity close over besides their formulas."""
        return self.model.formulas.dimensions, self.model.layout, self.model.images is not None

    def _named(self, name: str, launches: list[Launch]) -> dict[str, Stage]:
        return {name: self.model.launcher.chain(*launches)} if launches else {}

    def _change_with_place(self) -> list[Launch]:
        """The launch that gives particles the velocities of the places that they drift to, if a scene asks for it."""
        s, chosen = self.state, self.model.scene.shifting
        if chosen.model == "none" or chosen.velocity == "own":
            return []
        return [self._record(change_with_place, drift=s.xsph_velocity, acceleration=s.dissipative_acceleration)]

    def _find_balance(self) -> list[Launch]:
        """The launch that takes lambda a sweep further, if weights are balanced."""
        m, s = self.model, self.state
        if not self.viscous.balanced:
            return []
        reads = {"packed_velocity": s.velocity_pressure, "place": s.position_volume}
        kernel = balance_kernel(m.formulas.smoothing, *self._flow)
        return [self._record(kernel, balance=s.balance, balance_out=self.balance, **reads)]

    def _keep_balance(self) -> list[Launch]:
        """The launch that keeps lambda for the next step."""
        if not self.viscous.balanced:
            return []
        return [self._record(keep_balance, balance=self.balance, kept_balance=self.state.balance)]

    def _sweep(self, velocity_viscosity: wp.array, rate: wp.array) -> list[Launch]:
        """L of a velocity; what comes before the last launch must be over when that begins."""
        m, place = self.model, self.state.position_volume
        reads = {"velocity_viscosity": velocity_viscosity, "place": place, "balance": self.balance}
        names = (m.formulas.smoothing, self.viscous.mean)
        if self.viscous.form == "stress":
            kernel = stress.stress_acceleration_kernel(*names, *self._flow, self.viscous.balanced, self._walled)
            transposed = stress.transposed_stress_kernel(m.formulas.dimensions)
            return [
                self._gradient(velocity_viscosity),
                self._record(transposed, dimensions=m.parameters.dimensions),
                self._record(kernel, stress_acceleration=rate, **reads),
            ]
        smoothing, mean = names
        kernel = viscosity.viscous_acceleration_kernel(
            smoothing, self.viscous.form, mean, *self._flow, self.viscous.balanced, self._walled
        )
        return [self._record(kernel, viscous_acceleration=rate, **reads)]

    def _gradient(self, packed_velocity: wp.array) -> Launch:
        kernel = stress.velocity_gradient_kernel(self.model.formulas.smoothing, *self._flow, self._walled)
        return self._record(kernel, packed_velocity=packed_velocity, place=self.state.position_volume)


class ViscousAct:
    """The act of a step that adds the acceleration by viscosity."""

    def __init__(self, viscosity: Viscosity, share: float) -> None:
        self._viscosity, self._share = viscosity, share

    def stages(self) -> dict[str, Stage]:
        """One sweep, or a Runge-Kutta-Legendre scheme of several."""
        return self._viscosity.stages(self._share)


class NoViscosity:
    """Materials without a viscosity of their own."""

    def see_walls(self) -> list[Act]:
        """None."""
        return []

    def prepare(self) -> list[Launch]:
        """None."""
        return []

    def shown(self) -> list[Launch]:
        """None."""
        return []

    def over(self, share: float = 1.0) -> NoViscosity:
        """An act without stages."""
        return self

    def stages(self) -> dict[str, Stage]:
        """None."""
        return {}
