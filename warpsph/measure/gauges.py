"""Wave gauges: the level of the free surface at places along the flume."""

import numpy as np
import warp as wp

from warpsph.kernels.gauges import volume_fraction_kernel
from warpsph.model import Model
from warpsph.state import State
from warpsph.step.neighbours import Neighbours

SAMPLES_PER_SPACING = 2
# Fluid thinner than two spacings is spray or an overturning lip, and is looked through.
LEAST_SAMPLES = 2 * SAMPLES_PER_SPACING


class Gauges:
    """The level at each gauge of a scene: where the volume fraction crosses one half, coming down from above."""

    def __init__(self, model: Model, state: State, neighbours: Neighbours) -> None:
        gauges, floor = model.scene.gauges, model.ground
        self.names = [gauge.name for gauge in gauges]
        self._step = model.spacing / SAMPLES_PER_SPACING
        # As high as the fluid could ever rise without energy from outside, and half as much again.
        top = floor + 1.5 * (model.top - floor) + 4.0 * model.spacing
        self._heights = [self._column(floor if gauge.bottom is None else gauge.bottom, top) for gauge in gauges]
        if not gauges:
            return
        points = [
            np.stack([np.full_like(z, gauge.x), np.full_like(z, gauge.y or 0.0), z], axis=1)
            for gauge, z in zip(gauges, self._heights, strict=True)
        ]
        self._model, self._state, self._cells = model, state, neighbours.cells
        device = model.launcher.device
        self._points = wp.array(np.concatenate(points), dtype=wp.vec3, device=device)
        self._fraction = wp.zeros(len(self._points), dtype=float, device=device)
        self._record()

    def _record(self) -> None:
        """Bind the launch to the packed particles as they are now: they move when more ghosts need room."""
        model, self._read = self._model, self._state.position_volume
        self._find_fraction = model.launcher.record(
            volume_fraction_kernel(model.scene.smoothing.kernel),
            len(self._points),
            model,
            reach=model.support + model.longest_motion,
            start=self._cells.start,
            point=self._points,
            position_volume=self._read,
            fraction=self._fraction,
        )

    def _column(self, bottom: float, top: float) -> np.ndarray:
        """Heights at which a gauge looks [m]: two at least, so that one above all fluid is dry."""
        return np.arange(bottom, max(top, bottom + 1.5 * self._step), self._step)

    def levels(self) -> list[float]:
        """Level at each gauge [m]; the bottom of the gauge where it is dry."""
        if not self.names:
            return []
        if self._read is not self._state.position_volume:
            self._record()
        self._find_fraction()
        ends = np.cumsum([len(z) for z in self._heights])[:-1]
        fractions = np.split(self._fraction.numpy(), ends)
        return [surface(z, fraction, LEAST_SAMPLES) for z, fraction in zip(self._heights, fractions, strict=True)]


def surface(heights: np.ndarray, fraction: np.ndarray, thick: int) -> float:
    """Height [m] of the highest crossing of one half that has `thick` full samples in a row below it.

    `heights` [m] rise evenly; `fraction` is the volume fraction there, same shape [n].
    """
    full = fraction >= 0.5
    run = np.convolve(full, np.ones(thick, dtype=int))[: len(full)]
    tops = np.flatnonzero(run == thick)
    if not len(tops):
        return float(heights[0])
    k = tops[-1]
    if k + 1 == len(heights):
        return float(heights[-1])
    share = (fraction[k] - 0.5) / (fraction[k] - fraction[k + 1])
    return float(heights[k] + share * (heights[1] - heights[0]))
