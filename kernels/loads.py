"""What fluid and bodies do to each other: lists of body points for the fluid, and the loads that it puts on them.

A body pushes the fluid as a wall does, point by point (`walls.py`), and each push has its reaction on the point: summed
by the point itself over the particles around it, pair by pair the same numbers, Vasco (2014) eq 113 and 114. So the
momentum of fluid and bodies together changes by gravity and walls alone.
"""

from functools import cache

import warp as wp

from .neighbours import CellGrid, cell_at
from .parameters import Parameters
from .smoothing import SMOOTHING
from .walls import WALL_FORCE, friction


@cache
def body_points_kernel(listing: bool) -> wp.Kernel:
    """A kernel that counts the points of bodies near each particle, or lists them once it is known where.

    Both take the same arguments: the one writes the counts, the other the list.
    """
    counting = not listing

    @wp.kernel(module="unique", enable_backward=False)
    def body_points(
        first: int,
        body_count: int,
        radius: float,
        body_position: wp.array[wp.vec3d],
        body_reach: wp.array[float],
        body_first: wp.array[int],
        position: wp.array[wp.vec3],
        point_position: wp.array[wp.vec3],
        point_first: wp.array[int],
        count_out: wp.array[int],
        list_out: wp.array[int],
    ):
        """The points of bodies within `radius` [m] of particle i, at list[first[i] : first[i + 1]].

        Body b has the points body_first[b] .. body_first[b + 1] - 1, at most body_reach[b] [m] from its centre.
        """
        i = first + wp.tid()
        x_i = position[i]
        n = int(0)
        if wp.static(listing):
            n = point_first[i]
            if n == point_first[i + 1]:
                return
        for b in range(body_count):
            if wp.length(x_i - wp.vec3(body_position[b])) < body_reach[b] + radius:
                for k in range(body_first[b], body_first[b + 1]):
                    x_ik = x_i - point_position[k]
                    if wp.dot(x_ik, x_ik) < radius * radius:
                        if wp.static(listing):
                            list_out[n] = k
                        n += 1
        if wp.static(counting):
            count_out[i] = n

    return body_points


@cache
def reaction_kernel(force: str, smoothing: str) -> wp.Kernel:
    """The force of the fluid on each point of a body: f_k = - sum_i m_i a_ik, a_ik as in `wall_acceleration_kernel`."""
    law = WALL_FORCE[force]
    slope = SMOOTHING[smoothing].slope

    @wp.kernel(module="unique", enable_backward=False)
    def reaction(
        first: int,
        grid: CellGrid,
        parameters: Parameters,
        reach: float,
        motion: float,
        start: wp.array[int],
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        fluid: wp.array[int],
        point_position: wp.array[wp.vec3],
        point_velocity: wp.array[wp.vec3],
        point_normal: wp.array[wp.vec3],
        point_before: wp.array[wp.vec3],
        point_after: wp.array[wp.vec3],
        force_out: wp.array[wp.vec3],
    ):
        """Force on point k [N], in 2-D [N/m].

        The law reaches `reach` [m]; cells hold the particles where these were listed, at most `motion` [m] from here.
        """
        k = first + wp.tid()
        x_k, u_k, n_k = point_position[k], point_velocity[k], point_normal[k]
        before_k, after_k = point_before[k], point_after[k]
        low, high = cell_at(grid, x_k - wp.vec3(reach + motion)), cell_at(grid, x_k + wp.vec3(reach + motion))
        total = wp.vec3()
        for z in range(low[2], high[2] + 1):
            for y in range(low[1], high[1] + 1):
                row = (z * grid.count[1] + y) * grid.count[0]
                for i in range(start[row + low[0]], start[row + high[0] + 1]):
                    xV_i, up_i = position_volume[i], velocity_pressure[i]
                    x_ik = wp.vec3(xV_i[0], xV_i[1], xV_i[2]) - x_k
                    r2 = wp.dot(x_ik, x_ik)
                    if r2 < reach * reach:
                        r = wp.sqrt(r2)
                        u_ik = wp.vec3(up_i[0], up_i[1], up_i[2]) - u_k
                        c = parameters.sound_speed[fluid[i]]
                        nu = parameters.wall_alpha[fluid[i]] * c
                        a_ik = law(parameters, c, x_ik, u_ik, n_k, before_k, after_k)
                        u_dot_x, s = wp.dot(u_ik, x_ik), slope(r * parameters.inverse_h)
                        a_ik += friction(parameters, nu, xV_i[3], u_dot_x, r, s) * x_ik
                        total -= parameters.mass[fluid[i]] * a_ik
        force_out[k] = total

    return reaction


@wp.kernel(enable_backward=False)
def watch_bodies(
    first: int,
    body_count: int,
    most_step: float,
    most_motion: float,
    body_reach: wp.array[float],
    position: wp.array[wp.vec3d],
    orientation: wp.array[wp.quatd],
    velocity: wp.array[wp.vec3d],
    spin: wp.array[wp.vec3d],
    listed_position: wp.array[wp.vec3d],
    listed_orientation: wp.array[wp.quatd],
    dt_limit_out: wp.array[float],
    strain_out: wp.array[float],
):
    """The longest step [s] in which no point moves more than `most_step` [m], and how much of `most_motion` [m], what
    the lists allow since they were made, will be used up after another such step. One thread.
    """
    i = first + wp.tid()
    limit = float(wp.inf)
    strain = float(0.0)
    for b in range(1, body_count):
        reach = body_reach[b]
        speed = float(wp.length(velocity[b])) + float(wp.length(spin[b])) * reach
        limit = wp.min(limit, most_step / wp.max(speed, 1.0e-9))
        # A turn by the unit quaternion (v, s) takes no point at `reach` farther than 2 |v| reach.
        turned = wp.quat_inverse(listed_orientation[b]) * orientation[b]
        chord = 2.0 * float(wp.length(wp.vec3d(turned[0], turned[1], turned[2]))) * reach
        moved = float(wp.length(position[b] - listed_position[b])) + chord
        strain = wp.max(strain, (moved + 2.0 * most_step) / most_motion)
    dt_limit_out[i] = limit
    strain_out[i] = strain
