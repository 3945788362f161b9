"""Images: mirrors and periodic edges as isometries of space, and the ghosts that particles see through them.

An image is a reflection, a translation or a product of such: x' = R x + t. The scene within repeats itself through all
of them, without a gap, so that a sum over particles and ghosts is a sum over unbounded fluid. A ghost is its particle,
seen through one image. Ghosts stand behind the particles in the packed arrays, so that pair loops need not know them.

What a ghost carries:

    x' = R x + t,    u' = R u,    p' = p + rho g . (x' - x) by the reflections alone,    V' = V rho / rho'

so that nothing passes a mirror, and fluid at rest is at rest there too: a pressure that is only copied (Vasco 2014,
6.1.2) has no slope across the wall, and lets it fall in. Friction sees another velocity, `velocity_beyond`.
"""

from functools import cache

import warp as wp

from .blocks import Blocks, item_of
from .layout import Layout, Rows
from .neighbours import BLOCK_EDGE, CellGrid, last_entry, place_of
from .parameters import Parameters
from .smoothing import SMOOTHING


@wp.struct
class Images:
    """The images of a scene. Arrays of the first group have one entry for each image, of the second for each edge.

    Edges are the planes that bound the scene: mirrors, and both ends of each periodic pair. The image through which an
    edge is left has the edge's own number.
    """

    count: int
    rotation: wp.array[wp.mat33]  # R
    translation: wp.array[wp.vec3]  # t [m]
    mirror_translation: wp.array[wp.vec3]  # t without what periodic edges add to it [m]
    friction: wp.array[wp.mat33]  # F and f: the velocity that friction sees is F u + f
    friction_velocity: wp.array[wp.vec3]  # f [m/s]
    extrapolates: wp.array[int]  # 1: that velocity is extrapolated from the wall instead
    wall_normal: wp.array[wp.vec3]  # unit normal of the wall, into the fluid
    wall_offset: wp.array[float]  # its points have normal . x = offset [m]
    wall_velocity: wp.array[wp.vec3]  # its own, along itself [m/s]

    edge_count: int
    edge_normal: wp.array[wp.vec3]  # into the scene
    edge_offset: wp.array[float]  # points of the scene have normal . x >= offset [m]


@wp.func
def distance_inside(normal: wp.vec3, offset: float, x: wp.vec3) -> float:
    """How far x lies on the scene's side of a plane [m]."""
    return wp.dot(normal, x) - offset


@wp.func
def velocity_beyond(images: Images, k: int, x_i: wp.vec3, u_i: wp.vec3, x_j: wp.vec3, u_j: wp.vec3) -> wp.vec3:
    """Velocity [m/s] that the friction on particle i sees at the ghost of particle j through image k.

        free_slip          R u_j
        no_slip_opposite   2 u_wall - u_j
        no_slip_wall       u_wall
        takeda             u_wall - (d_j / d_i) (u_i - u_wall), with 1 + d_j / d_i <= 1.5

    Vasco (2014) 6.1.2, rules a, b and c; Takeda, Miyama & Sekiya (1994), limited by Morris, Fox & Zhu (1997). d is the
    distance from the wall; a ghost has its particle's.
    """
    if images.extrapolates[k] == 0:
        return images.friction[k] * u_j + images.friction_velocity[k]
    normal, offset, u_wall = images.wall_normal[k], images.wall_offset[k], images.wall_velocity[k]
    d_i = wp.max(distance_inside(normal, offset, x_i), 1.0e-12)
    d_j = wp.max(distance_inside(normal, offset, x_j), 0.0)
    return u_wall - wp.min(d_j / d_i, 0.5) * (u_i - u_wall)


@cache
def ghost_pair(smoothing: str, dimensions: int, layout: Layout) -> wp.Function:
    """A wp.func of the pair of particle i with the ghost of particle `source` through an image, at xV_g = (x, y, z, V).

    It gives s_ig, where grad_i W_ig V_g = s_ig x_ig, x_ig [m], u_ig [m/s], and the number packed behind the velocity.
    """
    slope, load, packed = SMOOTHING[smoothing].slope, layout.load[dimensions], layout.packed

    @wp.func
    def pair_with_ghost(
        parameters: Parameters,
        images: Images,
        position_volume: wp.array[packed],
        packed_velocity: wp.array[packed],
        source: int,
        image: int,
        xV_g: wp.vec4,
        x_i: wp.vec3,
        u_i: wp.vec3,
    ):
        """s_ig, x_ig, u_ig and the number behind the velocity of the ghost's particle."""
        x_s, y_s, z_s, _V_s, u_s, v_s, w_s, last = load(position_volume, packed_velocity, source)
        u_g = velocity_beyond(images, image, x_i, u_i, wp.vec3(x_s, y_s, z_s), wp.vec3(u_s, v_s, w_s))
        x_ig = x_i - wp.vec3(xV_g[0], xV_g[1], xV_g[2])
        s = xV_g[3] * slope(wp.sqrt(wp.dot(x_ig, x_ig)) * parameters.inverse_h)
        return s, x_ig, u_i - u_g, last

    return pair_with_ghost


@wp.func
def is_beyond_reach(images: Images, x: wp.vec3, radius: float) -> bool:
    """Whether x lies farther than `radius` [m] behind any edge."""
    for e in range(images.edge_count):
        if distance_inside(images.edge_normal[e], images.edge_offset[e], x) < -radius:
            return True
    return False


@wp.func
def is_near_edge(images: Images, x: wp.vec3, radius: float) -> bool:
    """Whether x lies closer than `radius` [m] to any edge."""
    for e in range(images.edge_count):
        if distance_inside(images.edge_normal[e], images.edge_offset[e], x) < radius:
            return True
    return False


@wp.func
def through(images: Images, k: int, x: wp.vec3) -> wp.vec3:
    """x as seen through image k [m]."""
    return images.rotation[k] * x + images.translation[k]


@wp.kernel(enable_backward=False)
def fold(
    first: int,
    images: Images,
    parameters: Parameters,
    fluid: wp.array[int],
    position_inout: wp.array[wp.vec3d],
    velocity_inout: wp.array[wp.vec3],
    acceleration_inout: wp.array[wp.vec3],
    xsph_velocity_inout: wp.array[wp.vec3],
    lift_out: wp.array[float],
):
    """Bring a particle that left through an edge back as the image that came in for it; the work of the exchange [J].

    A periodic edge does work where it puts a particle back against gravity or the body force.
    """
    i = first + wp.tid()
    x = position_inout[i]
    work = float(0.0)
    for e in range(images.edge_count):
        if distance_inside(images.edge_normal[e], images.edge_offset[e], wp.vec3(x)) < 0.0:
            R = images.rotation[e]
            folded = wp.mat33d(R) * x + wp.vec3d(images.translation[e])
            work -= parameters.mass[fluid[i]] * wp.dot(parameters.gravity, wp.vec3(folded - x))
            x = folded
            velocity_inout[i] = R * velocity_inout[i]
            acceleration_inout[i] = R * acceleration_inout[i]
            xsph_velocity_inout[i] = R * xsph_velocity_inout[i]
    position_inout[i] = x
    lift_out[i] = work


@wp.kernel(enable_backward=False)
def book_lift(first: int, blocks: Blocks, lift: wp.array[float], work_inout: wp.array[wp.vec3d]):
    """Book the work of folding as work of walls, some with each block of particles [J]."""
    block = first + wp.tid()
    done = wp.float64(0.0)
    for k in range(blocks.size):
        i = item_of(blocks, block, k)
        if i < blocks.count:
            done += wp.float64(lift[i])
    work_inout[block] = work_inout[block] + wp.vec3d(wp.float64(0.0), done, wp.float64(0.0))


@wp.kernel(enable_backward=False)
def count_ghosts(first: int, images: Images, radius: float, position: wp.array[wp.vec3], count_out: wp.array[int]):
    """How many ghosts each particle has within `radius` [m] of the scene."""
    i = first + wp.tid()
    count = int(0)
    if is_near_edge(images, position[i], radius):
        for k in range(images.count):
            if not is_beyond_reach(images, through(images, k, position[i]), radius):
                count += 1
    count_out[i] = count


@wp.kernel(enable_backward=False)
def make_ghosts(
    first: int,
    images: Images,
    radius: float,
    position: wp.array[wp.vec3],
    fluid: wp.array[int],
    ghost_first: wp.array[int],
    source_out: wp.array[int],
    image_out: wp.array[int],
    ghost_fluid_out: wp.array[int],
    ghost_position_out: wp.array[wp.vec3],
):
    """The ghosts of particle i, from place ghost_first[i] on, and where they are [m]."""
    i = first + wp.tid()
    g = ghost_first[i]
    if g < ghost_first[i + 1]:
        for k in range(images.count):
            x = through(images, k, position[i])
            if not is_beyond_reach(images, x, radius):
                source_out[g] = i
                image_out[g] = k
                ghost_fluid_out[g] = fluid[i]
                ghost_position_out[g] = x
                g += 1


@wp.kernel(enable_backward=False)
def forget_ghosts(
    first: int,
    total: wp.array[int],
    last: int,
    source_out: wp.array[int],
    ghost_position_out: wp.array[wp.vec3],
):
    """Places beyond the total[last] ghosts there are: no source, and nowhere near."""
    g = first + wp.tid()
    if g >= total[last]:
        source_out[g] = -1
        ghost_position_out[g] = wp.vec3(wp.inf)


@wp.kernel(enable_backward=False)
def move_ghosts(
    first: int,
    images: Images,
    parameters: Parameters,
    source: wp.array[int],
    image: wp.array[int],
    position_volume: wp.array[wp.vec4],
    velocity_pressure: wp.array[wp.vec4],
    ghost_fluid: wp.array[int],
    ghost_position_volume_out: wp.array[wp.vec4],
    ghost_velocity_pressure_out: wp.array[wp.vec4],
):
    """What each ghost shows of its particle now, packed as the pair loop reads it."""
    g = first + wp.tid()
    j = source[g]
    if j >= 0:
        k, f = image[g], ghost_fluid[g]
        xV, up = position_volume[j], velocity_pressure[j]
        x = wp.vec3(xV[0], xV[1], xV[2])
        u = wp.vec3(up[0], wp.where(parameters.dimensions == 2, 0.0, up[1]), up[2])
        beyond = through(images, k, x)
        u_beyond = images.rotation[k] * u
        rho = parameters.mass[f] / xV[3]
        depth = images.rotation[k] * x + images.mirror_translation[k] - x
        rise = rho * wp.dot(parameters.gravity, depth)
        c = parameters.sound_speed[f]
        ghost_position_volume_out[g] = wp.vec4(beyond[0], beyond[1], beyond[2], xV[3] / (1.0 + rise / (rho * c * c)))
        v_or_x = wp.where(parameters.dimensions == 2, beyond[0], u_beyond[1])
        ghost_velocity_pressure_out[g] = wp.vec4(u_beyond[0], v_or_x, u_beyond[2], up[3] + rise)


@cache
def list_ghosts_kernel(layout: Layout) -> wp.Kernel:
    """A kernel that appends ghosts to the lists, which lie by column or by row."""
    set_entry = layout.set_entry

    @wp.kernel(module="unique", enable_backward=False)
    def list_ghosts(
        first: int,
        grid: CellGrid,
        parameters: Parameters,
        particle_count: int,
        again: int,
        ghost_start: wp.array[int],
        ghost_order: wp.array[int],
        cell: wp.array[int],
        position: wp.array[wp.vec3],
        ghost_position: wp.array[wp.vec3],
        count_inout: wp.array[int],
        list_out: Rows,
        inner_count_out: wp.array[int],
        too_long_out: wp.array[int],
    ):
        """Append the ghosts within the list radius to row i; `too_long_out[0]` is set where one found no room.

        A ghost that stands exactly where the particle does is left out: between those no force has a direction.
        """
        i = first + wp.tid()
        x_i, cell_i = position[i], cell[i]
        square_radius = parameters.list_radius * parameters.list_radius
        along, row_cells, layer_cells = grid.reach[0], grid.count[0], grid.count[0] * grid.count[1]
        longer = list_out.long_row[i]
        last = last_entry(parameters, list_out, longer)
        if longer >= 0 or again == 0:
            n = count_inout[i]
            inner_count_out[i] = n
            for b in range(-grid.reach[1], grid.reach[1] + 1):
                for a in range(-grid.reach[2], grid.reach[2] + 1):
                    middle = cell_i + a * layer_cells + b * row_cells
                    for slot in range(ghost_start[middle - along], ghost_start[middle + along + 1]):
                        g = ghost_order[slot]
                        x_ig = x_i - ghost_position[g]
                        square = wp.dot(x_ig, x_ig)
                        if square > 0.0 and square < square_radius:
                            if n < last:
                                set_entry(list_out, longer, i, n, particle_count + g)
                                n += 1
                            else:
                                too_long_out[0] = 1
            count_inout[i] = n

    return list_ghosts


@wp.func
def middle_of_block(grid: CellGrid, place: wp.vec3i) -> wp.vec3:
    """Centre of a block of cells [m]."""
    x = wp.vec3()
    for axis in range(3):
        cells = float(BLOCK_EDGE) * (float(place[axis]) + 0.5) - float(grid.reach[axis])
        x[grid.axes[axis]] = grid.origin[axis] + cells / grid.inverse_edge
    return x


@wp.func
def block_along(x: float, origin: float, inverse_edge: float, reach: int) -> int:
    """Number of the block along one axis, which may be one that the grid has not."""
    cells = (x - origin) * inverse_edge + float(reach)
    return int(wp.clamp(wp.floor(cells / float(BLOCK_EDGE)), -1.0e6, 1.0e6))


@wp.kernel(enable_backward=False)
def compare_images(
    first: int,
    grid: CellGrid,
    images: Images,
    skin: float,
    support: float,
    lower: wp.array[wp.vec3],
    upper: wp.array[wp.vec3],
    strain_inout: wp.array[float],
):
    """What `compare_motion` says of blocks of cells, for each of them and what it sees of the others through images.

    Displacements are the same on both sides of a periodic edge; through a mirror only their lengths are compared.
    """
    block = first + wp.tid()
    least, most = wp.vec3(lower[block]), wp.vec3(upper[block])
    strain = strain_inout[block]
    if least[0] <= most[0]:
        allowed = wp.min(skin, float(BLOCK_EDGE) / grid.inverse_edge - support)
        alone = wp.length(wp.max(-least, most))
        x = middle_of_block(grid, place_of(block, grid.blocks))
        for k in range(images.count):
            R = images.rotation[k]
            there = wp.transpose(R) * (x - images.translation[k])
            is_shift = wp.trace(R) > 2.999
            a = block_along(there[grid.axes[0]], grid.origin[0], grid.inverse_edge, grid.reach[0])
            b = block_along(there[grid.axes[1]], grid.origin[1], grid.inverse_edge, grid.reach[1])
            c = block_along(there[grid.axes[2]], grid.origin[2], grid.inverse_edge, grid.reach[2])
            # An image of a block, turned or not, lies within three blocks of its middle, touching ones included.
            for bz in range(wp.max(c - 3, 0), wp.min(c + 4, grid.blocks[2])):
                for by in range(wp.max(b - 3, 0), wp.min(b + 4, grid.blocks[1])):
                    for bx in range(wp.max(a - 3, 0), wp.min(a + 4, grid.blocks[0])):
                        other = (bz * grid.blocks[1] + by) * grid.blocks[0] + bx
                        if lower[other][0] <= upper[other][0]:
                            apart = alone + wp.length(wp.max(-lower[other], upper[other]))
                            if is_shift:
                                apart = wp.length(wp.max(upper[other] - least, most - lower[other]))
                            strain = wp.max(strain, apart / allowed)
    strain_inout[block] = strain
