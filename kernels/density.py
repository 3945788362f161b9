"""Density: the continuity equation, with the XSPH velocity that the same pair loop yields."""

from functools import cache

import warp as wp

from .parameters import Parameters
from .smoothing import SMOOTHING


@cache
def density_rate_kernel(smoothing: str) -> wp.Kernel:
    """The pair loop of continuity.

    Vasco (2014) eq 43:                   d rho_i/dt = rho_i sum_j V_j u_ij . grad_i W_ij,  V_j = m_j / rho_j
    eq 40 with its sign put right (XSPH): du_i = epsilon sum_j m_j / rhobar_ij (u_j - u_i) W_ij

    Eq 43 is the partner of eq 38: together they exchange kinetic and internal energy without loss.
    """
    shape, slope = SMOOTHING[smoothing].shape, SMOOTHING[smoothing].slope

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
        xsph_velocity_out: wp.array[wp.vec3],
    ):
        """d rho_i / dt [kg/m3/s] and the XSPH correction of the velocity [m/s]."""
        i = first + wp.tid()
        xV_i, up_i = position_volume[i], velocity_pressure[i]
        x_i, u_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2]), wp.vec3(up_i[0], up_i[1], up_i[2])
        rho_i = parameters.mass[fluid[i]] / xV_i[3]
        epsilon_i = parameters.xsph * parameters.mobility[fluid[i]]  # a held fluid does not drift

        divergence = float(0.0)
        smoothed = wp.vec3()
        row = i * parameters.row_stride
        for k in range(neighbour_count[i]):
            j = neighbour_list[row + k * parameters.column_stride]
            xV_j, up_j = position_volume[j], velocity_pressure[j]
            V_j, m_j = xV_j[3], parameters.mass[fluid[j]]
            x_ij = x_i - wp.vec3(xV_j[0], xV_j[1], xV_j[2])
            u_ij = u_i - wp.vec3(up_j[0], up_j[1], up_j[2])
            q = wp.sqrt(wp.dot(x_ij, x_ij)) * parameters.inverse_h

            divergence += V_j * slope(q) * wp.dot(u_ij, x_ij)
            m_j_over_rhobar = 2.0 * m_j * V_j / (rho_i * V_j + m_j)
            smoothed -= m_j_over_rhobar * shape(q) * u_ij
        density_rate_out[i] = rho_i * parameters.gradient_norm * divergence
        xsph_velocity_out[i] = epsilon_i * parameters.kernel_norm * smoothed

    return density_rate
