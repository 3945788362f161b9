"""Leaks: on which side of the walls a particle is."""

import warp as wp

from .neighbours import CellGrid, cell_at

UNKNOWN, IN_FRONT, BEHIND = wp.constant(0), wp.constant(1), wp.constant(2)


@wp.kernel(enable_backward=False)
def find_side(
    first: int,
    grid: CellGrid,
    radius: float,
    start: wp.array[int],
    wall_position: wp.array[wp.vec3],
    wall_normal: wp.array[wp.vec3],
    position: wp.array[wp.vec3d],
    side_inout: wp.array[wp.uint8],
):
    """The side of the nearest wall point, (x - x_wall) . n, where that is within `radius` [m] and not known yet.

    `radius` is at most as many cells as the rim of the grid is wide.
    """
    i = first + wp.tid()
    if int(side_inout[i]) == UNKNOWN:
        x = wp.vec3(position[i])
        k, reach = cell_at(grid, x), grid.reach
        nearest, slot = radius * radius, int(-1)
        for kz in range(k[2] - reach[2], k[2] + reach[2] + 1):
            for ky in range(k[1] - reach[1], k[1] + reach[1] + 1):
                row = (kz * grid.count[1] + ky) * grid.count[0] + k[0]
                for j in range(start[row - reach[0]], start[row + reach[0] + 1]):
                    gap = wp.length_sq(x - wall_position[j])
                    if gap < nearest:
                        nearest, slot = gap, j
        if slot >= 0:
            side = IN_FRONT
            if wp.dot(x - wall_position[slot], wall_normal[slot]) < 0.0:
                side = BEHIND
            side_inout[i] = wp.uint8(side)
