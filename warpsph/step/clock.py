"""The end of a step: how far particles have moved, what limits the next step, and the time."""

import warp as wp

from warpsph.device.launch import Launch
from warpsph.kernels import clock, neighbours
from warpsph.model import Model
from warpsph.state import State
from warpsph.step.act import Stage, Together
from warpsph.step.bodies import Coupling, NoBodies
from warpsph.step.ghosts import Ghosts, NoGhosts
from warpsph.step.neighbours import Neighbours

# The next step may be a quarter longer than this one.
LOOKAHEAD = 1.25


class Clock:
    """What a step ends with, as an act, and what can be done before that beside other launches."""

    def __init__(
        self,
        model: Model,
        state: State,
        neighbours: Neighbours,
        ghosts: Ghosts | NoGhosts,
        bodies: Coupling | NoBodies,
    ) -> None:
        self._model, self._state, self._neighbours = model, state, neighbours
        self._ghosts, self._bodies = ghosts, bodies

    def bound_motion(self) -> list[Launch]:
        """How far the particles of each block of cells have moved since they were listed."""
        m, s, n = self._model, self._state, self._neighbours
        ends = {"lower": s.motion_lower, "upper": s.motion_upper}
        kernel = neighbours.bound_motion
        return [m.launcher.record(kernel, s.cell_block_count, m, s, lookahead=LOOKAHEAD, start=n.cell_start, **ends)]

    def watch(self) -> list[Launch]:
        """The least limit of the next step, the first fault and the work of each block of particles."""
        s = self._state
        return [self._model.launcher.record(clock.watch_blocks, s.block_count, s)]

    def stages(self) -> dict[str, Stage]:
        """How long lists hold, what bodies allow, time and the next step."""
        launcher = self._model.launcher
        return {
            "life of the lists": self._compare_motion(),
            **Together(launcher, "life of the lists, ghosts", self._ghosts.compare_motion).stages(),
            **Together(launcher, "limits by bodies", self._bodies.watch).stages(),
            "clock": self._advance(),
        }

    def _compare_motion(self) -> Launch:
        m, s = self._model, self._state
        ends = {"lower": s.motion_lower, "upper": s.motion_upper}
        reach = m.support + m.body_skin
        return m.launcher.record(neighbours.compare_motion, s.cell_block_count, m, s, support=reach, **ends)

    def _advance(self) -> Launch:
        m, s = self._model, self._state
        limits, slots, strain = s.block_dt_limit, s.block_fault_slot, s.strain
        # The entries behind the blocks: one of bodies, and one of viscosity.
        blocks = s.block_count + (2 if m.viscous else self._bodies.entries)
        collect = []

        def one_thread(kernel: wp.Kernel, count: int, **named: object) -> Launch:
            """One thread of a CPU: the clock follows at once."""
            return m.launcher.record(kernel, count, grain=count + 1, **named)

        for stage, least, slot in s.stages:
            named = {"dt_limit": limits, "fault_slot": slots, "dt_limit_out": least, "fault_slot_out": slot}
            collect.append(one_thread(clock.collect_blocks, len(least), blocks=stage, **named))
            blocks, limits, slots = len(least), least, slot
        for stage, largest in s.strain_stages:
            named = {"values": strain, "largest": largest}
            collect.append(one_thread(neighbours.largest_of_blocks, len(largest) - 1, blocks=stage, **named))
            strain = largest
        advance = m.launcher.record(
            clock.advance_clock,
            1,
            s,
            block_count=blocks,
            strain_count=s.strain_block_count + self._bodies.entries,
            block_dt_limit=limits,
            block_fault_slot=slots,
            strain=s.block_strain,
        )
        return m.launcher.chain(*collect, advance)
