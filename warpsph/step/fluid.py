"""What the particles of fluid do in a step: their pair loops, and how they are moved.

Every method records one thing with the arrays as they are now, and gives its launches: none where the scene has no such
thing.
"""

from typing import Any

import warp as wp

from warpsph.device.launch import Launch
from warpsph.kernels import corrections, damping, density, integrators
from warpsph.kernels.rates import rates_kernel
from warpsph.kernels.shifting import cover_kernel, shifting_kernel
from warpsph.model import Model
from warpsph.state import State
from warpsph.step.act import Stage, Together
from warpsph.step.ghosts import Ghosts, NoGhosts
from warpsph.step.neighbours import Neighbours


class Fluid:
    """The fluid of a state."""

    def __init__(self, model: Model, state: State, neighbours: Neighbours) -> None:
        self._model, self._state, self._neighbours = model, state, neighbours

    def _record(self, kernel: wp.Kernel, **named: Any) -> list[Launch]:
        """A launch over all particles."""
        m = self._model
        return [m.launcher.record(kernel, m.particle_count, m, self._state, self._neighbours, **named)]

    # ------------------------------------------------------------------------------------------------------- in pairs

    def sweep(self, momentum: bool = True, continuity: bool = True) -> list[Launch]:
        """Acceleration, rate of density and XSPH, or one half of these."""
        kernel = rates_kernel(self._model.formulas, self._model.layout, momentum, continuity)
        return self._record(kernel, fluid=self._state.fluid_and_ghosts)

    def forces(self) -> list[Launch]:
        """Acceleration by pressure and dissipation, rate of density by diffusion."""
        return self.sweep(continuity=False)

    def continuity(self) -> list[Launch]:
        """Rate of density, and XSPH."""
        return self.sweep(momentum=False)

    def pressure_gradient(self) -> list[Launch]:
        """What a diffusion by gradients needs before the pair loop."""
        m = self._model
        if m.formulas.diffusion not in density.BY_GRADIENT:
            return []
        return self._record(density.pressure_gradient_kernel(m.formulas.smoothing, m.layout))

    def cover(self) -> list[Launch]:
        """What shifting needs to know of surfaces."""
        m = self._model
        if m.scene.shifting.model == "none":
            return []
        return self._record(cover_kernel(m.formulas, m.layout))

    def shift(self) -> list[Launch]:
        """The drift that keeps particles in order, where XSPH writes its own."""
        m = self._model
        if m.scene.shifting.model == "none":
            return []
        return self._record(shifting_kernel(m.formulas, m.layout), strength=m.scene.shifting.strength)

    # --------------------------------------------------------------------------------------------------- one by one

    def pack(self) -> list[Launch]:
        """Position and pressure as pair loops read them."""
        return self._record(integrators.pack)

    def drift_half(self) -> list[Launch]:
        """Position and density to n+1/2, pressure."""
        return self._record(integrators.drift_half)

    def damp(self) -> list[Launch]:
        """What damping zones take from waves."""
        m = self._model
        if m.zones is None:
            return []
        return self._record(damping.damp_in_zones, work=self._state.particle_work)

    def kick(self) -> list[Launch]:
        """Velocity and position to n+1, work, limits of the next step."""
        return self._record(integrators.kick_and_drift)

    def finish_density(self) -> list[Launch]:
        """Density to n+1."""
        return self._record(integrators.finish_density)

    def predict(self) -> list[Launch]:
        """What the step reaches with the rates where it begins."""
        return self._record(integrators.predict, reach=self._reach)

    def correct(self) -> list[Launch]:
        """Everything to n+1, work, limits of the next step."""
        return self._record(integrators.correct, reach=self._reach)

    @property
    def _reach(self) -> float:
        return integrators.REACH[self._model.scene.run.integrator]

    def settle(self) -> list[Launch]:
        """The density of rest where the fluid is."""
        return self._record(density.rest_density, diffusion_rate=self._state.last_diffusion_rate)


class DensityFilter:
    """Density made anew, every so many steps: what pair loops read is in place, and is put in place again."""

    def __init__(self, model: Model, state: State, neighbours: Neighbours, ghosts: Ghosts | NoGhosts) -> None:
        self._model, self._state, self._neighbours, self._ghosts = model, state, neighbours, ghosts

    def stages(self) -> dict[str, Stage]:
        """The sums, what they change, the work that it takes, and ghosts anew."""
        s, m, chosen = self._state, self._model, self._model.scene.density_filter
        if chosen.model == "none":
            return {}
        record, every = m.launcher.record, chosen.every
        kernel = corrections.density_filter_kernel(m.formulas.smoothing, chosen.model, layout=m.layout)
        owners, count = (m, s, self._neighbours), m.particle_count
        return {
            "density filter": record(kernel, count, *owners, every=every, fluid=s.fluid_and_ghosts),
            "density, pressure by filter": record(corrections.take_filtered_density, count, *owners, every=every),
            "work of the filter": record(corrections.add_filter_work, s.block_count, s, every=every),
            **Together(m.launcher, "ghosts after the filter", self._ghosts.moved).stages(),
        }
