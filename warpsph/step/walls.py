"""What walls do in a step, whatever they are made of: points that push, or dummy particles that have the pressure."""

from collections.abc import Sequence
from typing import Protocol

from warpsph.device.launch import Launch
from warpsph.kernels.walls import wall_acceleration_kernel
from warpsph.model import Model
from warpsph.state import State
from warpsph.step.act import Stage
from warpsph.step.bodies import Coupling, NoBodies
from warpsph.step.dummies import DummyLists
from warpsph.step.neighbours import Neighbours


class Walls(Protocol):
    """What a law of walls has to say in a step; each method gives launches, and none where it does nothing."""

    def press(self) -> Sequence[Stage]:
        """The pressure of the fluid, carried on into walls."""

    def book(self, weight: float) -> Sequence[Stage]:
        """The work of these pressures, over a `weight` of the step."""

    def push(self) -> Sequence[Launch]:
        """Forces of walls and bodies on the fluid, beside the pair loop."""

    def take_loads(self) -> Sequence[Stage]:
        """The reaction of the fluid on bodies."""

    def show(self) -> Sequence[Stage]:
        """Walls that move with bodies, as pair loops find them at the end of the step."""


class PointWalls:
    """Walls and bodies of points that push what comes near."""

    def __init__(self, model: Model, state: State, neighbours: Neighbours, bodies: Coupling | NoBodies) -> None:
        self._model, self._state, self._neighbours, self._bodies = model, state, neighbours, bodies

    def press(self) -> list[Stage]:
        """None."""
        return []

    def book(self, weight: float) -> list[Stage]:
        """None: the kick books it."""
        return []

    def push(self) -> list[Launch]:
        """The walls, then the bodies."""
        m, scene = self._model, self._model.scene
        force = scene.wall_model.force if scene.walls else "radial"  # without walls nothing pushes, by any law
        law = wall_acceleration_kernel(force, scene.smoothing.kernel, dimensions=scene.dimensions)
        at_rest = m.launcher.record(law, m.particle_count, m, self._state, self._neighbours)
        return [at_rest, *self._bodies.push_fluid()]

    def take_loads(self) -> list[Stage]:
        """By the same law."""
        return self._bodies.take_loads(self._neighbours.cells)

    def show(self) -> list[Stage]:
        """None."""
        return []


class DummyWalls:
    """Walls and bodies of dummy particles, which pair loops take for fluid."""

    def __init__(self, dummies: DummyLists, bodies: Coupling | None) -> None:
        self._dummies, self._bodies = dummies, bodies

    def press(self) -> list[Stage]:
        """Adami, Hu & Adams (2012)."""
        return [self._dummies.press]

    def book(self, weight: float) -> list[Stage]:
        """By the power that each dummy found."""
        return [self._dummies.book(weight)]

    def push(self) -> list[Launch]:
        """None: the pair loop does it."""
        return []

    def take_loads(self) -> list[Stage]:
        """With the pressure that dummies have."""
        return [self._dummies.take_loads()] if self._bodies else []

    def show(self) -> list[Stage]:
        """Where bodies are now."""
        return [self._dummies.show] if self._bodies else []
