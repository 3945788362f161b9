"""The stage of a step that adds the acceleration by the materials' own viscosities."""

from collections.abc import Callable

import warp as wp

from warpsph.device.launch import Launch, floats
from warpsph.kernels import stress, viscosity
from warpsph.kernels.balance import balance_kernel, keep_balance
from warpsph.kernels.images import Images
from warpsph.kernels.rheology import apparent_viscosity_kernel
from warpsph.kernels.shifting import change_with_place
from warpsph.model import Model
from warpsph.rheology import legendre_stages
from warpsph.state import State
from warpsph.step.neighbours import Neighbours


class Viscosity:
    """Acceleration by viscosity, given positions, velocity, the other accelerations and dt.

    One sweep where sound limits the step. Where viscosity would, the stages of a Runge-Kutta-Legendre scheme carry
    du/dt = F + L(u) over the step at the positions of its middle, and the acceleration is their mean over the step:
    a step by sound costs the square root of what single sweeps would. The apparent viscosity of the velocity that is
    predicted for the middle of the step holds for all stages, so that L is linear.

    Attributes:
        velocity_viscosity: What the sweeps read, (u, v, w, mu), in a plane (u, x, w, mu); two in turn with stages.
        material_viscosity: mu_i [Pa s].
        viscosity: The same over the second moment of W around the particle [Pa s].
        rate: L [m/s2], of the first stage and of the last.
        mean_rate: Of the stages so far [m/s2], two in turn.
        balance: lambda of balance.py, now [1/m]; `state.balance` is that of the step before.
    """

    def __init__(self, model: Model, state: State, neighbours: Neighbours) -> None:
        self.model, self.state, self.neighbours = model, state, neighbours
        count, device = model.particle_count, model.launcher.device
        by_stages, by_stress = model.viscous.stages > 1, model.viscous.form == "stress"

        def zeros(dtype: type, wanted: bool = True) -> wp.array:
            return wp.zeros(count if wanted else 1, dtype=dtype, device=device)

        self.velocity_viscosity = (zeros(wp.vec4), zeros(wp.vec4, by_stages))
        self.material_viscosity = state.apparent_viscosity if model.viscous.law else zeros(float)
        self.viscosity, self.second_moment = zeros(float), zeros(float)
        self.rate = (zeros(wp.vec3), zeros(wp.vec3, by_stages))
        self.mean_rate = (zeros(wp.vec3, by_stages), zeros(wp.vec3, by_stages))
        self.velocity_gradient = zeros(wp.mat33)
        rows = 1 if model.formulas.dimensions == 2 else 3
        self.stress = wp.zeros(rows * count if by_stress else 1, dtype=wp.vec4, device=device)
        self.balance = zeros(wp.vec3, model.viscous.balanced)
        self._images = model.images or Images()
        self._no_ghosts = wp.zeros(1, dtype=int, device=device)

    def arrays(self) -> list[wp.array]:
        """What it has allocated."""
        mine = [*self.velocity_viscosity, *self.rate, *self.mean_rate, self.velocity_gradient, self.stress]
        mine += [self.viscosity, self.second_moment, self.balance]
        return mine if self.model.viscous.law else [*mine, self.material_viscosity]

    def prepare(self) -> list[Launch]:
        """Launches that may run beside the forces: the viscosity of each particle, and what the first sweep reads.

        With the velocity gradient that it takes go the velocities of particles that shifting moves.
        """
        m, s, packed = self.model, self.state, self.velocity_viscosity[0]
        if m.viscous.stages == 1:
            start = self._record(viscosity.with_viscosity, s.velocity_pressure, self.viscosity, packed)
        else:
            start = self._record(
                viscosity.start_stages, m.parameters, s.position_volume, s.velocity, self.viscosity, packed
            )
        normalise = self._record(
            viscosity.normalised_viscosity, self.second_moment, self.material_viscosity, self.viscosity
        )
        return [*self._apparent(), *self._change_with_place(), normalise, start, *self._find_balance()]

    def _apparent(self) -> list[Launch]:
        """Launches that find the viscosity of each particle for the velocity in `velocity_pressure`."""
        m, s = self.model, self.state
        gradient = self._gradient(s.velocity_pressure)
        if m.viscous.law is None:
            constant = [m.viscous.rheology, s.fluid, self.material_viscosity]
            return [gradient, self._record(viscosity.newtonian_viscosity, *constant)]
        law = apparent_viscosity_kernel(m.viscous.law, m.viscous.regularisation)
        numbers = [m.viscous.rheology, s.fluid, self.velocity_gradient, m.parameters.dimensions]
        return [gradient, self._record(law, *numbers, self.material_viscosity)]

    def shown(self) -> list[Launch]:
        """Launches that find what outputs show, for the velocity in `velocity_pressure`; none for constant viscosities.

        That is the apparent viscosity, and what has yielded: steps make the former for themselves, at their middle.
        """
        m, s = self.model, self.state
        if m.viscous.law is None:
            return []
        kernel = stress.yielding_kernel(
            m.formulas.smoothing, m.viscous.mean, m.formulas.dimensions, m.layout, m.images is not None
        )
        numbers = [self.material_viscosity, m.viscous.rheology.yield_stress, s.yielded]
        tell = self._record(kernel, *self._read(s.velocity_pressure), s.fluid, *self._lists(), *numbers)
        return [*self._apparent(), tell]

    def stages(self, share: float = 1.0) -> dict[str, Launch | Callable[[], None]]:
        """Launches that add the acceleration by viscosity to `state.dissipative_acceleration`, in order.

        With stages it is the mean over `share` of the step that begins with `state.velocity`, with the other
        accelerations of the state.
        """
        chain, count = self.model.launcher.chain, self.model.viscous.stages
        dissipative = self.state.dissipative_acceleration
        if count == 1:
            *before, sweep = self._sweep(self.velocity_viscosity[0], self.rate[0])
            last = [self._record(viscosity.add_acceleration, self.rate[0], dissipative), *self._keep_balance()]
            return {**self._named("viscosity, stress", before), "viscosity": chain(sweep, *last)}
        launches: dict[str, Launch | Callable[[], None]] = {}
        for j, stage in enumerate(legendre_stages(count), 1):
            read, written = self.velocity_viscosity[(j + 1) % 2], self.velocity_viscosity[j % 2]
            rate = self.rate[0] if j == 1 else self.rate[1]
            *before, sweep = self._sweep(read, rate)
            s, mean = self.state, self.mean_rate[j % 2]
            update = self._record(
                viscosity.viscous_stage,
                *(self.model.parameters, share, stage.before, stage.second, stage.rate, stage.first, stage.elapsed),
                *(s.dt, s.velocity, s.pressure_acceleration, s.dissipative_acceleration, s.wall_acceleration),
                *(s.fluid, s.position_volume, self.viscosity, rate, self.rate[0], self.mean_rate[(j + 1) % 2]),
                *(mean, written),
            )
            add = self._record(viscosity.add_acceleration, mean, dissipative)
            last = [add, *self._keep_balance()] if j == count else []
            name = f"viscosity, stage {j} of {count}"
            launches |= {**self._named(f"{name}, stress", before), name: chain(sweep, update, *last)}
        return launches

    # ---------------------------------------------------------------------------------------------------- the launches

    def _record(self, kernel: wp.Kernel, *arguments: object) -> Launch:
        return self.model.launcher.record(kernel, self.model.particle_count, arguments)

    def _named(self, name: str, launches: list[Launch]) -> dict[str, Launch]:
        return {name: self.model.launcher.chain(*launches)} if launches else {}

    def _change_with_place(self) -> list[Launch]:
        """The launch by which velocities become those of the places that particles drift to, if they are to."""
        s, chosen = self.state, self.model.scene.shifting
        if chosen.model == "none" or chosen.velocity == "own":
            return []
        return [self._record(change_with_place, self.velocity_gradient, s.xsph_velocity, s.dissipative_acceleration)]

    def _find_balance(self) -> list[Launch]:
        """The launch that takes lambda a sweep further, if weights are balanced."""
        m, s = self.model, self.state
        if not m.viscous.balanced:
            return []
        kernel = balance_kernel(m.formulas.smoothing, m.formulas.dimensions, m.layout, m.images is not None)
        return [self._record(kernel, *self._read(s.velocity_pressure), *self._lists(), floats(s.balance), self.balance)]

    def _keep_balance(self) -> list[Launch]:
        """The launch that keeps lambda for the next step."""
        if not self.model.viscous.balanced:
            return []
        return [self._record(keep_balance, self.balance, self.state.balance)]

    def _sweep(self, velocity_viscosity: wp.array, rate: wp.array) -> list[Launch]:
        """L of a velocity; what comes before the last launch must be over when that begins."""
        m, s, balance = self.model, self.state, floats(self.balance)
        flow = (m.formulas.dimensions, m.layout, m.images is not None, m.viscous.balanced)
        if m.viscous.form == "stress":
            kernel = stress.stress_acceleration_kernel(m.formulas.smoothing, m.viscous.mean, *flow)
            transposed = stress.transposed_stress_kernel(m.formulas.dimensions)
            gradient = [self.velocity_gradient, self.viscosity, m.parameters.dimensions]
            packed = m.launcher.packed(self.stress)
            return [
                self._gradient(velocity_viscosity),
                self._record(transposed, *gradient, self.stress),
                self._record(kernel, *self._read(velocity_viscosity), s.fluid, *self._lists(), packed, balance, rate),
            ]
        kernel = viscosity.viscous_acceleration_kernel(m.formulas.smoothing, m.viscous.form, m.viscous.mean, *flow)
        return [self._record(kernel, *self._read(velocity_viscosity), s.fluid, *self._lists(), balance, rate)]

    def _gradient(self, packed_velocity: wp.array) -> Launch:
        m = self.model
        kernel = stress.velocity_gradient_kernel(
            m.formulas.smoothing, m.formulas.dimensions, m.layout, m.images is not None
        )
        return self._record(
            kernel, *self._read(packed_velocity), *self._lists(), self.velocity_gradient, self.second_moment
        )

    def _read(self, packed_velocity: wp.array) -> list[object]:
        """What the pair loops of velocity begin with."""
        m, place = self.model, self.state.position_volume
        packed = [m.launcher.packed(place), m.launcher.packed(packed_velocity)]
        return [m.parameters, self._images, m.particle_count, *packed, place]

    def _lists(self) -> list[wp.array]:
        """The neighbours: particles, then ghosts."""
        n, ghosts = self.neighbours, self.neighbours.ghosts
        if ghosts is None:
            return [n.count, n.count, n.list, self._no_ghosts, self._no_ghosts]
        return [ghosts.inner_count, n.count, n.list, ghosts.source, ghosts.image]
