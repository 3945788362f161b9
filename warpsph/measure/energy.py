"""Energy budget, and the motion of each fluid as a whole."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
import warp as wp

from warpsph.kernels import energy as kernels
from warpsph.model import Model
from warpsph.state import State


@dataclass(frozen=True)
class Budget:
    """Energies of all fluids [J, or J/m in 2-D]; the last four are sums over time since the release."""

    kinetic: float
    potential: float
    internal: float
    dissipated: float  # by viscosity, the tensile correction and density diffusion
    wall_work: float  # done on the fluid by walls
    damped: float  # by the damping of a warm-up
    gone: float = 0.0  # with particles that left

    @property
    def total(self) -> float:
        """What must not change: kinetic + potential + internal + dissipated + damped + gone - wall work."""
        has = self.kinetic + self.potential + self.internal
        return has + self.dissipated + self.damped + self.gone - self.wall_work

    def parts(self) -> list[float]:
        """The seven parts in the order above."""
        return [getattr(self, part.name) for part in fields(self)]


@dataclass(frozen=True)
class FluidMotion:
    """One fluid as a whole.

    Attributes:
        mass: [kg, or kg/m in 2-D].
        center: Centre of gravity [m], shape [3].
        velocity: Of the centre of gravity [m/s], shape [3].
        front: Largest x of its particles [m].
        top_speed: Highest speed of its particles [m/s].
    """

    mass: float
    center: np.ndarray
    velocity: np.ndarray
    front: float
    top_speed: float


class Energy:
    """Sums over the particles of a state."""

    def __init__(self, model: Model, state: State) -> None:
        fluids, self._state = len(model.fluid_names), state
        rows = state.block_count * fluids
        self._sums = wp.zeros((rows, kernels.COLUMN_COUNT), dtype=wp.float64, device=model.launcher.device)
        self._shape = (state.block_count, fluids, kernels.COLUMN_COUNT)
        self._measure = model.launcher.record(
            kernels.sum_blocks, rows, model, state, fluid_count=fluids, sums=self._sums
        )

    def measure(self) -> tuple[Budget, list[FluidMotion]]:
        """The budget, and the motion of each fluid in the scene's order."""
        self._measure()
        blocks = self._sums.numpy().reshape(self._shape)
        fluids = blocks.sum(axis=0)
        total = fluids.sum(axis=0)
        present = Budget(*(float(total[k]) for k in _BUDGET_COLUMNS))
        budget = replace(present, gone=float(self._state.energy_gone.numpy()[0]))
        motions = [
            FluidMotion(
                mass=float(row[kernels.MASS]),
                # A fluid that has left as a whole is nowhere.
                center=row[_X] / row[kernels.MASS] if row[kernels.MASS] else np.full(3, np.nan),
                velocity=row[_U] / row[kernels.MASS] if row[kernels.MASS] else np.full(3, np.nan),
                front=float(blocks[:, f, kernels.FRONT].max()),
                top_speed=float(blocks[:, f, kernels.TOP_SPEED].max()),
            )
            for f, row in enumerate(fluids)
        ]
        return budget, motions


def drift_and_converted(record: Mapping[str, np.ndarray], at_stake: float = 0.0) -> tuple[float, float]:
    """How far the energy sum of the fluids strayed from its first value, and how much was converted [J or J/m].

    What was converted is the span of their potential energy, or of their kinetic energy where that is wider: water that
    a body or a paddle drives gets much of their energy, and little from its own height. Both are the same
    wherever heights count from.

    `record` holds the columns of an energy.csv, each of shape [row_count]; both are 0 without a row. Where it is less
    than a thousandth of `at_stake` [J or J/m], water is at rest: nothing is converted (0), and a share of that says
    nothing.
    """
    total, potential, kinetic = (
        next(record[name] for name in record if name.startswith(part)) for part in ("total", "potential", "kinetic")
    )
    if not len(total):
        return 0.0, 0.0
    converted = max(float(np.ptp(potential)), float(np.ptp(kinetic)))
    return float(np.abs(total - total[0]).max()), converted if converted > 1e-3 * at_stake else 0.0


_BUDGET_COLUMNS = (
    *(int(kernels.KINETIC), int(kernels.POTENTIAL), int(kernels.INTERNAL)),
    *(int(kernels.DISSIPATED), int(kernels.WALL_WORK), int(kernels.DAMPED)),
)
_X = slice(int(kernels.MASS_X), int(kernels.MASS_X) + 3)
_U = slice(int(kernels.MASS_U), int(kernels.MASS_U) + 3)
