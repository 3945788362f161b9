"""Sums over the fluid: energies, momentum and place of each fluid, block by block in a fixed order."""

import warp as wp

from .blocks import Blocks, item_of
from .parameters import Parameters
from .state_equation import internal_energy

# Columns of the block sums.
MASS = wp.constant(0)
KINETIC = wp.constant(1)
POTENTIAL = wp.constant(2)
INTERNAL = wp.constant(3)
MASS_X = wp.constant(4)  # and y, z: sum of m x
MASS_U = wp.constant(7)  # and v, w: sum of m u
DISSIPATED = wp.constant(10)
WALL_WORK = wp.constant(11)
DAMPED = wp.constant(12)
FRONT = wp.constant(13)  # not a sum: the largest x
TOP_SPEED = wp.constant(14)  # not a sum: the highest speed
COLUMN_COUNT = 15


@wp.kernel(enable_backward=False)
def sum_blocks(
    first: int,
    parameters: Parameters,
    blocks: Blocks,
    fluid_count: int,
    position: wp.array[wp.vec3d],
    velocity: wp.array[wp.vec3],
    density: wp.array[wp.float64],
    work: wp.array[wp.vec3d],
    fluid: wp.array[int],
    sums_out: wp.array2d[wp.float64],
):
    """Sums over one block of particles of one fluid: row block * fluid_count + fluid, columns as named above."""
    row = first + wp.tid()
    block = row // fluid_count
    mine = row - block * fluid_count
    gravity = wp.vec3d(parameters.gravity)
    mass = wp.float64(0.0)
    kinetic = wp.float64(0.0)
    potential = wp.float64(0.0)
    internal = wp.float64(0.0)
    mass_x = wp.vec3d()
    mass_u = wp.vec3d()
    done = work[block] if mine == 0 else wp.vec3d()  # a block's, of whatever fluids
    front = wp.float64(-wp.inf)
    top_speed = wp.float64(0.0)
    for k in range(blocks.size):
        i = item_of(blocks, block, k)
        if i < blocks.count and fluid[i] == mine:
            m = wp.float64(parameters.mass[mine])
            x, u = position[i], wp.vec3d(velocity[i])
            mass += m
            kinetic += wp.float64(0.5) * m * wp.dot(u, u)
            potential -= m * wp.dot(gravity, x)
            internal += m * internal_energy(
                density[i], parameters.rest_density[mine], parameters.sound_speed[mine], parameters.stiffening[mine]
            )
            mass_x += m * x
            mass_u += m * u
            front = wp.max(front, x[0])
            top_speed = wp.max(top_speed, wp.length(u))
    sums_out[row, MASS] = mass
    sums_out[row, KINETIC] = kinetic
    sums_out[row, POTENTIAL] = potential
    sums_out[row, INTERNAL] = internal
    for axis in range(3):
        sums_out[row, MASS_X + axis] = mass_x[axis]
        sums_out[row, MASS_U + axis] = mass_u[axis]
    sums_out[row, DISSIPATED] = done[0]
    sums_out[row, WALL_WORK] = done[1]
    sums_out[row, DAMPED] = done[2]
    sums_out[row, FRONT] = front
    sums_out[row, TOP_SPEED] = top_speed
