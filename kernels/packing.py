"""Packing: particles drift down the gradient of their concentration until they stand evenly between walls.

    C_i = sum_j V_j W_ij,    dx_i = -PACE h^2 grad C_i

Colagrossi, Bouscasse, Antuono & Marrone (2012), without inertia. Where grad C = 0 a constant pressure leaves fluid at
rest, and so does one that grows with depth, to first order.
"""

from functools import cache

import warp as wp

from .smoothing import SMOOTHING

# Of h^2: a lattice that is pushed back by more overshoots.
PACE = wp.constant(0.2)
# No particle goes farther in one sweep, in spacings.
MOST_DRIFT = wp.constant(0.1)
# Nothing comes nearer to a mirror, in spacings: where water thins out there is no room for all of it.
LEAST_DEPTH = wp.constant(0.3)


@cache
def pack_kernel(smoothing: str) -> wp.Kernel:
    """A kernel that takes one sweep of packing."""
    slope, support = SMOOTHING[smoothing].slope, SMOOTHING[smoothing].support

    @wp.kernel(module="unique", enable_backward=False)
    def pack(
        first: int,
        grid: wp.uint64,
        h: float,
        gradient_norm: float,
        spacing: float,
        in_plane: int,
        plane_normal: wp.array[wp.vec3],
        plane_offset: wp.array[float],
        position: wp.array[wp.vec3],
        volume: wp.array[float],
        mobility: wp.array[float],
        position_out: wp.array[wp.vec3],
    ):
        """Where point i goes; points of `mobility` 0 are walls, which stay, and those that are less than 0 stay too.

        A plane is a mirror, in which fluid sees its image: what stands still in the water is no wall's but its own.
        """
        i = first + wp.tid()
        x_i = position[i]
        if mobility[i] <= 0.0:
            position_out[i] = x_i
            return
        reach = support * h
        gradient = wp.vec3()
        for j in wp.hash_grid_query(grid, x_i, reach):
            x_j = position[j]
            x_ij = x_i - x_j
            gradient += volume[j] * slope(wp.length(x_ij) / h) * x_ij
            if mobility[j] != 0.0:
                for k in range(plane_offset.shape[0]):
                    n = plane_normal[k]
                    behind = wp.dot(x_j, n) - plane_offset[k]
                    if wp.abs(wp.dot(x_i, n) - plane_offset[k]) + wp.abs(behind) < reach:
                        x_ij = x_i - (x_j - 2.0 * behind * n)
                        gradient += volume[j] * slope(wp.length(x_ij) / h) * x_ij
        drift = -PACE * h * h * gradient_norm * gradient
        if in_plane != 0:
            drift[1] = 0.0
        drift *= wp.min(1.0, MOST_DRIFT * spacing / wp.max(wp.length(drift), 1.0e-12))
        x = x_i + drift
        for k in range(plane_offset.shape[0]):
            n = plane_normal[k]
            side = wp.sign(wp.dot(x_i, n) - plane_offset[k])
            x += side * wp.max(LEAST_DEPTH * spacing - side * (wp.dot(x, n) - plane_offset[k]), 0.0) * n
        position_out[i] = x

    return pack
