"""Reactive walls: rows of fixed points that push the fluid away."""

from collections.abc import Mapping
from functools import cache

import warp as wp

from .parameters import Parameters
from .smoothing import SMOOTHING


@wp.func
def radial(parameters: Parameters, c: float, r: float) -> float:
    """f_ik / x_ik = K / beta W(r/h) / r^2, W = 1.77/32 (1 + 5 q/2 + 2 q^2) (2 - q)^5, K = strength c^2.

    Vasco (2014) eq 66 with the 1/r^2 that it lost, Monaghan & Kajtar (2009). Their mass factor 2 m_k / (m_i + m_k) is
    1: a wall point counts as heavy as the particle that it pushes, so that a wall holds light and heavy fluids alike.
    """
    q = r * parameters.inverse_h
    t = wp.max(2.0 - q, 0.0)
    W = (1.77 / 32.0) * (1.0 + q * (2.5 + 2.0 * q)) * t * t * t * t * t
    return parameters.wall_strength * c * c * W / wp.max(r * r, 1.0e-12)


WALL_FORCE: Mapping[str, wp.Function] = {"radial": radial}


@cache
def wall_acceleration_kernel(force: str, smoothing: str) -> wp.Kernel:
    """The loop over wall points.

    Vasco (2014) eq 63:  du_i/dt = sum_k (f_ik - m_k Pi_ik grad_i W_ik), with m_k = m_i, rho_k = rho_i and Pi of eq 61.
    """
    law = WALL_FORCE[force]
    slope = SMOOTHING[smoothing].slope

    @wp.kernel(module="unique", enable_backward=False)
    def wall_acceleration(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        fluid: wp.array[int],
        wall_position: wp.array[wp.vec3],
        wall_first: wp.array[int],
        wall_list: wp.array[int],
        wall_acceleration_out: wp.array[wp.vec3],
        wall_distance_out: wp.array[float],
    ):
        """a_i by walls [m/s2], and the distance to the nearest wall point within reach [m]."""
        i = first + wp.tid()
        xV_i, up_i = position_volume[i], velocity_pressure[i]
        x_i, u_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2]), wp.vec3(up_i[0], up_i[1], up_i[2])
        c = parameters.sound_speed[fluid[i]]
        friction = parameters.wall_alpha[fluid[i]] * c

        by_wall = wp.vec3()
        nearest = parameters.list_radius
        for n in range(wall_first[i], wall_first[i + 1]):
            x_ik = x_i - wall_position[wall_list[n]]
            r = wp.sqrt(wp.dot(x_ik, x_ik))
            P_ik = -friction * wp.dot(u_i, x_ik) / wp.max(r, 1.0e-9)
            by_wall += law(parameters, c, r) * x_ik
            by_wall -= xV_i[3] * P_ik * parameters.gradient_norm * slope(r * parameters.inverse_h) * x_ik
            nearest = wp.min(nearest, r)
        wall_acceleration_out[i] = by_wall
        wall_distance_out[i] = nearest

    return wall_acceleration
