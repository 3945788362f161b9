"""Neighbours: cells, physical order by cell, Verlet lists (Vasco 2014, section 4.2), and how long they stay good."""

from functools import cache
from typing import Any

import warp as wp

from .blocks import Blocks, item_of
from .layout import Layout, Rows
from .parameters import Parameters

# Edge of a block of cells, in cells. Two particles in blocks that do not touch are farther apart than this.
BLOCK_EDGE = wp.constant(3)


@wp.struct
class CellGrid:
    """A box of cells. Those along its shortest axis follow each other: a row of them is one run of slots.

    Short rows keep the slots of neighbours close together, and so in the cache. Axes are counted from the shortest.
    Whatever lies outside the box counts to its outermost cells. Around them is a rim of empty ones, `reach` wide, so
    that nobody need ask whether there is a next cell.
    """

    axes: wp.vec3i  # 0, 1, 2 for x, y, z, in the order in which cells are counted
    origin: wp.vec3  # lower corner of the first cell within the rim [m]
    inverse_edge: float  # [1/m]
    reach: wp.vec3i  # cells that a list may reach to each side; 0 across a plane
    inner: wp.vec3i  # cells within the rim
    count: wp.vec3i  # cells, rim included
    blocks: wp.vec3i  # blocks of cells


@wp.func
def cell_along(x: float, origin: float, inverse_edge: float, reach: int, inner: int) -> int:
    """Number of the cell along one axis; clamped before it is made an integer, so that any x will do."""
    return int(wp.clamp(wp.floor((x - origin) * inverse_edge), 0.0, float(inner - 1))) + reach


@wp.func
def cell_at(grid: CellGrid, x: wp.vec3) -> wp.vec3i:
    """Place in its row, row and layer of the cell in which x lies."""
    origin, axes = grid.origin, grid.axes
    return wp.vec3i(
        cell_along(x[axes[0]], origin[0], grid.inverse_edge, grid.reach[0], grid.inner[0]),
        cell_along(x[axes[1]], origin[1], grid.inverse_edge, grid.reach[1], grid.inner[1]),
        cell_along(x[axes[2]], origin[2], grid.inverse_edge, grid.reach[2], grid.inner[2]),
    )


@wp.func
def cell_number(grid: CellGrid, x: wp.vec3) -> int:
    """Number of the cell in which x lies."""
    k = cell_at(grid, x)
    return (k[2] * grid.count[1] + k[1]) * grid.count[0] + k[0]


@wp.func
def row_offset(grid: CellGrid, row: int) -> int:
    """From a cell to the cell at the same place in one of the rows around, in the order in which lists are filled."""
    across = 2 * grid.reach[2] + 1
    b = row / across
    a = row - b * across
    return ((a - grid.reach[2]) * grid.count[1] + b - grid.reach[1]) * grid.count[0]


@wp.func
def place_of(number: int, count: wp.vec3i) -> wp.vec3i:
    """Place in its row, row and layer of a cell or block by its number; `count` of them lie along each axis."""
    row = number / count[0]
    layer = row / count[1]
    return wp.vec3i(number - row * count[0], row - layer * count[1], layer)


@wp.kernel(enable_backward=False)
def round_position(first: int, position: wp.array[wp.vec3d], rounded_out: wp.array[wp.vec3]):
    """Position rounded to single precision, for the cells and as the place from which motion is measured [m]."""
    i = first + wp.tid()
    rounded_out[i] = wp.vec3(position[i])


@wp.kernel(enable_backward=False)
def find_cells(
    first: int, grid: CellGrid, position: wp.array[wp.vec3], cell_out: wp.array[int], order_out: wp.array[int]
):
    """The cell of each point, and the identity permutation to be sorted with it."""
    i = first + wp.tid()
    cell_out[i] = cell_number(grid, position[i])
    order_out[i] = i


@wp.kernel(enable_backward=False)
def find_starts(first: int, count: int, cell_count: int, cell: wp.array[int], start_out: wp.array[int]):
    """start[c] = first slot of cell c, in slots sorted by cell; start[cell_count] = count."""
    i = first + wp.tid()
    before = int(-1)
    if i > 0:
        before = cell[i - 1]
    for c in range(before + 1, cell[i] + 1):
        start_out[c] = i
    if i == count - 1:
        for c in range(cell[i] + 1, cell_count + 1):
            start_out[c] = count


@wp.kernel(enable_backward=False)
def search_starts(first: int, count: int, cell: wp.array[int], start_out: wp.array[int]):
    """The same, each cell by itself: where most cells are empty `find_starts` lets one thread write very many."""
    c = first + wp.tid()
    # Beyond them all wp.lower_bound stops one short.
    start_out[c] = wp.where(c > cell[count - 1], count, wp.lower_bound(cell, 0, count, c))


@cache
def gather_kernel(dtype: Any) -> wp.Kernel:
    """A kernel that permutes one array of `dtype`."""

    @wp.kernel(module="unique", enable_backward=False)
    def gather(first: int, order: wp.array[int], values: wp.array[dtype], values_out: wp.array[dtype]):
        """values_out[i] = values[order[i]]."""
        i = first + wp.tid()
        values_out[i] = values[order[i]]

    return gather


@cache
def scatter_kernel(dtype: Any) -> wp.Kernel:
    """A kernel that undoes a permutation of one array of `dtype`."""

    @wp.kernel(module="unique", enable_backward=False)
    def scatter(first: int, place: wp.array[int], values: wp.array[dtype], values_out: wp.array[dtype]):
        """values_out[place[i]] = values[i]; no two have the same place."""
        i = first + wp.tid()
        values_out[place[i]] = values[i]

    return scatter


@cache
def copy_kernel(dtype: Any) -> wp.Kernel:
    """A kernel that copies one array of `dtype`, with as many threads as others have."""

    @wp.kernel(module="unique", enable_backward=False)
    def copy(first: int, values: wp.array[dtype], values_out: wp.array[dtype]):
        """values_out[i] = values[i]."""
        i = first + wp.tid()
        values_out[i] = values[i]

    return copy


@wp.func
def last_entry(parameters: Parameters, rows: Rows, longer: int) -> int:
    """How many entries a row may have, less than it has room for by one; `longer` is its long_row."""
    return wp.where(longer < 0, parameters.list_capacity, rows.long_capacity) - 1


@wp.kernel(enable_backward=False)
def find_cut_rows(
    first: int,
    parameters: Parameters,
    particle_count: int,
    rows: Rows,
    count: wp.array[int],
    cut_out: wp.array[int],
):
    """1 where a row is a longer one or may have been cut short, else 0; and 0 behind them all."""
    i = first + wp.tid()
    cut_out[i] = 0
    if i < particle_count:
        longer = rows.long_row[i]
        if longer >= 0 or count[i] >= last_entry(parameters, rows, longer):
            cut_out[i] = 1


@wp.kernel(enable_backward=False)
def number_long_rows(first: int, cut: wp.array[int], long_row_out: wp.array[int]):
    """The longer rows in order of their particles; `cut` counts the rows before each that `find_cut_rows` found."""
    i = first + wp.tid()
    long_row_out[i] = wp.where(cut[i + 1] > cut[i], cut[i], -1)


@cache
def list_kernel(layout: Layout) -> wp.Kernel:
    """A kernel that fills the lists, which lie by column or by row."""
    set_entry = layout.set_entry

    @wp.kernel(module="unique", enable_backward=False)
    def list_neighbours(
        first: int,
        grid: CellGrid,
        parameters: Parameters,
        again: int,
        start: wp.array[int],
        cell: wp.array[int],
        position: wp.array[wp.vec3],
        count_out: wp.array[int],
        list_out: Rows,
        too_long_out: wp.array[int],
    ):
        """All particles closer than the list radius; `too_long_out[0]` is set where a row may have been cut short.

        The second time, if there is one, `again` is 1, and only the longer rows are filled.

        Every candidate is written, and the next one over it unless it was a neighbour: off the lattice a jump is
        mispredicted every other time, which costs more than a store. So a row has one place more than it may fill, and
        a single comparison tells neighbours, leaving out i itself and particles exactly at its place: to these
        no force has a direction.
        """
        i = first + wp.tid()
        x_i, cell_i = position[i], cell[i]
        square_radius = parameters.list_radius * parameters.list_radius
        along, row_cells, layer_cells = grid.reach[0], grid.count[0], grid.count[0] * grid.count[1]
        longer = list_out.long_row[i]
        last = last_entry(parameters, list_out, longer)
        if longer >= 0 or again == 0:
            k = int(0)
            for b in range(-grid.reach[1], grid.reach[1] + 1):
                for a in range(-grid.reach[2], grid.reach[2] + 1):
                    middle = cell_i + a * layer_cells + b * row_cells
                    j = start[middle - along]
                    end = start[middle + along + 1]
                    while j < end:
                        x_ij = x_i - position[j]
                        set_entry(list_out, longer, i, k, j)
                        square = wp.dot(x_ij, x_ij)
                        is_near = square * (square_radius - square) > 0.0
                        k = wp.min(k + wp.where(is_near, 1, 0), last)
                        j += 1
            count_out[i] = k
            if k == last:
                too_long_out[0] = 1

    return list_neighbours


@wp.kernel(enable_backward=False)
def mark_walls(
    first: int,
    grid: CellGrid,
    cells: int,
    wall_start: wp.array[int],
    near_wall_out: wp.array[wp.uint8],
):
    """Whether there are wall points in a cell or within so many `cells` of it: most particles need not look for any."""
    i = first + wp.tid()
    place = place_of(i, grid.count)
    x, y, z = place[0], place[1], place[2]
    found = int(0)
    for kz in range(wp.max(z - cells, 0), wp.min(z + cells + 1, grid.count[2])):
        for ky in range(wp.max(y - cells, 0), wp.min(y + cells + 1, grid.count[1])):
            begin = (kz * grid.count[1] + ky) * grid.count[0]
            low, high = wp.max(x - cells, 0), wp.min(x + cells, grid.count[0] - 1)
            found += wall_start[begin + high + 1] - wall_start[begin + low]
    near_wall_out[i] = wp.uint8(wp.min(found, 1))


@cache
def wall_points_kernel(listing: bool) -> wp.Kernel:
    """A kernel that counts the wall points near each particle, or lists them once it is known where.

    Both take the same arguments: the one writes the counts, the other the list.
    """
    counting = not listing

    @wp.kernel(module="unique", enable_backward=False)
    def wall_points(
        first: int,
        grid: CellGrid,
        radius: float,
        near_wall: wp.array[wp.uint8],
        wall_start: wp.array[int],
        cell: wp.array[int],
        position: wp.array[wp.vec3],
        wall_position: wp.array[wp.vec3],
        wall_first: wp.array[int],
        count_out: wp.array[int],
        list_out: wp.array[int],
    ):
        """The wall points within `radius` [m] of particle i, at list[first[i] : first[i + 1]]."""
        i = first + wp.tid()
        n = int(0)
        if wp.static(listing):
            n = wall_first[i]
        if near_wall[cell[i]] > wp.uint8(0):
            x_i = position[i]
            low, high = cell_at(grid, x_i - wp.vec3(radius)), cell_at(grid, x_i + wp.vec3(radius))
            for kz in range(low[2], high[2] + 1):
                for ky in range(low[1], high[1] + 1):
                    row = (kz * grid.count[1] + ky) * grid.count[0]
                    for k in range(wall_start[row + low[0]], wall_start[row + high[0] + 1]):
                        x_ik = x_i - wall_position[k]
                        if wp.dot(x_ik, x_ik) < radius * radius:
                            if wp.static(listing):
                                list_out[n] = k
                            n += 1
        if wp.static(counting):
            count_out[i] = n

    return wall_points


@wp.kernel(enable_backward=False)
def bound_motion(
    first: int,
    grid: CellGrid,
    lookahead: float,
    start: wp.array[int],
    dt: wp.array[float],
    position_volume: wp.array[wp.vec4],
    velocity: wp.array[wp.vec3],
    acceleration: wp.array[wp.vec3],
    listed_position: wp.array[wp.vec3],
    lower_out: wp.array[wp.vec3],
    upper_out: wp.array[wp.vec3],
):
    """Bounds of how far the particles of each block will have moved since they were listed, `lookahead` steps on [m].

    An empty block has its lower bound above the upper one.
    """
    block = first + wp.tid()
    place = place_of(block, grid.blocks)
    bx, by, bz = place[0], place[1], place[2]
    step = lookahead * dt[0]
    lower, upper = wp.vec3(wp.inf), wp.vec3(-wp.inf)
    for z in range(bz * BLOCK_EDGE, wp.min((bz + 1) * BLOCK_EDGE, grid.count[2])):
        for y in range(by * BLOCK_EDGE, wp.min((by + 1) * BLOCK_EDGE, grid.count[1])):
            cells = (z * grid.count[1] + y) * grid.count[0]
            begin = start[cells + bx * BLOCK_EDGE]
            end = start[cells + wp.min((bx + 1) * BLOCK_EDGE, grid.count[0])]
            for i in range(begin, end):
                xV = position_volume[i]
                now = wp.vec3(xV[0], xV[1], xV[2]) - listed_position[i]
                soon = now + step * (velocity[i] + step * acceleration[i])
                lower = wp.min(lower, soon)
                upper = wp.max(upper, soon)
    lower_out[block] = lower
    upper_out[block] = upper


@wp.kernel(enable_backward=False)
def compare_motion(
    first: int,
    grid: CellGrid,
    skin: float,
    wall_skin: float,
    support: float,
    wall_block: wp.array[int],
    lower: wp.array[wp.vec3],
    upper: wp.array[wp.vec3],
    strain_out: wp.array[float],
):
    """How much of the motion that the lists allow has been used up about each block; above 1 a pair may be missing.

    Two particles that are not on each other's list come within the support only by moving, relative to each other, by
    more than the skin if their blocks touch, by more than edge - support if one block lies between, and by more than
    2 edge - support if two do [m]. What moves together as a whole needs no new list until it has gone that far, unless
    it passes a wall: that stands still, and is listed with a skin of its own.
    """
    block = first + wp.tid()
    least, most = wp.vec3(lower[block]), wp.vec3(upper[block])
    strain = float(0.0)
    if least[0] <= most[0]:
        place = place_of(block, grid.blocks)
        bx, by, bz = place[0], place[1], place[2]
        edge = float(BLOCK_EDGE) / grid.inverse_edge
        alone = wp.length(wp.max(-least, most))
        strain = 2.0 * alone / (2.0 * edge - support)
        ring = wp.where(2.0 * alone > edge - support, 2, 1)
        for z in range(wp.max(bz - ring, 0), wp.min(bz + ring + 1, grid.blocks[2])):
            for y in range(wp.max(by - ring, 0), wp.min(by + ring + 1, grid.blocks[1])):
                for x in range(wp.max(bx - ring, 0), wp.min(bx + ring + 1, grid.blocks[0])):
                    other = (z * grid.blocks[1] + y) * grid.blocks[0] + x
                    touch = wp.max(wp.max(wp.abs(x - bx), wp.abs(y - by)), wp.abs(z - bz)) <= 1
                    if lower[other][0] <= upper[other][0]:
                        apart = wp.length(wp.max(upper[other] - least, most - lower[other]))
                        strain = wp.max(strain, apart / wp.where(touch, skin, edge - support))
                    if wall_block[other] > 0:
                        strain = wp.max(strain, alone / wp.where(touch, wall_skin, edge - support))
    strain_out[block] = strain


@wp.kernel(enable_backward=False)
def largest_of_blocks(first: int, blocks: Blocks, values: wp.array[float], largest_out: wp.array[float]):
    """The largest value of each block, at least 0."""
    block = first + wp.tid()
    largest = float(0.0)
    for k in range(blocks.size):
        i = item_of(blocks, block, k)
        if i < blocks.count:
            largest = wp.max(largest, values[i])
    largest_out[block] = largest
