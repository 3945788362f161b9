"""Gauges: how full space is along a vertical line."""

from functools import cache

import warp as wp

from .neighbours import CellGrid, cell_at
from .parameters import Parameters
from .smoothing import SMOOTHING


@cache
def volume_fraction_kernel(smoothing: str) -> wp.Kernel:
    """The sum of V_j W at points of space: 1 inside the fluid, 1/2 on its surface, about 1/4 at a lone drop."""
    shape = SMOOTHING[smoothing].shape

    @wp.kernel(module="unique", enable_backward=False)
    def volume_fraction(
        first: int,
        grid: CellGrid,
        parameters: Parameters,
        reach: float,
        start: wp.array[int],
        point: wp.array[wp.vec3],
        position_volume: wp.array[wp.vec4],
        fraction_out: wp.array[float],
    ):
        """Volume fraction of all fluids together, sum_j V_j W(|x - x_j|).

        Cells hold the particles where these were listed: `reach` [m] is the support and how far they may have gone.
        """
        i = first + wp.tid()
        x = point[i]
        low, high = cell_at(grid, x - wp.vec3(reach)), cell_at(grid, x + wp.vec3(reach))
        fraction = float(0.0)
        for kz in range(low[2], high[2] + 1):
            for ky in range(low[1], high[1] + 1):
                row = (kz * grid.count[1] + ky) * grid.count[0]
                for j in range(start[row + low[0]], start[row + high[0] + 1]):
                    xV_j = position_volume[j]
                    r = wp.length(x - wp.vec3(xV_j[0], xV_j[1], xV_j[2]))
                    fraction += xV_j[3] * parameters.kernel_norm * shape(r * parameters.inverse_h)
        fraction_out[i] = fraction

    return volume_fraction
