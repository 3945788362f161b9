"""Time steps: the acts of a scheme one after the other, and between steps what the host has to do.

    while the clock goes on:
        list neighbours anew, where particles or bodies have gone too far      Neighbours, Coupling
        as often as the lists hold, on the device alone:
            for each act of the scheme, in its order: launch its stages        Scheme.acts

Which acts there are, and in which order, is told by the schemes: schemes/weakly_compressible.py and its neighbours.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

from warpsph.kernels.clock import aim_clock
from warpsph.model import Model
from warpsph.state import NO_LAST_STEP, State
from warpsph.step.act import Act, Stage
from warpsph.step.bodies import Coupling, NoBodies
from warpsph.step.neighbours import Neighbours


class Scheme(Protocol):
    """A way to solve the equations of flow: a file in schemes/.

    Attributes:
        evaluations: Evaluations of the forces a step.
        sweeps: Sweeps over all pairs a step.
        neighbours: The lists that steps read.
        acts: The acts of a step in order; the first stage of the first one packs what pair loops read.
    """

    fields: Mapping[str, type]
    """What a particle has besides place, velocity and density, and keeps from step to step, by name."""
    evaluations: int
    sweeps: int
    neighbours: Neighbours
    acts: Sequence[Act]

    def first_dt(self) -> float:
        """The first step [s]; all others are limited by what the last act finds."""

    def begin(self) -> Sequence[Stage]:
        """What must be known before the first step, once what pair loops read is packed."""

    def settle(self) -> Sequence[Stage]:
        """What comes before each step while the scene settles at the density of rest."""

    def pack(self) -> Sequence[Stage]:
        """What follows the first stage when it only packs what pair loops read."""

    def show(self) -> Sequence[Stage]:
        """What finds the fields that outputs show and no step reads."""


class Step:
    """Advances a state by steps of length `state.dt`, by a scheme.

    Within a step nothing is read back by the host and nothing is allocated.

    Attributes:
        stages: What a step does, in order: a launch for each physical act.
        scheme: Whose acts these are.
        evaluations: Evaluations of the forces a step.
        sweeps: Sweeps over all pairs a step.
        neighbours: The lists that the step reads.
        settling: Whether the scene settles at the density of rest.
        loops: Whether steps between two lists are handed to the device as one loop, or are launched one by one.
    """

    def __init__(self, model: Model, state: State, scheme: Scheme, bodies: Coupling | None = None) -> None:
        self.model, self.state, self.scheme = model, state, scheme
        self.neighbours, self._bodies = scheme.neighbours, bodies or NoBodies()
        self.evaluations, self.sweeps = scheme.evaluations, scheme.sweeps
        self.settling = False
        self.loops = model.launcher.can_loop
        self._loop: Callable[[], None] | None = None
        self._loop_settles = False
        self._aim = model.launcher.record(aim_clock, 1, state)
        state.dt_limit.fill_(scheme.first_dt())
        self._rebuild()
        self._record()
        self._pack()
        _launch(scheme.begin())
        self.find_viscosity()

    def __call__(self) -> None:
        """Advance by one step."""
        if self.settling:
            _launch(self._settle)
        _launch(self.stages.values())

    def insert(self, act: Act, after: str) -> None:
        """Let each step do `act` besides, after the act that has the stage `after`; ValueError where none has."""
        acts = self.scheme.acts
        place = [after in one.stages() for one in acts].index(True) + 1
        self.scheme.acts = [*acts[:place], act, *acts[place:]]
        self._record()

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

    def aim_at(self, time: float) -> None:
        """Let the steps that follow end exactly at `time` [s]."""
        self.state.target.fill_(time)
        self._aim()

    def resume(self) -> None:
        """Take up a state that was read from a checkpoint."""
        stale = bool(self.state.clock()["stale"])
        grown = self.neighbours.relist()
        self._bodies.move_points()
        self._bind(self._bodies.relist() or grown)
        self.state.stale.fill_(stale)
        self._pack()
        self.find_viscosity()

    def find_viscosity(self) -> None:
        """What outputs show besides the state, such as the apparent viscosity; no step reads it from here."""
        _launch(self._shown)

    # ---------------------------------------------------------------------------------------- lists, and what is bound

    def _rebuild(self) -> bool:
        """List neighbours where particles and bodies are now. Returns whether launches must be recorded again."""
        self._bodies.note_places()
        grown = self.neighbours.rebuild()
        return self._bodies.relist() or grown

    def _bind(self, grown: bool) -> None:
        if grown:
            self._record()

    def _record(self) -> None:
        """Bind every stage to the arrays as they are now."""
        self._loop = None
        self.stages: dict[str, Stage] = {}
        for act in self.scheme.acts:
            self.stages |= act.stages()
        self._settle, self._shown = self.scheme.settle(), self.scheme.show()

    def _pack(self) -> None:
        """What pair loops read, as the first stage packs it: with dt = 0."""
        next(iter(self.stages.values()))()
        _launch(self.scheme.pack())


def _launch(stages: Iterable[Stage]) -> None:
    for stage in stages:
        stage()
