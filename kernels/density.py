"""Density: the continuity equation, with the XSPH velocity that the same pair loop yields."""

from collections.abc import Mapping
from functools import cache

import warp as wp

from .parameters import Parameters
from .smoothing import SMOOTHING
from .state_equation import density_of


@wp.func
def no_diffusion(parameters: Parameters, p_i: float, p_j: float, x_ij: wp.vec3, rest_density: float) -> float:
    """No diffusion."""
    return 0.0


@wp.func
def molteni_colagrossi(parameters: Parameters, p_i: float, p_j: float, x_ij: wp.vec3, rest_density: float) -> float:
    """p_j - p_i: Molteni & Colagrossi (2009). Simple, but it works against gravity at a free surface."""
    return p_j - p_i


@wp.func
def fourtakas(parameters: Parameters, p_i: float, p_j: float, x_ij: wp.vec3, rest_density: float) -> float:
    """p_j - p_i - rho0 g . x_ji, so that fluid at rest is left alone: Fourtakas et al. (2019)."""
    return p_j - p_i + rest_density * wp.dot(parameters.gravity, x_ij)


DENSITY_DIFFUSION: Mapping[str, wp.Function] = {
    "none": no_diffusion,
    "molteni_colagrossi": molteni_colagrossi,
    "fourtakas": fourtakas,
}


@cache
def density_rate_kernel(smoothing: str, diffusion: str) -> wp.Kernel:
    """The pair loop of continuity.

    Vasco (2014) eq 43:                   d rho_i/dt = rho_i sum_j V_j u_ij . grad_i W_ij,  V_j = m_j / rho_j
    eq 40 with its sign put right (XSPH): du_i = epsilon sum_j m_j / rhobar_ij (u_j - u_i) W_ij

    Eq 43 is the partner of eq 38: together they exchange kinetic and internal energy without loss. Diffusion, between
    particles of the same fluid, smooths the pressure that eq 43 alone would leave rough:

        d rho_i/dt += 2 delta h / c sum_j V_j psi_ij (x_ji . grad_i W_ij) / r_ij^2,  psi_ij about p_j - p_i

    (Antuono et al. 2010, in pressures: d rho = dp / c^2). The sum of V_i d rho_i/dt over all pairs is zero.
    """
    shape, slope = SMOOTHING[smoothing].shape, SMOOTHING[smoothing].slope
    psi = DENSITY_DIFFUSION[diffusion]

    @wp.kernel(module="unique", enable_backward=False)
    def density_rate(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: wp.array[int],
        density_rate_out: wp.array[float],
        diffusion_rate_out: wp.array[float],
        xsph_velocity_out: wp.array[wp.vec3],
    ):
        """d rho_i / dt [kg/m3/s], the part of it that is diffusion, and the XSPH correction of the velocity [m/s]."""
        i = first + wp.tid()
        xV_i, up_i = position_volume[i], velocity_pressure[i]
        x_i, u_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2]), wp.vec3(up_i[0], up_i[1], up_i[2])
        fluid_i, p_i = fluid[i], up_i[3]
        rest_density = parameters.rest_density[fluid_i]
        rho_i = parameters.mass[fluid_i] / xV_i[3]
        epsilon_i = parameters.xsph * parameters.mobility[fluid_i]  # a held fluid does not drift

        divergence = float(0.0)
        diffused = float(0.0)
        smoothed = wp.vec3()
        row = i * parameters.row_stride
        for k in range(neighbour_count[i]):
            j = neighbour_list[row + k * parameters.column_stride]
            xV_j, up_j = position_volume[j], velocity_pressure[j]
            fluid_j, V_j, p_j = fluid[j], xV_j[3], up_j[3]
            m_j = parameters.mass[fluid_j]
            x_ij = x_i - wp.vec3(xV_j[0], xV_j[1], xV_j[2])
            u_ij = u_i - wp.vec3(up_j[0], up_j[1], up_j[2])
            q = wp.sqrt(wp.dot(x_ij, x_ij)) * parameters.inverse_h

            s_ij = V_j * slope(q)
            divergence += s_ij * wp.dot(u_ij, x_ij)
            diffused -= wp.where(fluid_i == fluid_j, s_ij * psi(parameters, p_i, p_j, x_ij, rest_density), 0.0)
            m_j_over_rhobar = 2.0 * m_j * V_j / (rho_i * V_j + m_j)
            smoothed -= m_j_over_rhobar * shape(q) * u_ij
        strength = 2.0 * parameters.diffusion * parameters.smoothing_length / parameters.sound_speed[fluid_i]
        diffusion_rate = strength * parameters.gradient_norm * diffused
        density_rate_out[i] = rho_i * parameters.gradient_norm * divergence + diffusion_rate
        diffusion_rate_out[i] = diffusion_rate
        xsph_velocity_out[i] = epsilon_i * parameters.kernel_norm * smoothed

    return density_rate


@wp.kernel(enable_backward=False)
def rest_density(
    first: int,
    parameters: Parameters,
    position: wp.array[wp.vec3d],
    fluid: wp.array[int],
    density_out: wp.array[wp.float64],
    density_rate_out: wp.array[float],
):
    """Density at which the fluid carries its own weight below its still level, p = rho0 g (level - z).

    While the water settles among reactive walls its particles leave the lattice. Continuity would book that as
    compression here and expansion there, and the pressure of the resting fluid would be off by some percent. With the
    density of rest the particles themselves come to places at which the pressure balances gravity.
    """
    i = first + wp.tid()
    f = fluid[i]
    depth = parameters.still_level[f] - float(position[i][2])
    if depth > -1.0e30:
        density_out[i] = density_of(
            -parameters.rest_density[f] * parameters.gravity[2] * wp.max(depth, 0.0),
            parameters.rest_density[f],
            parameters.sound_speed[f],
            parameters.stiffening[f],
        )
        density_rate_out[i] = 0.0
