"""Damping zones: waves that run into one lose their velocity, the more the farther in."""

import warp as wp

from .parameters import Parameters


@wp.struct
class Zones:
    """The damping zones of a scene; arrays have one entry for each."""

    count: int
    begin: wp.array[float]  # where they begin, x [m]
    length: wp.array[float]  # to where they end, less than 0 to the left [m]
    rate: wp.array[float]  # of damping at the end [1/s]


@wp.kernel(enable_backward=False)
def damp_in_zones(
    first: int,
    parameters: Parameters,
    zones: Zones,
    dt: wp.array[float],
    fluid: wp.array[int],
    position_volume: wp.array[wp.vec4],
    velocity_inout: wp.array[wp.vec3],
    velocity_pressure_inout: wp.array[wp.vec4],
    work_inout: wp.array[wp.vec3],
):
    """u' = -rate s^2 u, s from 0 to 1 across the zone; what it takes is booked as damped [J]."""
    i = first + wp.tid()
    rate = float(0.0)
    for k in range(zones.count):
        s = wp.clamp((position_volume[i][0] - zones.begin[k]) / zones.length[k], 0.0, 1.0)
        rate += zones.rate[k] * s * s
    if rate > 0.0:
        u_old = velocity_inout[i]
        u = wp.exp(-rate * dt[0]) * u_old
        velocity_inout[i] = u
        up = velocity_pressure_inout[i]
        v_or_x = wp.where(parameters.dimensions == 2, up[1], u[1])
        velocity_pressure_inout[i] = wp.vec4(u[0], v_or_x, u[2], up[3])
        lost = 0.5 * parameters.mass[fluid[i]] * (wp.dot(u_old, u_old) - wp.dot(u, u))
        work_inout[i] = work_inout[i] + wp.vec3(0.0, 0.0, lost)
