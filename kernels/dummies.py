"""Dummy particles: walls that go on behind their surface, so that a sum over particles and dummies has full support.

Dummies stand behind the particles in the packed arrays, so that pair loops need not know them. They move with their
wall, and what they carry is the fluid's, carried on into the wall:

    p_d = (sum_f p_f W_df + (g - a_d) . sum_f rho_f (x_d - x_f) W_df) / sum_f W_df,    not below 0

Adami, Hu & Adams (2012) eq 27, over the fluid particles f around: their pressure, and the slope that it has in fluid
that moves with the wall. Volume is by the state equation from p_d. Fluid that is pulled off a wall is let go. What has
come too near is pushed back by rho c^2 (1 - r / r_0)^2 more (`touching`): between rows of dummies nothing else does.

Of a wall above water nothing may be seen: dummies there, with p_d = 0, push the edge of water at rest down and off the
wall. A tank of ten rows began to move with 0.14 g in its upper corners and swung at 3 % of sqrt(g H); it is 0.2 % since
a dummy counts only as far as the water around has the head to reach it (`reached`; measured while this was built).

Viscosity finds another velocity there, by `carry_velocity_kernel`: continuity asks whether the wall moves, friction how
fast fluid would go there if it went on.
"""

from functools import cache

import warp as wp

from .artificial_viscosity import ARTIFICIAL_VISCOSITY
from .layout import Layout, Rows, compiler_options, pack_velocity
from .neighbours import BLOCK_EDGE, CellGrid, cell_at, last_entry, place_of
from .parameters import Parameters
from .smoothing import SMOOTHING
from .state_equation import density_of


@cache
def list_dummies_kernel(layout: Layout) -> wp.Kernel:
    """A kernel that appends dummies to the lists of particles, which lie by column or by row."""
    set_entry = layout.set_entry

    @wp.kernel(module="unique", enable_backward=False)
    def list_dummies(
        first: int,
        grid: CellGrid,
        parameters: Parameters,
        again: int,
        radius: float,
        near_dummies: wp.array[wp.uint8],
        dummy_start: wp.array[int],
        dummy_order: wp.array[int],
        cell: wp.array[int],
        position: wp.array[wp.vec3],
        dummy_position: wp.array[wp.vec3],
        count_inout: wp.array[int],
        list_out: Rows,
        too_long_out: wp.array[int],
    ):
        """Append the dummies within `radius` [m] to row i; `too_long_out[0]` is set where one found no room."""
        i = first + wp.tid()
        longer = list_out.long_row[i]
        last = last_entry(parameters, list_out, longer)
        if near_dummies[cell[i]] > wp.uint8(0) and (longer >= 0 or again == 0):
            x_i = position[i]
            low, high = cell_at(grid, x_i - wp.vec3(radius)), cell_at(grid, x_i + wp.vec3(radius))
            n = count_inout[i]
            for kz in range(low[2], high[2] + 1):
                for ky in range(low[1], high[1] + 1):
                    cells = (kz * grid.count[1] + ky) * grid.count[0]
                    for slot in range(dummy_start[cells + low[0]], dummy_start[cells + high[0] + 1]):
                        d = dummy_order[slot]
                        x_id = x_i - dummy_position[d]
                        if wp.dot(x_id, x_id) < radius * radius:
                            if n < last:
                                set_entry(list_out, longer, i, n, parameters.particle_count + d)
                                n += 1
                            else:
                                too_long_out[0] = 1
            count_inout[i] = n

    return list_dummies


@wp.func
def reached(head: float, row: float) -> float:
    """How much of a dummy counts, from 0 to 1, by the total head there and the head of a spacing of fluid at rest.

    Beside the uppermost row of fluid at rest they are as 1/2 to 1, one spacing higher as -1/2 to 1: there the fluid
    ends, as it does before a mirror. Whatever has the speed to get there finds the wall.
    """
    return wp.where(row > 0.0, wp.clamp(0.5 + head / wp.max(row, 1.0e-20), 0.0, 1.0), 1.0)


@wp.func
def load_floats(position_volume: wp.array[float], velocity_pressure: wp.array[float], f: int):
    """x, y, z, V, u, v, w, p of particle f as a CPU takes several of them at once: one by one."""
    xV, up = 4 * f, 4 * f
    x, y, z, V = position_volume[xV], position_volume[xV + 1], position_volume[xV + 2], position_volume[xV + 3]
    u, v, w, p = velocity_pressure[up], velocity_pressure[up + 1], velocity_pressure[up + 2], velocity_pressure[up + 3]
    return x, y, z, V, u, v, w, p


@wp.func
def load_floats_in_plane(position_volume: wp.array[float], velocity_pressure: wp.array[float], f: int):
    """The same in a plane, where x lies in the place of v."""
    x, y, z, V, u, _x, w, p = load_floats(position_volume, velocity_pressure, f)
    return x, y, z, V, u, 0.0, w, p


# Nearer than this to a dummy, in spacings, fluid is about to go through the wall; at rest it stands at 1 or farther.
TOUCHING = wp.constant(0.75)


@wp.func
def touching(r: float) -> float:
    """The pressure that a dummy adds where fluid is r spacings away, over rho c^2."""
    near = wp.max(1.0 - r / TOUCHING, 0.0)
    return near * near


FLOATS = {2: load_floats_in_plane, 3: load_floats}


@cache
def press_dummies_kernel(smoothing: str, dimensions: int, layout: Layout) -> wp.Kernel:
    """A kernel that carries the fluid's pressure on into the walls; it reads vectors on a GPU, and floats on a CPU."""
    shape, slope = SMOOTHING[smoothing].shape, SMOOTHING[smoothing].slope
    on_gpu = layout.by_column
    packed, load = (layout.packed, layout.load[dimensions]) if on_gpu else (float, FLOATS[dimensions])
    in_space = dimensions == 3

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options(in_space))
    def press_dummies(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[packed],
        velocity_pressure: wp.array[packed],
        fluid: wp.array[int],
        position: wp.array[wp.vec3],
        velocity: wp.array[wp.vec3],
        acceleration: wp.array[wp.vec3],
        room: wp.array[float],
        fluid_first: wp.array[int],
        fluid_list: wp.array[int],
        position_volume_out: wp.array[wp.vec4],
        velocity_pressure_out: wp.array[wp.vec4],
        power_out: wp.array[float],
    ):
        """p_d [Pa] and V_d [m3, in 2-D m2], packed as pair loops read them, and the power of walls [W].

        The power is what a dummy does to the fluid's kinetic and internal energy, by its pressure, by letting go of
        fluid in tension, and by its motion:

            P_d = -V_d sum_f V_f ((p_d + max(-p_f, 0)) u_f + p_f u_d) . grad_f W_fd
        """
        d = first + wp.tid()
        x_d, u_d = position[d], velocity[d]
        g = parameters.gravity - acceleration[d]
        g_x, g_y, g_z = g[0], g[1], g[2]
        weight, density, pressed, lifted, moved = float(0.0), float(0.0), float(0.0), float(0.0), float(0.0)
        bulk, stiffening, inflow, torn, least = float(0.0), float(0.0), float(0.0), float(0.0), float(1.0e6)
        n = fluid_first[d]
        end = fluid_first[d + 1]
        while n < end:
            f = fluid_list[n]
            x_f, y_f, z_f, V_f, u, v, w, p_f = load(position_volume, velocity_pressure, f)
            x, y, z = x_d[0] - x_f, x_d[1] - y_f, x_d[2] - z_f
            material = fluid[f]
            rho_f = parameters.mass[material] / V_f
            c_f = parameters.sound_speed[material]
            q = wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h
            least = wp.min(least, q)
            W = shape(q)
            weight += W
            pressed += W * p_f
            lifted += W * rho_f * (g_x * x + g_y * y + g_z * z)
            u_fd, v_fd, w_fd = u - u_d[0], v - u_d[1], w - u_d[2]
            moved += W * 0.5 * rho_f * (u_fd * u_fd + v_fd * v_fd + w_fd * w_fd)
            density += W * rho_f
            bulk += W * parameters.rest_density[material] * c_f * c_f
            stiffening += W * parameters.stiffening[material]
            V_slope = V_f * slope(q)
            fluid_inflow = V_slope * (u * x + v * y + w * z)
            inflow += fluid_inflow
            torn += fluid_inflow * wp.max(-p_f, 0.0) + V_slope * p_f * (u_d[0] * x + u_d[1] * y + u_d[2] * z)
            n += 1
        V, p, power = float(room[d]), float(0.0), float(0.0)
        if weight > 0.0:
            modulus = bulk / weight
            nearest = least * parameters.inverse_spacing / parameters.inverse_h
            p = wp.max(pressed + lifted, 0.0) / weight + modulus * touching(nearest)
            row = density * wp.length(g) / parameters.inverse_spacing
            V *= reached(wp.max(pressed, 0.0) + lifted + moved, row)
            V *= modulus / float(density_of(p, modulus, 1.0, stiffening / weight))
            power = V * parameters.gradient_norm * (p * inflow + torn)
        position_volume_out[d] = wp.vec4(x_d[0], x_d[1], x_d[2], V)
        velocity_pressure_out[d] = pack_velocity(parameters.dimensions, x_d[0], u_d, p)
        power_out[d] = power

    return press_dummies


# Fluid counts as this far off a wall at least when its shear is asked for, in spacings.
LEAST_OFF = wp.constant(0.25)
# The viscosity of a dummy before fluid that has none, so that it is not taken for one that lets fluid slip [Pa s].
LEAST_VISCOSITY = wp.constant(1.0e-30)


@cache
def carry_velocity_kernel(smoothing: str) -> wp.Kernel:
    """A kernel that carries the velocity and the viscosity of the fluid on into walls to which it sticks.

    The velocity is extrapolated through the wall's, by the slope that fits the fluid around best:

        u_d = u_wall - depth_d sum_f d_f (u_f - u_wall) W_df / sum_f d_f^2 W_df,    mu_d = sum_f mu_f W_df / sum_f W_df

    d_f being the distance off the wall: exact where velocity is linear, wherever particles stand. Adami, Hu & Adams
    (2012) eq 23 have 2 u_wall - sum_f u_f W_df / sum_f W_df, which is not.
    """
    shape = SMOOTHING[smoothing].shape

    @wp.kernel(module="unique", enable_backward=False)
    def carry_velocity(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        packed_velocity: wp.array[wp.vec4],
        position: wp.array[wp.vec3],
        velocity: wp.array[wp.vec3],
        to_wall: wp.array[wp.vec3],
        fluid_first: wp.array[int],
        fluid_list: wp.array[int],
        packed_velocity_out: wp.array[wp.vec4],
    ):
        """(u, v, w, mu) of dummy d, in a plane (u, x, w, mu); mu is 0 where `to_wall` is, which lets fluid slip.

        `to_wall` leads from each dummy to the wall's nearest point [m].
        """
        d = first + wp.tid()
        x_d, u_d, way = position[d], velocity[d], to_wall[d]
        depth = wp.length(way)
        u, mu = wp.vec3(u_d[0], u_d[1], u_d[2]), float(0.0)
        if depth > 0.0:
            n = way / depth
            shear, squares, viscous, weight = wp.vec3(), float(0.0), float(0.0), float(0.0)
            for k in range(fluid_first[d], fluid_first[d + 1]):
                f = fluid_list[k]
                xV_f, up_f = position_volume[f], packed_velocity[f]
                x_fd = wp.vec3(xV_f[0], xV_f[1], xV_f[2]) - x_d
                u_f = wp.vec3(up_f[0], wp.where(parameters.dimensions == 2, 0.0, up_f[1]), up_f[2])
                W = shape(wp.length(x_fd) * parameters.inverse_h)
                off = wp.max(wp.dot(n, x_fd) - depth, 0.0)
                shear += W * off * (u_f - u_d)
                squares += W * off * off
                viscous += W * up_f[3]
                weight += W
            if weight > 0.0:
                least = LEAST_OFF / parameters.inverse_spacing
                u = u_d - depth / wp.max(squares, least * least * weight) * shear
                mu = wp.max(viscous / weight, LEAST_VISCOSITY)
        packed_velocity_out[d] = pack_velocity(parameters.dimensions, x_d[0], u, mu)

    return carry_velocity


# A wall that is accelerated more compresses a spacing of fluid by more than this: it is struck.
MOST_COMPRESSION = wp.constant(0.01)


@wp.kernel(enable_backward=False)
def move_dummies(
    first: int,
    parameters: Parameters,
    dt: wp.array[float],
    point_position: wp.array[wp.vec3],
    point_velocity: wp.array[wp.vec3],
    last_velocity_inout: wp.array[wp.vec3],
    position_out: wp.array[wp.vec3],
    velocity_out: wp.array[wp.vec3],
    acceleration_out: wp.array[wp.vec3],
):
    """The dummies of bodies to where these are now, with the acceleration since the last step [m/s2]."""
    k = first + wp.tid()
    u = point_velocity[k]
    a = (u - last_velocity_inout[k]) / wp.max(dt[0], 1.0e-12)
    c = parameters.sound_speed[0]
    most = MOST_COMPRESSION * c * c * parameters.inverse_spacing
    last_velocity_inout[k] = u
    position_out[k] = point_position[k]
    velocity_out[k] = u
    acceleration_out[k] = a * wp.min(1.0, most / wp.max(wp.length(a), 1.0e-9))


@wp.kernel(enable_backward=False)
def show_dummies(
    first: int,
    dimensions: int,
    point_position: wp.array[wp.vec3],
    point_velocity: wp.array[wp.vec3],
    position_volume_inout: wp.array[wp.vec4],
    velocity_pressure_inout: wp.array[wp.vec4],
):
    """The dummies of bodies where these are now, as pair loops read them; volume and pressure stay."""
    k = first + wp.tid()
    x, u = point_position[k], point_velocity[k]
    position_volume_inout[k] = wp.vec4(x[0], x[1], x[2], position_volume_inout[k][3])
    velocity_pressure_inout[k] = pack_velocity(dimensions, x[0], u, velocity_pressure_inout[k][3])


@wp.kernel(enable_backward=False)
def mark_blocks(first: int, grid: CellGrid, start: wp.array[int], used_out: wp.array[int]):
    """Whether there are dummies in a block of cells."""
    block = first + wp.tid()
    place = place_of(block, grid.blocks)
    bx, by, bz = place[0], place[1], place[2]
    found = int(0)
    for z in range(bz * BLOCK_EDGE, wp.min((bz + 1) * BLOCK_EDGE, grid.count[2])):
        for y in range(by * BLOCK_EDGE, wp.min((by + 1) * BLOCK_EDGE, grid.count[1])):
            cells = (z * grid.count[1] + y) * grid.count[0]
            found += start[cells + wp.min((bx + 1) * BLOCK_EDGE, grid.count[0])] - start[cells + bx * BLOCK_EDGE]
    used_out[block] = wp.min(found, 1)


@cache
def load_dummies_kernel(smoothing: str, artificial_viscosity: str) -> wp.Kernel:
    """A kernel that finds the force of the fluid on dummies: the reaction of each pair's force on the fluid."""
    slope, viscous = SMOOTHING[smoothing].slope, ARTIFICIAL_VISCOSITY[artificial_viscosity]

    @wp.kernel(module="unique", enable_backward=False)
    def load_dummies(
        first: int,
        parameters: Parameters,
        before: int,
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        fluid: wp.array[int],
        fluid_first: wp.array[int],
        fluid_list: wp.array[int],
        force_out: wp.array[wp.vec3],
    ):
        """Force on dummy k of bodies [N], in 2-D [N/m]; so many dummies of walls stand `before` them."""
        k = first + wp.tid()
        slot = parameters.particle_count + before + k
        xV_d, up_d = position_volume[slot], velocity_pressure[slot]
        x_d, V_d, p_d = wp.vec3(xV_d[0], xV_d[1], xV_d[2]), xV_d[3], up_d[3]
        m_d = parameters.mass[fluid[slot]]
        total = wp.vec3()
        for n in range(fluid_first[before + k], fluid_first[before + k + 1]):
            f = fluid_list[n]
            xV_f, up_f, material = position_volume[f], velocity_pressure[f], fluid[f]
            x = wp.vec3(xV_f[0], xV_f[1], xV_f[2]) - x_d
            u = wp.vec3(up_f[0] - up_d[0], up_f[1] - up_d[1], up_f[2] - up_d[2])
            if parameters.dimensions == 2:
                u = wp.vec3(u[0], 0.0, u[2])
            m, V_f, p_f = parameters.mass[material], xV_f[3], up_f[3]
            rho = m / V_f
            r = wp.length(x)
            q = r * parameters.inverse_h
            P_ij = viscous(
                parameters, parameters.wall_alpha[material], parameters.sound_speed[material], wp.dot(u, x), r
            )
            push = V_f * V_d * (wp.max(p_f, 0.0) + p_d)
            push += m * 2.0 * m_d * V_d / (rho * V_d + m_d) * P_ij
            total += push * slope(q) * x
        force_out[k] = parameters.gradient_norm * total

    return load_dummies


@wp.kernel(enable_backward=False)
def book_power(
    first: int,
    dummy_count: int,
    block_size: int,
    share: float,
    dt: wp.array[float],
    power: wp.array[float],
    work_inout: wp.array[wp.vec3d],
):
    """Book what dummies do in a `share` of a step, some with each block of particles, as work of walls [J]."""
    block = first + wp.tid()
    done = wp.float64(0.0)
    for d in range(wp.min(block * block_size, dummy_count), wp.min((block + 1) * block_size, dummy_count)):
        done += wp.float64(power[d])
    work = wp.float64(share * dt[0]) * done
    work_inout[block] = work_inout[block] + wp.vec3d(wp.float64(0.0), work, wp.float64(0.0))
