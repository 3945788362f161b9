"""Wave gauges: the level of the free surface at places along the flume."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from warpsph.kernels.gauges import volume_fraction_kernel
from warpsph.kernels.instruments import find_tops
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.model import Model
from warpsph.placement.drawing import wall_surface
from warpsph.shapes.points import Array
from warpsph.shapes.wall import Wall
from warpsph.state import State
from warpsph.step.neighbours import Neighbours

SAMPLES_PER_SPACING = 2
# Fluid thinner than two spacings is spray or an overturning lip, and is looked through.
LEAST_SAMPLES = 2 * SAMPLES_PER_SPACING
# Water that outgrows a column gets one that is so many times as high.
GROWTH = 1.5


class Gauges:
    """The level at each gauge of a scene: where the volume fraction crosses one half, coming down from above."""

    def __init__(self, model: Model, state: State, neighbours: Neighbours) -> None:
        gauges, floor = model.scene.gauges, model.ground
        self.names = [gauge.name for gauge in gauges]
        self._step = model.spacing / SAMPLES_PER_SPACING
        if not gauges:
            return
        walls = [wall_surface(model.scene, i) for i in range(len(model.scene.walls))]
        self._walls, self._off = walls, wall_shares(model)
        self._places = np.array([(gauge.x, gauge.y or 0.0) for gauge in gauges])
        self._bottoms = [
            bed_below(gauge.x, gauge.y or 0.0, walls, model.sides, floor) if gauge.bottom is None else gauge.bottom
            for gauge in gauges
        ]
        self._model, self._state, self._cells = model, state, neighbours.cells
        device = model.launcher.device
        lines = np.column_stack([self._places, np.zeros(len(gauges))])
        self._lines = wp.array(lines, dtype=wp.vec3, device=device)
        self._tops = wp.zeros(len(gauges), dtype=float, device=device)
        self._reach(max(model.top, floor))

    def _reach(self, top: float) -> None:
        """Make the columns as high as `top` [m] and somewhat higher."""
        model, device = self._model, self._model.launcher.device
        lowest = min(self._bottoms)
        self._top = lowest + GROWTH * (top - lowest) + model.support
        self._heights = [
            np.arange(bottom, max(self._top, bottom + 1.5 * self._step), self._step) for bottom in self._bottoms
        ]
        points = [
            np.stack([np.full_like(z, x), np.full_like(z, y), z], axis=1)
            for (x, y), z in zip(self._places, self._heights, strict=True)
        ]
        # What of the kernel lies in a wall cannot be filled.
        self._room = []
        for some in points:
            distance = np.min([np.full(len(some), np.inf), *(wall.distance(some) for wall in self._walls)], axis=0)
            self._room.append(np.interp(distance, *self._off))
        self._points = wp.array(np.concatenate(points), dtype=wp.vec3, device=device)
        self._fraction = wp.zeros(len(self._points), dtype=float, device=device)
        self._record()

    def _record(self) -> None:
        """Bind the launches to the packed particles as they are now: they move when more ghosts need room."""
        model, self._read = self._model, self._state.position_volume
        reach, record = model.support + model.longest_motion, model.launcher.record
        self._find_fraction = record(
            volume_fraction_kernel(model.scene.smoothing.kernel),
            len(self._points),
            model,
            reach=reach,
            start=self._cells.start,
            point=self._points,
            position_volume=self._read,
            fraction=self._fraction,
        )
        self._find_tops = record(
            find_tops,
            len(self.names),
            model,
            across=model.support,
            reach=reach,
            fluid_count=len(model.fluid_names),
            start=self._cells.start,
            place=self._lines,
            position_volume=self._read,
            fluid=self._state.fluid,
            top=self._tops,
        )

    def levels(self) -> list[float]:
        """Level at each gauge [m]; the bottom of the gauge where it is dry."""
        if not self.names:
            return []
        if self._read is not self._state.position_volume:
            self._record()
        self._find_tops()
        top = float(self._tops.numpy().max())
        if top + self._model.support > self._top:
            self._reach(top)
        self._find_fraction()
        ends = np.cumsum([len(z) for z in self._heights])[:-1]
        fractions = np.split(self._fraction.numpy(), ends)
        columns = zip(self._heights, fractions, self._room, strict=True)
        return [surface(z, fraction / room, LEAST_SAMPLES) for z, fraction, room in columns]


def wall_shares(model: Model) -> tuple[Array, Array]:
    """Distances off a plane wall [m], and how much of the smoothing kernel lies before it there: from 1/2 to 1."""
    kernel, h = SMOOTHING[model.scene.smoothing.kernel], model.scene.smoothing_length
    q = np.linspace(0.0, kernel.support, 201)
    shape = np.array([float(kernel.shape(float(one))) for one in q])
    r = np.hypot.outer(q, q)
    around = 2.0 if model.scene.dimensions == 2 else 2.0 * np.pi * q
    across = np.trapezoid(around * np.interp(r, q, shape, right=0.0), q, axis=1)
    share = np.concatenate([[0.0], np.cumsum(0.5 * (across[1:] + across[:-1]))])
    return h * q, 0.5 + 0.5 * share / share[-1]


def bed_below(x: float, y: float, walls: Sequence[Wall], sides: Sequence[int], otherwise: float) -> float:
    """Height of the highest wall over which there may be fluid at (x, y) [m]; `otherwise` where there is none.

    `sides` are those of the walls on which the fluid is: a lid carries none.
    """
    found = [height for wall, side in zip(walls, sides, strict=True) for height in wall.floors(x, y, side)]
    return max(found, default=otherwise)


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
