"""Neighbours: physical order by cell, Verlet lists of fluid neighbours (Vasco 2014, section 4.2) and of wall points."""

from functools import cache
from typing import Any

import warp as wp

from .parameters import Parameters


@wp.kernel(enable_backward=False)
def round_position(first: int, position: wp.array[wp.vec3d], rounded_out: wp.array[wp.vec3]):
    """Position rounded to single precision, for the grid and as the place from which motion is measured [m]."""
    i = first + wp.tid()
    rounded_out[i] = wp.vec3(position[i])


@wp.kernel(enable_backward=False)
def cell_order(first: int, grid: wp.uint64, order_out: wp.array[int]):
    """order[new slot] = old slot, sorted by cell; the sort is stable, so the order is reproducible."""
    i = first + wp.tid()
    order_out[i] = wp.hash_grid_point_id(grid, i)


@cache
def gather_kernel(dtype: Any) -> wp.Kernel:
    """A kernel that permutes one array of `dtype`."""

    @wp.kernel(module="unique", enable_backward=False)
    def gather(first: int, order: wp.array[int], values: wp.array[dtype], values_out: wp.array[dtype]):
        """values_out[i] = values[order[i]]."""
        i = first + wp.tid()
        values_out[i] = values[order[i]]

    return gather


@wp.kernel(enable_backward=False)
def list_neighbours(
    first: int,
    grid: wp.uint64,
    parameters: Parameters,
    position: wp.array[wp.vec3],
    count_out: wp.array[int],
    list_out: wp.array[int],
):
    """All particles closer than the list radius. A count that reaches the capacity says that the row was cut short.

    Every candidate is written, and the next one over it unless it was a neighbour: off the lattice a jump is
    mispredicted every other time, which costs more than a store. So a row has one place more than it may fill, and a
    single comparison tells neighbours, leaving out i itself and whoever stands exactly where i does: between those no
    force has a direction.
    """
    i = first + wp.tid()
    x_i = position[i]
    radius = parameters.list_radius
    row = i * parameters.row_stride
    count = int(0)
    for j in wp.hash_grid_query(grid, x_i, radius):
        x_ij = x_i - position[j]
        place = wp.min(count, parameters.list_capacity - 1)
        list_out[row + place * parameters.column_stride] = j
        square = wp.dot(x_ij, x_ij)
        count += wp.where(square * (radius * radius - square) > 0.0, 1, 0)
    count_out[i] = count


@wp.kernel(enable_backward=False)
def count_wall_points(
    first: int,
    wall_grid: wp.uint64,
    parameters: Parameters,
    position: wp.array[wp.vec3],
    wall_position: wp.array[wp.vec3],
    count_out: wp.array[int],
):
    """How many wall points lie within the list radius of each particle."""
    i = first + wp.tid()
    x_i = position[i]
    radius = parameters.list_radius
    count = int(0)
    for k in wp.hash_grid_query(wall_grid, x_i, radius):
        x_ik = x_i - wall_position[k]
        if wp.dot(x_ik, x_ik) < radius * radius:
            count += 1
    count_out[i] = count


@wp.kernel(enable_backward=False)
def list_wall_points(
    first: int,
    wall_grid: wp.uint64,
    parameters: Parameters,
    position: wp.array[wp.vec3],
    wall_position: wp.array[wp.vec3],
    wall_first: wp.array[int],
    list_out: wp.array[int],
):
    """The wall points of particle i, at list[first[i] : first[i + 1]]."""
    i = first + wp.tid()
    x_i = position[i]
    radius = parameters.list_radius
    n = wall_first[i]
    if n < wall_first[i + 1]:
        for k in wp.hash_grid_query(wall_grid, x_i, radius):
            x_ik = x_i - wall_position[k]
            if wp.dot(x_ik, x_ik) < radius * radius:
                list_out[n] = k
                n += 1
