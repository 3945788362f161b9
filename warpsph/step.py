"""One time step, told in order. Nothing else knows the order of things."""

import warp as wp

from warpsph.kernels import density, integrators, momentum, walls
from warpsph.launch import Launch
from warpsph.model import Model
from warpsph.neighbours import Neighbours
from warpsph.state import BLOCK_SIZE, State


class Step:
    """Advances a state by Verlet steps (Vasco 2014, eq 76-80)."""

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        self.settling = False
        self.neighbours = Neighbours(model, state)
        self._aim = model.launcher.record(
            integrators.aim_clock, 1, [state.time, state.target, state.dt_limit, state.dt]
        )
        self.neighbours.rebuild()
        self._record()
        self._drift_half()  # with dt = 0: packs position and pressure
        self._density_rate()  # the first half step needs a rate too, or the whole run is of first order

    def __call__(self) -> None:
        """Advance by one step of length `state.dt`."""
        if self._lists_will_be_stale():
            self._bind(self.neighbours.rebuild())
        if self.settling:
            self._rest_density()
        self._drift_half()  # position and density to n+1/2, pressure
        self._accelerate()  # pair loop: pressure, viscosity, tensile correction
        self._push_off_walls()
        self._kick_and_drift()  # velocity and position to n+1, work, limits of the next step
        self._density_rate()  # pair loop: continuity, XSPH
        self._finish_density()  # density to n+1
        self._watch()
        self._advance_clock()  # time, next dt

    def resume(self) -> None:
        """Take up a state that was read from a checkpoint."""
        self._bind(self.neighbours.relist())
        self._drift_half()  # with dt = 0: packs position and pressure

    def _bind(self, grown: bool) -> None:
        if grown:
            self._record()

    def aim_at(self, time: float) -> None:
        """Let the steps that follow end exactly at `time` [s]."""
        self.state.target.fill_(time)
        self._aim()

    def _lists_will_be_stale(self) -> bool:
        """Whether two particles could come within the support, unlisted, before the coming step ends."""
        s = self.state
        moved, speed, dt = (float(a.numpy()[0]) for a in (s.moved, s.speed, s.dt))
        return moved + 1.25 * dt * speed > 0.5 * self.model.skin

    def _record(self) -> None:
        """Bind every stage to its arrays."""
        m, s, n = self.model, self.state, self.neighbours
        scene, p, count = m.scene, m.parameters, m.particle_count

        def record(kernel: wp.Kernel, *arguments: object, count: int = count) -> Launch:
            return m.launcher.record(kernel, count, arguments)

        packed = (s.position_volume, s.velocity_pressure, s.fluid)
        smoothing = scene.smoothing.kernel
        self._rest_density = record(density.rest_density, p, s.position, s.fluid, s.density, s.density_rate)
        self._drift_half = record(
            integrators.drift_half,
            *(p, s.dt, s.velocity, s.xsph_velocity, s.acceleration, s.density_rate, s.fluid),
            *(s.position, s.density, s.position_volume, s.velocity_pressure),
        )
        self._accelerate = record(
            momentum.acceleration_kernel(smoothing, scene.viscosity, scene.tensile_correction),
            *(p, *packed, n.count, n.list, s.pressure_acceleration, s.dissipative_acceleration),
        )
        self._push_off_walls = record(
            walls.wall_acceleration_kernel(scene.wall_model.force, smoothing),
            *(p, *packed, m.wall_position, n.wall_first, n.wall_list, s.wall_acceleration, s.wall_distance),
        )
        self._kick_and_drift = record(
            integrators.kick_and_drift,
            *(p, s.dt, s.damping, s.pressure_acceleration, s.dissipative_acceleration, s.wall_acceleration),
            *(s.wall_distance, s.xsph_velocity, s.density, s.density_rate, s.fluid, s.listed_position),
            *(s.position, s.velocity, s.work, s.position_volume, s.velocity_pressure, s.acceleration),
            *(s.particle_dt_limit, s.particle_moved, s.particle_speed, s.particle_fault),
        )
        self._density_rate = record(
            density.density_rate_kernel(smoothing, scene.density_diffusion.model),
            *(p, *packed, n.count, n.list, s.density_rate, s.diffusion_rate, s.xsph_velocity),
        )
        self._finish_density = record(
            integrators.finish_density,
            *(p, s.dt, s.density_rate, s.diffusion_rate, *packed, s.density, s.work),
        )
        self._watch = record(
            integrators.watch_blocks,
            *(count, BLOCK_SIZE, s.particle_dt_limit, s.particle_moved, s.particle_speed, s.particle_fault),
            *(s.block_extremes, s.block_fault_slot),
            count=s.block_count,
        )
        self._advance_clock = record(
            integrators.advance_clock,
            *(s.block_count, s.block_extremes, s.block_fault_slot, s.particle_fault, s.target),
            *(s.time, s.dt, s.dt_limit, s.step, s.moved, s.speed, s.fault, s.fault_slot),
            count=1,
        )
