"""The pair loop: acceleration and rate of density of every particle, in one sweep over its neighbours."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import warp as wp

from .artificial_viscosity import ARTIFICIAL_VISCOSITY
from .corrections import renormalisation_of_a_body
from .density import BY_GRADIENT, DENSITY_DIFFUSION
from .layout import CPU_LAYOUT, Layout, Rows, compiler_options
from .momentum import TENSILE
from .neighbours import CellGrid, cell_number, row_offset
from .parameters import Parameters
from .smoothing import SMOOTHING


@dataclass(frozen=True)
class Formulas:
    """What the pair loop closes over.

    Attributes:
        smoothing, artificial_viscosity, diffusion: Names in SMOOTHING, ARTIFICIAL_VISCOSITY and DENSITY_DIFFUSION.
        tensile_correction: A key of TENSILE.
        xsph: Whether it is in.
        renormalised: Whether the divergence of continuity is made exact for linear velocities.
        fluid_count: How many fluids there are; 0 stands for any number.
        dimensions: Of space; in a plane nothing is done about y.
        neighbours: Where neighbours come from: `lists`, or the `cells` around.
        walled: Whether dummy particles of walls stand behind the particles.
    """

    smoothing: str = "wendland_c2"
    artificial_viscosity: str = "signal"
    diffusion: str = "none"
    tensile_correction: bool | str = False
    xsph: bool = False
    renormalised: bool = False
    fluid_count: int = 0
    dimensions: int = 3
    neighbours: str = "lists"
    walled: bool = False


@wp.func
def fluid_of(fluid: wp.array[int], j: int, fluid_i: int) -> int:
    """The fluid of a neighbour."""
    return fluid[j]


@wp.func
def same_fluid(fluid: wp.array[int], j: int, fluid_i: int) -> int:
    """The fluid of a neighbour where there is only one."""
    return fluid_i


@wp.func
def is_any(parameters: Parameters, j: int) -> bool:
    """Whether a neighbour is of the fluid, where nothing but fluid is seen, be it through mirrors."""
    return True


@wp.func
def is_no_dummy(parameters: Parameters, j: int) -> bool:
    """Whether a neighbour is of the fluid, where the dummy particles of walls stand behind the particles."""
    return j < parameters.particle_count


@wp.func
def looked_up(values: wp.array[float], f: int) -> float:
    """The number of fluid `f`, one of any: a load for every neighbour."""
    return values[f]


@wp.func
def one_of_two(values: wp.array[float], f: int) -> float:
    """The same of two fluids, whose numbers are loaded before the loop."""
    return wp.where(f == 0, values[0], values[1])


@wp.func
def one_of_three(values: wp.array[float], f: int) -> float:
    """The same of three."""
    return wp.where(f == 0, values[0], wp.where(f == 1, values[1], values[2]))


NUMBER_OF: Mapping[int, wp.Function] = {2: one_of_two, 3: one_of_three}  # by the number of fluids; else looked up


@cache
def rates_kernel(
    formulas: Formulas, layout: Layout = CPU_LAYOUT, momentum: bool = True, continuity: bool = True
) -> wp.Kernel:
    """The pair loop: its half of `momentum`, with dissipation, its half of `continuity`, or both at once.

    Momentum, Vasco (2014) eq 38 with 60 and 68, V_j = m_j / rho_j:

        du_i/dt = - sum_j (V_j (p_i + p_j) / rho_i + m_j Pi_ij + m_j R_ij) grad_i W_ij

    Continuity, eq 43, its partner: together they exchange kinetic and internal energy without loss:

        d rho_i/dt = rho_i sum_j V_j u_ij . grad_i W_ij

    or, no longer its partner but exact for linear velocities in disorder and at a surface, with B_i of eq 54,

        d rho_i/dt = -rho_i tr(L_i B_i),  L_i = sum_j V_j (u_j - u_i) (x) grad_i W_ij

    Diffusion, between particles of the same fluid, smooths the pressure that eq 43 alone would leave rough (Antuono et
    al. 2010, in pressures: d rho = dp / c^2). The sum of V_i R_i over all pairs is zero:

        R_i = 2 delta h / c sum_j V_j psi_ij (x_ji . grad_i W_ij) / r_ij^2,  psi_ij about p_j - p_i

    XSPH, eq 40 with its sign put right:

        du_i = epsilon sum_j m_j / rhobar_ij (u_j - u_i) W_ij

    Neighbours come from lists, one row for each particle, or are all particles in the cells around when particles were
    sorted, one row for each row of cells: more candidates, most of them too far to count, but no memory. A particle
    meets itself there, and adds nothing to itself.

    Components stand by themselves, vectors are put together after the loop: so the compiler can take several neighbours
    at a time.
    """
    shape, slope = SMOOTHING[formulas.smoothing].shape, SMOOTHING[formulas.smoothing].slope
    viscous, psi = ARTIFICIAL_VISCOSITY[formulas.artificial_viscosity], DENSITY_DIFFUSION[formulas.diffusion]
    tensile = TENSILE[formulas.tensile_correction]
    load, packed = layout.load[formulas.dimensions], layout.packed
    its_fluid = same_fluid if formulas.fluid_count == 1 else fluid_of
    number_of = NUMBER_OF.get(formulas.fluid_count, looked_up)
    is_particle = is_no_dummy if formulas.walled else is_any
    neighbours, one_by_one = formulas.neighbours, formulas.dimensions == 3 or not momentum
    by_list, by_cells = neighbours == "lists", neighbours == "cells"
    entry = layout.entry
    diffusive, by_gradient = momentum and formulas.diffusion != "none", formulas.diffusion in BY_GRADIENT
    plain = continuity and not formulas.renormalised
    renormalised = continuity and formulas.renormalised
    renormalised_in_space = renormalised and formulas.dimensions == 3
    xsph, tensioned = continuity and formulas.xsph, momentum and bool(formulas.tensile_correction)

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options(one_by_one, neighbours))
    def rates(
        first: int,
        grid: CellGrid,
        parameters: Parameters,
        position_volume: wp.array[packed],
        velocity_pressure: wp.array[packed],
        fluid: wp.array[int],
        pressure_gradient: wp.array[wp.vec3],
        neighbour_count: wp.array[int],
        neighbour_list: Rows,
        cell_start: wp.array[int],
        listed_position: wp.array[wp.vec3],
        pressure_acceleration_out: wp.array[wp.vec3],
        dissipative_acceleration_out: wp.array[wp.vec3],
        density_rate_out: wp.array[float],
        diffusion_rate_out: wp.array[float],
        xsph_velocity_out: wp.array[wp.vec3],
    ):
        """a_i by pressure and by dissipation [m/s2], d rho_i/dt, that by diffusion [kg/m3/s], XSPH velocity [m/s]."""
        i = first + wp.tid()
        fluid_i = fluid[i]
        x_i, y_i, z_i, V_i, u_i, v_i, w_i, p_i = load(position_volume, velocity_pressure, i)
        c_i, alpha_i = parameters.sound_speed[fluid_i], parameters.alpha[fluid_i]
        wall_alpha_i = parameters.wall_alpha[fluid_i]
        rho_i, rho0_i = parameters.mass[fluid_i] / V_i, parameters.rest_density[fluid_i]
        g_x, g_y, g_z = parameters.hydrostatic[0], parameters.hydrostatic[1], parameters.hydrostatic[2]

        pressure_x, pressure_y, pressure_z = float(0.0), float(0.0), float(0.0)
        dissipative_x, dissipative_y, dissipative_z = float(0.0), float(0.0), float(0.0)
        smoothed_x, smoothed_y, smoothed_z = float(0.0), float(0.0), float(0.0)
        divergence, diffused = float(0.0), float(0.0)
        # Moments of the neighbours, and the parts needed of the velocity gradient: B is symmetric.
        M_xx, M_yy, M_zz, M_xy, M_xz, M_yz = float(0.0), float(0.0), float(0.0), float(0.0), float(0.0), float(0.0)
        L_xx, L_yy, L_zz, L_xy, L_xz, L_yz = float(0.0), float(0.0), float(0.0), float(0.0), float(0.0), float(0.0)
        k, end = int(0), int(0)
        row, rows, first_cell = int(0), int(1), int(0)
        if wp.static(by_list):
            end = neighbour_count[i]
        if wp.static(by_cells):
            first_cell = cell_number(grid, listed_position[i]) - grid.reach[0]
            rows = (2 * grid.reach[1] + 1) * (2 * grid.reach[2] + 1)
        while row < rows:
            if wp.static(by_cells):
                cell = first_cell + row_offset(grid, row)
                k = cell_start[cell]
                end = cell_start[cell + 2 * grid.reach[0] + 1]
            while k < end:
                j = int(k)
                if wp.static(by_list):
                    j = entry(neighbour_list, i, k)
                fluid_j = its_fluid(fluid, j, fluid_i)
                x_j, y_j, z_j, V_j, u_j, v_j, w_j, p_j = load(position_volume, velocity_pressure, j)
                m_j = number_of(parameters.mass, fluid_j)
                x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
                u, v, w = u_i - u_j, v_i - v_j, w_i - w_j
                r = wp.sqrt(x * x + y * y + z * z)
                u_dot_x = u * x + v * y + w * z
                q = r * parameters.inverse_h
                s = V_j * slope(q)
                m_j_over_rhobar = 2.0 * m_j * V_j / (rho_i * V_j + m_j)
                is_fluid = is_particle(parameters, j)

                if wp.static(momentum):
                    # A wall does not hold on to fluid in tension.
                    P = s * (wp.where(is_fluid, p_i, wp.max(p_i, 0.0)) + p_j)
                    pressure_x -= P * x
                    pressure_y -= P * y
                    pressure_z -= P * z
                    alpha = 0.5 * (alpha_i + number_of(parameters.alpha, fluid_j))
                    c = 0.5 * (c_i + number_of(parameters.sound_speed, fluid_j))
                    alpha, c = wp.where(is_fluid, alpha, wall_alpha_i), wp.where(is_fluid, c, c_i)
                    Pi = m_j_over_rhobar * slope(q) * viscous(parameters, alpha, c, u_dot_x, r)
                    if wp.static(tensioned):
                        Pi += s / rho_i * wp.where(is_fluid, tensile(parameters, p_i, p_j, shape(q)), 0.0)
                    dissipative_x -= Pi * x
                    dissipative_y -= Pi * y
                    dissipative_z -= Pi * z
                if wp.static(diffusive):
                    slope_ij = 0.0
                    if wp.static(by_gradient):
                        G_ij = 0.5 * (pressure_gradient[i] + pressure_gradient[j])
                        slope_ij = G_ij[0] * x + G_ij[1] * y + G_ij[2] * z
                    psi_ij = psi(p_i, p_j, rho0_i * (g_x * x + g_y * y + g_z * z), slope_ij)
                    psi_ij = wp.where(is_fluid, psi_ij, 0.0)
                    diffused -= wp.where(fluid_i == fluid_j, s * psi_ij, 0.0)
                if wp.static(plain):
                    divergence += s * u_dot_x
                if wp.static(renormalised):
                    M_xx -= s * x * x
                    M_zz -= s * z * z
                    M_xz -= s * x * z
                    L_xx -= s * u * x
                    L_zz -= s * w * z
                    L_xz -= s * (u * z + w * x)
                if wp.static(renormalised_in_space):
                    M_yy -= s * y * y
                    M_xy -= s * x * y
                    M_yz -= s * y * z
                    L_yy -= s * v * y
                    L_xy -= s * (u * y + v * x)
                    L_yz -= s * (v * z + w * y)
                if wp.static(xsph):
                    weight = wp.where(is_fluid, m_j_over_rhobar, 0.0) * shape(q)
                    smoothed_x -= weight * u
                    smoothed_y -= weight * v
                    smoothed_z -= weight * w
                k += 1
            row += 1

        n = parameters.gradient_norm
        if wp.static(momentum):
            pressure_acceleration_out[i] = n / rho_i * wp.vec3(pressure_x, pressure_y, pressure_z)
            dissipative_acceleration_out[i] = n * wp.vec3(dissipative_x, dissipative_y, dissipative_z)
            diffusion_rate_out[i] = 2.0 * parameters.diffusion * parameters.smoothing_length / c_i * n * diffused
        if wp.static(renormalised):
            B = renormalisation_of_a_body(n * wp.mat33(M_xx, M_xy, M_xz, M_xy, M_yy, M_yz, M_xz, M_yz, M_zz))
            divergence -= B[0, 0] * L_xx + B[1, 1] * L_yy + B[2, 2] * L_zz
            divergence -= B[0, 1] * L_xy + B[0, 2] * L_xz + B[1, 2] * L_yz
        if wp.static(continuity):
            density_rate_out[i] = rho_i * n * divergence
        if wp.static(xsph):
            epsilon_i = parameters.xsph * parameters.mobility[fluid_i]  # a held fluid does not drift
            xsph_velocity_out[i] = epsilon_i * parameters.kernel_norm * wp.vec3(smoothed_x, smoothed_y, smoothed_z)

    return rates
