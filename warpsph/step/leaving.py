"""Particles that leave: over the rim of a tank and beyond, or, where a scene says so, because they became absurd.

Nothing is taken out of an array, and no kernel asks who is gone: a particle that leaves is parked, at rest high above
the scene and out of reach of all others, as one of a fluid that nobody has, that is held, and that no sum counts. So a
run in which nothing leaves has the cost and the bits that it would have without this.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsph.kernels import clock
from warpsph.model import Model
from warpsph.state import State

# Parked particles stand so many list radii apart, and so far above all that is drawn.
APART, ABOVE = 2.0, 10.0
# When more than this share of all particles has become absurd, it is the physics that has.
MOST_DROPPED = 1e-3


@dataclass(frozen=True)
class Gone:
    """A particle that has left.

    Attributes:
        time: When [s].
        id: Its number.
        fluid: Index of its fluid.
        position: Where, counted from the scene's origin [m], shape [3].
        velocity: [m/s], shape [3].
        is_absurd: Whether it was dropped, and did not go by itself.
    """

    time: float
    id: int
    fluid: int
    position: np.ndarray
    velocity: np.ndarray
    is_absurd: bool


class Leaving:
    """Takes particles out of a state.

    Attributes:
        gone: Those that have left since this was made, in their order.
    """

    def __init__(self, model: Model, state: State, box: tuple[np.ndarray, np.ndarray]) -> None:
        """`box` is around all that is drawn: lower and upper corner [m]."""
        self._model, self._state = model, state
        self._low, self._high = box
        self.gone: list[Gone] = []
        self._dropped = 0

    @property
    def parked(self) -> int:
        """How many particles have left."""
        return int(np.count_nonzero(self._state.fluid.numpy() == len(self._model.fluid_names)))

    def let_go(self, drop_absurd: bool) -> bool:
        """Park what left the box in the step that stopped the clock, and absurd particles if these are to be dropped.

        Returns whether the run can go on; if not, nothing has been changed.
        """
        s, nobody = self._state, len(self._model.fluid_names)
        faults = s.particle_fault.numpy()
        slots = np.flatnonzero(faults != int(clock.SOUND))
        absurd = faults[slots] != int(clock.OUTSIDE)
        dropped = self._dropped + int(absurd.sum())
        if not len(slots) or (absurd.any() and not drop_absurd):
            return False
        if absurd.any() and dropped > max(1.0, MOST_DROPPED * self._model.particle_count):
            return False
        names = ("id", "fluid", "position", "velocity", "density")
        old = {name: getattr(s, name).numpy().copy() for name in names}
        time, first = float(s.clock()["time"]), int(np.count_nonzero(old["fluid"] == nobody))
        if first + len(slots) == self._model.particle_count:
            return False  # nothing would be left to run
        for k, slot in enumerate(slots):
            number, fluid, x, u = (old[name][slot].copy() for name in names[:4])
            self.gone.append(Gone(time, number, fluid, x, u, bool(absurd[k])))
        self._dropped = dropped
        old["fluid"][slots] = nobody
        old["position"][slots] = self._places(first, len(slots))
        old["velocity"][slots] = 0.0
        old["density"][slots] = self._model.parameters.rest_density.numpy()[nobody]
        for name in names[1:]:
            getattr(s, name).assign(old[name])
        for name in set(s.particle_names) - set(names):  # rates and whatever else a scheme keeps of them
            values = getattr(s, name).numpy()
            values[slots] = 0.0
            getattr(s, name).assign(values)
        s.particle_fault.zero_()
        s.fault.zero_()
        s.fault_slot.zero_()
        s.stale.fill_(1)  # the lists name particles that are no longer there
        return True

    def _places(self, first: int, count: int) -> np.ndarray:
        """Where to park `count` particles beyond the `first` ones [m], shape [count, 3]: in rows across the scene."""
        step = APART * self._model.list_radius
        size = np.maximum(((self._high - self._low) / step).astype(int), 1)
        deep = size[1] if self._model.scene.dimensions == 3 else 1
        k = first + np.arange(count)
        x = self._low[0] + step * (k % size[0])
        y = (
            self._low[1] + step * (k // size[0] % deep)
            if deep > 1
            else np.full(count, 0.5 * (self._low + self._high)[1])
        )
        z = self._high[2] + ABOVE * (self._high - self._low).max() + step * (k // (size[0] * deep))
        return np.stack([x, y, z], axis=1)
