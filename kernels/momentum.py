"""Momentum: the acceleration of a particle by its neighbours."""

from functools import cache

import warp as wp

from .parameters import Parameters
from .smoothing import SMOOTHING
from .viscosity import VISCOSITY


@wp.func
def tensile_strength(p: float) -> float:
    """e |p| of eq 67: e = 0.01 in compression and 0.2 in tension."""
    return wp.max(0.01 * p, -0.2 * p)


@wp.func
def tensile(parameters: Parameters, p_i: float, p_j: float, shape: float) -> float:
    """rho_i rho_j R_ij = (e_i |p_i| + e_j |p_j|) (W_ij / W(dx))^4: Vasco (2014) eq 67, Monaghan (2000)."""
    f = shape * parameters.inverse_shape_dx
    return (tensile_strength(p_i) + tensile_strength(p_j)) * f * f * f * f


@wp.func
def no_tensile(parameters: Parameters, p_i: float, p_j: float, shape: float) -> float:
    """No tensile correction."""
    return 0.0


@cache
def acceleration_kernel(smoothing: str, viscosity: str, tensile_correction: bool) -> wp.Kernel:
    """The pair loop of the momentum equation.

    Vasco (2014) eq 38 with 60 and 68:

        du_i/dt = - sum_j m_j ((p_i + p_j) / (rho_i rho_j) + Pi_ij + R_ij) grad_i W_ij

    With V_j = m_j / rho_j the first term is V_j (p_i + p_j) / rho_i: a neighbour is two loads, (x, V) and (u, p). The
    pressure's part and the dissipative part (Pi and R) are kept apart for the energy budget.
    """
    shape, slope = SMOOTHING[smoothing].shape, SMOOTHING[smoothing].slope
    viscous = VISCOSITY[viscosity]
    repulsion = tensile if tensile_correction else no_tensile

    @wp.kernel(module="unique", enable_backward=False)
    def acceleration(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: wp.array[int],
        pressure_acceleration_out: wp.array[wp.vec3],
        dissipative_acceleration_out: wp.array[wp.vec3],
    ):
        """a_i by pressure and by dissipation [m/s2]."""
        i = first + wp.tid()
        xV_i, up_i, fluid_i = position_volume[i], velocity_pressure[i], fluid[i]
        x_i, u_i, p_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2]), wp.vec3(up_i[0], up_i[1], up_i[2]), up_i[3]
        c_i, alpha_i = parameters.sound_speed[fluid_i], parameters.alpha[fluid_i]
        rho_i = parameters.mass[fluid_i] / xV_i[3]
        inverse_rho_i = 1.0 / rho_i

        by_pressure = wp.vec3()
        by_dissipation = wp.vec3()
        row = i * parameters.row_stride
        for k in range(neighbour_count[i]):
            j = neighbour_list[row + k * parameters.column_stride]
            xV_j, up_j, fluid_j = position_volume[j], velocity_pressure[j], fluid[j]
            V_j, p_j, m_j = xV_j[3], up_j[3], parameters.mass[fluid_j]
            x_ij = x_i - wp.vec3(xV_j[0], xV_j[1], xV_j[2])
            u_ij = u_i - wp.vec3(up_j[0], up_j[1], up_j[2])
            r = wp.sqrt(wp.dot(x_ij, x_ij))
            q = r * parameters.inverse_h
            grad_W_ij = parameters.gradient_norm * slope(q) * x_ij

            alpha, c = 0.5 * (alpha_i + parameters.alpha[fluid_j]), 0.5 * (c_i + parameters.sound_speed[fluid_j])
            m_j_over_rhobar = 2.0 * m_j * V_j / (rho_i * V_j + m_j)
            Pi = m_j_over_rhobar * viscous(parameters, alpha, c, wp.dot(u_ij, x_ij), r)
            R = V_j * inverse_rho_i * repulsion(parameters, p_i, p_j, shape(q))
            by_pressure -= V_j * (p_i + p_j) * inverse_rho_i * grad_W_ij
            by_dissipation -= (Pi + R) * grad_W_ij
        pressure_acceleration_out[i] = by_pressure
        dissipative_acceleration_out[i] = by_dissipation

    return acceleration
