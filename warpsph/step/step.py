"""One time step, told in order. Nothing else knows the order of things."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import warp as wp

from warpsph.device.launch import Launch, floats
from warpsph.kernels import corrections, damping, density, integrators, neighbours, walls
from warpsph.kernels.rates import rates_kernel
from warpsph.kernels.shifting import cover_kernel, shifting_kernel
from warpsph.model import Model
from warpsph.state import NO_LAST_STEP, State
from warpsph.step.bodies import Coupling
from warpsph.step.neighbours import Neighbours
from warpsph.step.viscosity import Viscosity

Stage = Launch | Callable[[], None]


class Step:
    """Advances a state by steps of length `state.dt`, by the integrator that the scene names (INTEGRATORS).

    Within a step nothing is read back by the host and nothing is allocated.

    Attributes:
        stages: What a step does, in order: a launch for each physical act.
        evaluations: Evaluations of the forces a step.
        sweeps: Sweeps over all pairs a step; those of Verlet give one half of the rates each.
        neighbours: The lists that the step reads.
        bodies: The bodies in the fluid; None where there are none.
        viscosity: Of the materials themselves; None where they have none.
        loops: Whether steps between two lists are handed to the device as one loop, or are launched one by one.
    """

    def __init__(self, model: Model, state: State, bodies: Coupling | None = None) -> None:
        self.model, self.state, self.bodies = model, state, bodies
        self.neighbours = Neighbours(model, state, bodies)
        self.viscosity = Viscosity(model, state, self.neighbours) if model.viscous else None
        self.integrator = INTEGRATORS[model.scene.run.integrator]
        self.evaluations, self.sweeps = self.integrator.evaluations, self.integrator.sweeps
        self.settling = False
        self.loops = model.launcher.can_loop
        self._loop, self._loop_settles = None, False
        s = state
        clock = [s.time, s.target, s.last_step, s.dt_limit, s.stale, s.fault, s.step, s.dt, s.running]
        self._aim = model.launcher.record(integrators.aim_clock, 1, clock)
        self._rebuild()
        self._record()
        self._pack()
        if self.neighbours.dummies:
            self.neighbours.dummies.press()  # the sweep below would read whatever memory holds
        if self.evaluations == 1:
            self._sweep(momentum=False)()  # the first half step needs a rate too, or the run is of first order
        self.find_viscosity()

    def __call__(self) -> None:
        """Advance by one step."""
        if self.settling:
            self._rest_density()
        for stage in self.stages.values():
            stage()

    def run(self, most_steps: int | None = None) -> None:
        """Step until the target of the clock, a fault, or `most_steps`; list neighbours anew when that is due."""
        s = self.state
        last = NO_LAST_STEP if most_steps is None else int(s.clock()["step"]) + most_steps
        s.last_step.fill_(last)
        self._aim()
        while (clock := s.clock())["dt"] > 0.0 and clock["step"] < last:
            if clock["stale"]:
                self._bind(self._rebuild())
                self._aim()
            if self.loops:
                self._repeat()
            else:
                self()

    def _repeat(self) -> None:
        """Step on the device alone until the lists are stale or the clock stops."""
        if self._loop is None or self._loop_settles != self.settling:
            self._loop = self.model.launcher.loop(self.state.running, self)
            self._loop_settles = self.settling
        self._loop()

    def resume(self) -> None:
        """Take up a state that was read from a checkpoint."""
        stale = bool(self.state.clock()["stale"])
        grown = self.neighbours.relist()
        if self.bodies:
            self.bodies.set.move_points()()
            grown |= self.bodies.relist()
        self._bind(grown)
        self.state.stale.fill_(stale)
        self._pack()
        self.find_viscosity()

    def find_viscosity(self) -> None:
        """The apparent viscosity and what has yielded, for who looks between steps; no step reads them from here."""
        if self._shown and self.neighbours.ghosts:
            self.neighbours.ghosts.move()
        for launch in self._shown:
            launch()

    def aim_at(self, time: float) -> None:
        """Let the steps that follow end exactly at `time` [s]."""
        self.state.target.fill_(time)
        self._aim()

    def _rebuild(self) -> bool:
        if self.bodies:
            self.bodies.note_places()
        grown = self.neighbours.rebuild()
        return self.bodies.relist() or grown if self.bodies else grown

    def _bind(self, grown: bool) -> None:
        if grown:
            self._record()

    def _record(self) -> None:
        """Bind every stage to its arrays."""
        s, self._loop = self.state, None
        self._rest_density = self._launch(
            density.rest_density, s.position, s.fluid, s.density, s.density_rate, s.last_diffusion_rate
        )
        self.stages = self.integrator.stages(self)
        self._shown = self.viscosity.shown() if self.viscosity else []

    def _pack(self) -> None:
        """Position and pressure as the pair loops read them: the first stage, with dt = 0."""
        next(iter(self.stages.values()))()
        if self.neighbours.ghosts:
            self.neighbours.ghosts.move()

    # ---------------------------------------------------------------------------------------------- the integrators

    def verlet(self) -> dict[str, Stage]:
        """Drift, kick, drift: Vasco (2014) eq 76-80. Half of the rates at a time, momentum in the middle."""
        s, launcher, bodies = self.state, self.model.launcher, self.bodies
        finish_density = launcher.record(
            integrators.finish_density, self.model.particle_count, [s.dt, s.density_rate, s.density]
        )
        # What does not wait for all particles is chained: threads that meet less often wait less.
        return {
            "drift, pressure": self._drift_half(),  # position and density to n+1/2
            **self._move_ghosts(),  # as mirrors and periodic edges show the particles now
            **({"drift of bodies": bodies.drift_half()} if bodies else {}),  # and the points of their surfaces
            **self._filter(),
            **self._press_walls(),  # the fluid's pressure, carried on into walls that are dummy particles
            **self._gradients(),
            # Pressure, viscosity, tensile correction, diffusion of density; then the reactive walls, and bodies.
            "pair loop: forces, walls": launcher.chain(
                self._sweep(continuity=False), *self._walls(), *self._prepare_viscosity()
            ),
            **self._viscosity(),  # the materials' own
            **self._take_loads(),
            "kick, drift": self._kick(),  # velocity and position to n+1, work, limits of the next step
            **self._damp(),
            **({"kick, contact, drift of bodies": bodies.kick_and_drift()} if bodies else {}),
            **self._move_ghosts(" at the end"),
            **self._show_walls(),
            **self._cover(),
            # Continuity, XSPH and shifting; density to n+1; how far particles have moved, the extremes of each block.
            "pair loop: continuity, density, watch": launcher.chain(
                *(self._sweep(momentum=False), *self._shifting(), finish_density, self._bound_motion(), self._watch())
            ),
            **self._end(),
        }

    def two_stage(self) -> dict[str, Stage]:
        """All rates where the step begins, then all rates at what is predicted with them: Vasco (2014) 4.12.1, 4.12.3.

        Bodies drift, kick, drift: of the rates in the middle of a step, those of runge_kutta, they have the reaction.
        """
        launcher, bodies = self.model.launcher, self.bodies
        reach = integrators.REACH[self.model.scene.run.integrator]
        return {
            "pressure": self._launch_pack(),
            **self._move_ghosts(),
            **self._filter(),
            **self._evaluation(share=reach, weight=1.0 - 0.5 / reach),
            "predict": self._predict(),
            **self._move_ghosts(" ahead"),
            **({"drift of bodies": bodies.drift_half()} if bodies else {}),
            **self._evaluation(" ahead", weight=0.5 / reach),
            **self._take_loads(),
            "correct": self._correct(),  # everything to n+1, work, limits of the next step
            **self._damp(),
            **({"kick, contact, drift of bodies": bodies.kick_and_drift()} if bodies else {}),
            "watch": launcher.chain(self._bound_motion(), self._watch()),
            **self._end(),
        }

    def _evaluation(self, where: str = "", share: float = 1.0, weight: float = 1.0) -> dict[str, Stage]:
        """All rates, and XSPH, in one sweep; `where` tells it from another of the same step.

        The velocity moves on from here by a `share` of the step, in which these rates have a `weight`.
        """
        sweeps = [self._sweep(), *self._shifting(), *self._walls(), *self._prepare_viscosity()]
        stages = {
            **self._press_walls(weight),
            **self._gradients(),
            **self._cover(),
            "pair loop: rates, walls": self.model.launcher.chain(*sweeps),
            **self._viscosity(share),
        }
        return {name + where: stage for name, stage in stages.items()}

    def _end(self) -> dict[str, Stage]:
        ghosts = self.neighbours.ghosts
        return {
            "life of the lists": self._compare_motion(),
            **({"life of the lists, ghosts": ghosts.compare_motion()} if ghosts else {}),
            **({"limits by bodies": self.bodies.watch()} if self.bodies else {}),
            "clock": self._clock(),  # time and the next step
        }

    # ---------------------------------------------------------------------------------------------------- the launches

    def _launch(self, kernel: wp.Kernel, *arguments: object) -> Launch:
        m = self.model
        return m.launcher.record(kernel, m.particle_count, [m.parameters, *arguments])

    def _drift_half(self) -> Launch:
        s = self.state
        return self._launch(
            integrators.drift_half,
            *(s.dt, s.velocity, s.xsph_velocity, s.acceleration, s.density_rate, s.last_diffusion_rate, s.fluid),
            *(s.position, s.density, s.position_volume, s.velocity_pressure),
        )

    def _sweep(self, momentum: bool = True, continuity: bool = True) -> Launch:
        s, m, n = self.state, self.model, self.neighbours
        return m.launcher.record(
            rates_kernel(m.formulas, m.layout, momentum, continuity),
            m.particle_count,
            [
                *(m.grid, m.parameters),
                *(m.launcher.packed(s.position_volume), m.launcher.packed(s.velocity_pressure), s.fluid_and_ghosts),
                *(s.pressure_gradient, n.count, n.list, n.cells.start, s.listed_position),
                *(s.pressure_acceleration, s.dissipative_acceleration),
                *(s.density_rate, s.diffusion_rate, s.xsph_velocity),
            ],
        )

    def _move_ghosts(self, where: str = "") -> dict[str, Stage]:
        return {f"ghosts{where}": self.neighbours.ghosts.move} if self.neighbours.ghosts else {}

    def _press_walls(self, weight: float = 1.0) -> dict[str, Stage]:
        dummies = self.neighbours.dummies
        return {"walls": dummies.press, "work of walls": dummies.book(weight)} if dummies else {}

    def _show_walls(self) -> dict[str, Stage]:
        """Walls that move with bodies, as pair loops find them at the end of the step."""
        dummies = self.neighbours.dummies
        return {"walls at the end": dummies.show} if dummies and self.bodies else {}

    def _take_loads(self) -> dict[str, Stage]:
        """The reaction of the fluid on bodies."""
        if not self.bodies:
            return {}
        dummies = self.neighbours.dummies
        return {"loads on bodies": dummies.take_loads() if dummies else self.bodies.take_loads(self.neighbours.cells)}

    def _prepare_viscosity(self) -> list[Launch]:
        return self.viscosity.prepare() if self.viscosity else []

    def _viscosity(self, share: float = 1.0) -> dict[str, Stage]:
        return self.viscosity.stages(share) if self.viscosity else {}

    def _filter(self) -> dict[str, Stage]:
        """Density made anew, every so many steps: what pair loops read is in place, and is put in place again."""
        s, m, n, chosen = self.state, self.model, self.neighbours, self.model.scene.density_filter
        if chosen.model == "none":
            return {}
        kernel = corrections.density_filter_kernel(m.formulas.smoothing, chosen.model, layout=m.layout)
        due = (chosen.every, s.step)
        packed = (s.position_volume, s.velocity_pressure)
        sums = [s.blocks, *due, s.particle_work, s.work]
        return {
            "density filter": self._launch(
                kernel, *due, s.position_volume, s.fluid_and_ghosts, n.count, n.list, s.density, s.filtered_density
            ),
            "density, pressure by filter": self._launch(
                corrections.take_filtered_density,
                *(*due, s.filtered_density, s.fluid, s.density, *packed, s.particle_work),
            ),
            "work of the filter": m.launcher.record(corrections.add_filter_work, s.block_count, sums),
            **self._move_ghosts(" after the filter"),
        }

    def _gradients(self) -> dict[str, Launch]:
        """What diffusion needs before the pair loop, if it is of that kind."""
        s, m, n = self.state, self.model, self.neighbours
        if m.formulas.diffusion not in density.BY_GRADIENT:
            return {}
        kernel = density.pressure_gradient_kernel(m.formulas.smoothing, m.layout)
        packed = (s.position_volume, s.velocity_pressure, s.fluid)
        return {"pressure gradient": self._launch(kernel, *packed, n.count, n.list, s.pressure_gradient)}

    def _cover(self) -> dict[str, Launch]:
        """What shifting needs to know of surfaces."""
        s, m, n = self.state, self.model, self.neighbours
        if m.scene.shifting.model == "none":
            return {}
        packed = (m.launcher.packed(s.position_volume), m.launcher.packed(s.velocity_pressure))
        return {"cover": self._launch(cover_kernel(m.formulas, m.layout), *packed, n.count, n.list, s.cover)}

    def _shifting(self) -> list[Launch]:
        """The drift that keeps particles in order, where XSPH writes its own."""
        s, m, n, chosen = self.state, self.model, self.neighbours, self.model.scene.shifting
        if chosen.model == "none":
            return []
        packed = (m.launcher.packed(s.position_volume), m.launcher.packed(s.velocity_pressure), s.fluid)
        return [
            self._launch(
                *(shifting_kernel(m.formulas, m.layout), m.particle_count, chosen.strength),
                *(*packed, n.count, n.list, s.cover, s.xsph_velocity),
            )
        ]

    def _walls(self) -> list[Launch]:
        s, m, n = self.state, self.model, self.neighbours
        if n.dummies:
            return []
        at_rest = self._launch(
            walls.wall_acceleration_kernel(
                m.scene.wall_model.force, m.scene.smoothing.kernel, dimensions=m.scene.dimensions
            ),
            *(s.position_volume, s.velocity_pressure, s.fluid),
            *(floats(m.wall_position), floats(m.wall_velocity), m.wall_normal, m.wall_before, m.wall_after),
            *(n.wall_first, n.wall_list, s.wall_acceleration, s.wall_distance),
        )
        return [at_rest, self.bodies.push_fluid()] if self.bodies else [at_rest]

    def _kick(self) -> Launch:
        s = self.state
        return self._launch(
            integrators.kick_and_drift,
            *(s.dt, s.damping, s.pressure_acceleration, s.dissipative_acceleration, s.wall_acceleration),
            *(s.wall_distance, s.xsph_velocity, s.density_rate, s.diffusion_rate, s.fluid),
            *(s.position, s.velocity, s.density, s.last_diffusion_rate, s.position_volume, s.velocity_pressure),
            *(s.acceleration, s.particle_work, s.particle_dt_limit, s.particle_fault),
        )

    def _damp(self) -> dict[str, Stage]:
        """What damping zones take from waves, if there are any."""
        s, m = self.state, self.model
        if m.zones is None:
            return {}
        waves = (s.position_volume, s.velocity, s.velocity_pressure, s.particle_work)
        return {"damping zones": self._launch(damping.damp_in_zones, m.zones, s.dt, s.fluid, *waves)}

    def _launch_pack(self) -> Launch:
        s = self.state
        packed = (s.position_volume, s.velocity_pressure)
        return self._launch(integrators.pack, s.position, s.velocity, s.density, s.fluid, *packed)

    def _predict(self) -> Launch:
        s = self.state
        return self._launch(
            integrators.predict,
            *(integrators.REACH[self.model.scene.run.integrator], s.dt),
            *(s.pressure_acceleration, s.dissipative_acceleration, s.wall_acceleration),
            *(s.xsph_velocity, s.density_rate, s.diffusion_rate, s.fluid, s.velocity),
            *(s.position, s.density, s.position_volume, s.velocity_pressure),
            *(s.acceleration, s.particle_work, s.first_dissipative, s.first_wall),
        )

    def _correct(self) -> Launch:
        s = self.state
        return self._launch(
            integrators.correct,
            *(integrators.REACH[self.model.scene.run.integrator], s.dt, s.damping),
            *(s.pressure_acceleration, s.dissipative_acceleration, s.wall_acceleration, s.wall_distance),
            *(s.xsph_velocity, s.density_rate, s.diffusion_rate, s.first_dissipative, s.first_wall, s.fluid),
            *(s.position, s.velocity, s.density, s.position_volume, s.velocity_pressure),
            *(s.acceleration, s.particle_work, s.particle_dt_limit, s.particle_fault),
        )

    def _bound_motion(self) -> Launch:
        s, m = self.state, self.model
        lookahead = 1.25  # the next step may be a quarter longer than this one
        return m.launcher.record(
            neighbours.bound_motion,
            s.cell_block_count,
            [
                *(m.grid, lookahead, self.neighbours.cells.start, s.dt, s.position_volume, s.velocity),
                *(s.acceleration, s.listed_position, s.motion_lower, s.motion_upper),
            ],
        )

    def _watch(self) -> Launch:
        s, m = self.state, self.model
        return m.launcher.record(
            integrators.watch_blocks,
            s.block_count,
            [
                *(s.blocks, s.particle_dt_limit, s.particle_fault, s.particle_work, s.work),
                *(s.block_dt_limit, s.block_fault_slot),
            ],
        )

    def _compare_motion(self) -> Launch:
        s, m = self.state, self.model
        walls = [m.skin, m.wall_skin, m.support + m.body_skin, m.wall_block]
        bounds = [m.grid, *walls, s.motion_lower, s.motion_upper, s.strain]
        return m.launcher.record(neighbours.compare_motion, s.cell_block_count, bounds)

    def _clock(self) -> Launch:
        s, m = self.state, self.model
        more = 1 if self.bodies else 0  # an entry of theirs
        blocks = s.block_count + (2 if self.viscosity else more)
        strains = s.strain_block_count + more
        limits, slots, collect = s.block_dt_limit, s.block_fault_slot, []

        def one_thread(kernel: wp.Kernel, count: int, arguments: list[object]) -> Launch:
            """One thread of a CPU: the clock follows at once."""
            return m.launcher.record(kernel, count, arguments, grain=count + 1)

        for stage, least, slot in s.stages:
            inputs = [stage, limits, slots, least, slot]
            collect.append(one_thread(integrators.collect_blocks, len(least), inputs))
            blocks, limits, slots = len(least), least, slot
        strain = s.strain
        for stage, largest in s.strain_stages:
            collect.append(one_thread(neighbours.largest_of_blocks, len(largest) - 1, [stage, strain, largest]))
            strain = largest
        advance = m.launcher.record(
            integrators.advance_clock,
            1,
            [
                *(blocks, strains, limits, slots, s.particle_fault),
                *(s.block_strain, s.target, s.last_step, s.time, s.dt, s.step, s.fault, s.fault_slot),
                *(s.dt_limit, s.stale, s.running),
            ],
        )
        return m.launcher.chain(*collect, advance)


@dataclass(frozen=True)
class Integrator:
    """A way to take a step.

    Attributes:
        stages: What a step does, in order; the first stage packs what the pair loops read.
        evaluations: Evaluations of the forces a step.
        sweeps: Sweeps over all pairs a step.
    """

    stages: Callable[[Step], dict[str, Stage]]
    evaluations: int
    sweeps: int


INTEGRATORS: Mapping[str, Integrator] = {
    "verlet": Integrator(Step.verlet, evaluations=1, sweeps=2),
    "predictor_corrector": Integrator(Step.two_stage, evaluations=2, sweeps=2),
    "runge_kutta": Integrator(Step.two_stage, evaluations=2, sweeps=2),
}
