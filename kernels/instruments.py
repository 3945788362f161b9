"""Instruments: what probes see of the fluid around them, how high it stands over a place, what passes a line.

All of it is read between steps. Cells hold the particles where these were listed: `reach` [m] is the support and how
far they may have gone since.
"""

from functools import cache

import warp as wp

from .blocks import Blocks, item_of
from .neighbours import CellGrid, cell_at
from .parameters import Parameters
from .smoothing import SMOOTHING
from .state_equation import pressure

# What a probe sums: sum_j V_j W_j (1, x, y, z), then of the second moments, then of p, u, v and w with (1, x, y, z).
SUMS = 26
Sums = wp.types.vector(length=SUMS, dtype=float)


@cache
def probe_kernel(smoothing: str) -> wp.Kernel:
    """A kernel that sums what a first-order interpolation at points of space is made of."""
    shape = SMOOTHING[smoothing].shape

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        first: int,
        grid: CellGrid,
        parameters: Parameters,
        reach: float,
        start: wp.array[int],
        point: wp.array[wp.vec3],
        normal: wp.array[wp.vec3],
        position_volume: wp.array[wp.vec4],
        velocity: wp.array[wp.vec3],
        density: wp.array[wp.float64],
        fluid: wp.array[int],
        sums_out: wp.array2d[float],
    ):
        """Sums of V_j W_j (1, r) (1, r) and V_j W_j (1, r) (p, u, v, w), r = (x_j - x) / h, over the fluid around a
        point. A point with a normal sees no further behind itself than a tenth of h."""
        i = first + wp.tid()
        x, n = point[i], normal[i]
        low, high = cell_at(grid, x - wp.vec3(reach)), cell_at(grid, x + wp.vec3(reach))
        s = Sums()
        for kz in range(low[2], high[2] + 1):
            for ky in range(low[1], high[1] + 1):
                row = (kz * grid.count[1] + ky) * grid.count[0]
                for j in range(start[row + low[0]], start[row + high[0] + 1]):
                    xV = position_volume[j]
                    r = parameters.inverse_h * (wp.vec3(xV[0], xV[1], xV[2]) - x)
                    w = xV[3] * parameters.kernel_norm * shape(wp.length(r))
                    if w > 0.0 and wp.dot(r, n) > -0.1:
                        f = fluid[j]
                        rho, u = density[j], velocity[j]
                        p = pressure(
                            rho, parameters.rest_density[f], parameters.sound_speed[f], parameters.stiffening[f]
                        )
                        s[0] += w
                        for a in range(3):
                            s[1 + a] += w * r[a]
                            s[4 + a] += w * r[a] * r[a]
                        s[7] += w * r[0] * r[1]
                        s[8] += w * r[0] * r[2]
                        s[9] += w * r[1] * r[2]
                        values = wp.vec4(p, u[0], u[1], u[2])
                        for k in range(4):
                            s[10 + 4 * k] += w * values[k]
                            for a in range(3):
                                s[11 + 4 * k + a] += w * r[a] * values[k]
        for k in range(SUMS):
            sums_out[i, k] = s[k]

    return probe


@wp.kernel(enable_backward=False)
def find_tops(
    first: int,
    grid: CellGrid,
    across: float,
    reach: float,
    fluid_count: int,
    start: wp.array[int],
    place: wp.array[wp.vec3],
    position_volume: wp.array[wp.vec4],
    fluid: wp.array[int],
    top_out: wp.array[float],
):
    """Height of the highest particle within `across` [m] of an upright line [m], minus infinity where there is none."""
    i = first + wp.tid()
    x = place[i]
    low = cell_at(grid, wp.vec3(x[0] - reach, x[1] - reach, -1.0e30))
    high = cell_at(grid, wp.vec3(x[0] + reach, x[1] + reach, 1.0e30))
    top = float(-wp.inf)
    for kz in range(low[2], high[2] + 1):
        for ky in range(low[1], high[1] + 1):
            row = (kz * grid.count[1] + ky) * grid.count[0]
            for j in range(start[row + low[0]], start[row + high[0] + 1]):
                xV = position_volume[j]
                is_near = wp.abs(xV[0] - x[0]) < across and wp.abs(xV[1] - x[1]) < across
                if is_near and fluid[j] < fluid_count:  # not one that has left
                    top = wp.max(top, xV[2])
    top_out[i] = top


@wp.struct
class Gates:
    """Plane rectangles that fluid may pass; arrays have one entry for each."""

    count: int
    corner: wp.array[wp.vec3d]  # [m]
    along: wp.array[wp.vec3d]  # one side of it [m]
    up: wp.array[wp.vec3d]  # the other, square to that; in a plane of no meaning, (0, 1, 0) [m]
    normal: wp.array[wp.vec3d]  # unit normal: what passes along it counts as positive


@wp.kernel(enable_backward=False)
def count_passing(
    first: int,
    parameters: Parameters,
    blocks: Blocks,
    gates: Gates,
    fluid_count: int,
    position: wp.array[wp.vec3d],
    last_position: wp.array[wp.vec3d],
    fluid: wp.array[int],
    passed_out: wp.array2d[wp.float64],
):
    """Volume [m3, in 2-D m2] of the particles of a block that passed each gate since they were looked at last.

    A particle passes where the straight line from there to here crosses the rectangle. All arrays are in id order.
    """
    block = first + wp.tid()
    zero, one = wp.float64(0.0), wp.float64(1.0)
    for g in range(gates.count):
        n, corner = gates.normal[g], gates.corner[g]
        a, b = gates.along[g], gates.up[g]
        total = wp.float64(0.0)
        for k in range(blocks.size):
            i = item_of(blocks, block, k)
            if i < blocks.count:
                x, old = position[i], last_position[i]
                before, now = wp.dot(old - corner, n), wp.dot(x - corner, n)
                if (before < zero) != (now < zero) and fluid[i] < fluid_count:  # not where those are that have left
                    at = old + (before / (before - now)) * (x - old) - corner
                    s, t = wp.dot(at, a) / wp.dot(a, a), wp.dot(at, b) / wp.dot(b, b)
                    if s >= zero and s < one and t >= zero and t < one:
                        V = wp.float64(parameters.mass[fluid[i]] / parameters.rest_density[fluid[i]])
                        total += wp.where(before < zero, V, -V)
        passed_out[block, g] = total


@wp.kernel(enable_backward=False)
def add_passed(first: int, block_count: int, passed: wp.array2d[wp.float64], volume_inout: wp.array[wp.float64]):
    """The volume that has passed gate g since the start [m3, in 2-D m2], blocks in order."""
    g = first + wp.tid()
    total = volume_inout[g]
    for block in range(block_count):
        total += passed[block, g]
    volume_inout[g] = total
