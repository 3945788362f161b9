"""Reactive walls: rows of points that push the fluid away, by one of four laws, all with one signature.

    law(parameters, c, x_ik, u_ik, n_k, before_k, after_k) -> acceleration of particle i by wall point k [m/s2]

c is the speed of sound of the particle's material [m/s]; x_ik = x_i - x_k [m] and u_ik = u_i - u_k [m/s]; n_k is the
wall point's unit normal towards the fluid, 0 where there is fluid on both sides; before_k and after_k lead from it to
its neighbours on the wall [m], zero where the wall ends. Laws of distance alone ignore the last four.

Two families. `radial` and `lennard_jones` act along x_ik, and what a flat wall does is the sum over its points: their
strength is divided by beta, the points in a spacing of the fluid. `monaghan_kos` and `monaghan_kos_issa` act along the
normal: f = P(along) Q(off the wall) n, where P shares each leg between the two points at its ends so that the shares
add up to 1. A particle that slides over a leg feels exactly Q, whatever beta, and their strength is not divided.

Corners, after Monaghan, Kos & Issa (2003), for both laws of the second family. A point lies between two legs with
normals of their own:
- where the wall bulges towards the fluid (the edge of a block) a particle between the two normals is pushed by the
  corner alone, away from it: P = 1, n = x_ik / r, Q(r). On the rim of that fan it is the leg's own: the force is
  continuous. Every point of an arc is such a corner, a slight one;
- where it recedes from the fluid (the corner of a tank) the particle is over both legs: the push is the least that is
  no less than Q along either normal. That is the sum of both in a right corner, and one Q where the wall is flat, so
  that an arc that recedes is smooth too.
Beyond the free end of a wall its last point pushes like a corner. A wall with fluid on both sides has no normal of its
own: it pushes to the side on which the particle is.

The two laws of the second family hold in the x-z plane, where a wall is a line.
"""

from collections.abc import Mapping
from functools import cache

import warp as wp

from .parameters import Parameters
from .rates import compiler_options
from .smoothing import SMOOTHING


@wp.func
def radial_push(parameters: Parameters, c: float, square: float) -> float:
    """f_ik / x_ik = K / beta 1 / r^2 W(r/h), W = 1.77/32 (1 + 5 q/2 + 2 q^2) (2 - q)^5, K = strength c^2.

    Vasco (2014) eq 66 with the 1/r^2 that it lost, Monaghan & Kajtar (2009). Their mass factor 2 m_k / (m_i + m_k) is
    1: a wall point counts as heavy as the particle that it pushes, so that a wall holds light and heavy fluids alike.
    """
    r = wp.sqrt(square)
    q = r * parameters.inverse_h
    t = wp.max(2.0 - q, 0.0)
    W = (1.77 / 32.0) * (1.0 + q * (2.5 + 2.0 * q)) * t * t * t * t * t
    return parameters.wall_strength * c * c * W / wp.max(square, 1.0e-12)


@wp.func
def lennard_jones_push(parameters: Parameters, c: float, square: float) -> float:
    """f_ik / x_ik = D ((dx/r)^4 - (dx/r)^2) / r^2 for r < dx, else 0; D = strength c^2.

    Vasco (2014) eq 64 with one length in both brackets and the cut-off that it lacks, Monaghan (1994), whose D = g H is
    c^2 / 100 where c = 10 sqrt(g H). Its length is the fluid's spacing. Along a wall it is rough.
    """
    r2 = wp.max(square, 1.0e-12)
    s = 1.0 / (r2 * parameters.inverse_spacing * parameters.inverse_spacing)
    return parameters.wall_strength * c * c * wp.max(s * s - s, 0.0) / r2


@wp.func
def radial(
    parameters: Parameters, c: float, x_ik: wp.vec3, u_ik: wp.vec3, n_k: wp.vec3, before_k: wp.vec3, after_k: wp.vec3
) -> wp.vec3:
    """`radial_push` along x_ik."""
    return radial_push(parameters, c, wp.dot(x_ik, x_ik)) * x_ik


@wp.func
def lennard_jones(
    parameters: Parameters, c: float, x_ik: wp.vec3, u_ik: wp.vec3, n_k: wp.vec3, before_k: wp.vec3, after_k: wp.vec3
) -> wp.vec3:
    """`lennard_jones_push` along x_ik."""
    return lennard_jones_push(parameters, c, wp.dot(x_ik, x_ik)) * x_ik


@wp.func
def _leg_normal(n_k: wp.vec3, way: wp.vec3) -> wp.vec3:
    """The unit normal, on the side of n_k, of the leg that leads `way` from the point."""
    along = wp.normalize(way)
    return wp.normalize(n_k - wp.dot(n_k, along) * along)


@wp.func
def monaghan_kos(
    parameters: Parameters, c: float, x_ik: wp.vec3, u_ik: wp.vec3, n_k: wp.vec3, before_k: wp.vec3, after_k: wp.vec3
) -> wp.vec3:
    """f_ik = P Q n, P = (1 + cos(pi psi / l)) / 2, Q = A (1 - q) / sqrt(q), q = xi / (2 dx) up to 1.

    Vasco (2014) eq 65 with the pair of Monaghan & Kos (1999): A = (K + beta_v c u_n) / h, K = strength c^2, u_n >= 0
    the speed at which the particle comes closer, psi the distance along the leg of length l, and xi that off it.
    """
    return _along_legs(1, parameters, c, x_ik, u_ik, n_k, before_k, after_k)


@wp.func
def monaghan_kos_issa(
    parameters: Parameters, c: float, x_ik: wp.vec3, u_ik: wp.vec3, n_k: wp.vec3, before_k: wp.vec3, after_k: wp.vec3
) -> wp.vec3:
    """f_ik = P Q n, P = 1 - psi / l, Q = K / xi w(q), q = xi / h.

    w = 2/3 up to q = 2/3, 2 q - 3/2 q^2 up to 1, (2 - q)^2 / 2 up to 2.

    Vasco (2014) eq 87-88, Monaghan, Kos & Issa (2003), whose 0.02 c^2 m_k / (m_i + m_k) is K = strength c^2 with
    m_k = m_i.
    """
    return _along_legs(2, parameters, c, x_ik, u_ik, n_k, before_k, after_k)


# Closer than this share of a spacing the force does not grow any more: a particle that is thrown at the wall is not
# shot back. As far as half a leg behind the wall it stays what it is there: who has slipped through is pushed back.
LEAST_DISTANCE = wp.constant(0.05)


@wp.func
def _off(law: int, parameters: Parameters, c: float, xi: float, closing: float) -> float:
    """Q of the law [m/s2]."""
    distance = wp.max(xi, LEAST_DISTANCE / parameters.inverse_spacing)
    K = parameters.wall_strength * c * c
    if law == 1:
        q = 0.5 * distance * parameters.inverse_spacing
        A = (K + parameters.wall_approach * c * wp.max(closing, 0.0)) * parameters.inverse_h
        return A * wp.max(1.0 - q, 0.0) / wp.sqrt(q)
    q = distance * parameters.inverse_h
    t = wp.max(2.0 - q, 0.0)
    w = 0.5 * t * t
    if q < 1.0:
        w = 2.0 * q - 1.5 * q * q
    if q < 2.0 / 3.0:
        w = 2.0 / 3.0
    return K / distance * w


@wp.func
def _share(law: int, psi: float, xi: float, length: float) -> float:
    """P of the point at one end of a leg; 0 for a particle that is not over the leg, or far behind it."""
    if psi <= 0.0 or psi > 1.0 or xi < -0.5 * length:
        return 0.0
    if law == 1:
        return 0.5 + 0.5 * wp.cos(wp.PI * psi)
    return 1.0 - psi


@wp.func
def _along_legs(
    law: int,
    parameters: Parameters,
    c: float,
    x_ik: wp.vec3,
    u_ik: wp.vec3,
    n_k: wp.vec3,
    before_k: wp.vec3,
    after_k: wp.vec3,
) -> wp.vec3:
    """What the two legs that meet in a point do, as far as it is the point's share, or the corner between them."""
    towards = n_k
    if wp.dot(n_k, n_k) == 0.0:
        # There is fluid on both sides: a leg pushes to the side on which the particle is.
        towards = x_ik
    b2, a2 = wp.dot(before_k, before_k), wp.dot(after_k, after_k)
    psi_b, psi_a = wp.dot(x_ik, before_k) / wp.max(b2, 1.0e-20), wp.dot(x_ik, after_k) / wp.max(a2, 1.0e-20)
    if psi_b <= 0.0 and psi_a <= 0.0:
        # Between the normals of a corner that bulges, or straight above a point of a flat wall.
        r = wp.length(x_ik)
        n = x_ik / wp.max(r, 1.0e-12)
        if wp.dot(x_ik, towards) <= 0.0:
            # Or straight behind one.
            if 4.0 * r * r > wp.max(b2, a2):
                return wp.vec3()
            n = towards
            r = 0.0
        return _off(law, parameters, c, r, -wp.dot(u_ik, n)) * n

    n_b, n_a = _leg_normal(towards, before_k), _leg_normal(towards, after_k)
    xi_b, xi_a = wp.dot(x_ik, n_b), wp.dot(x_ik, n_a)
    Q_b, Q_a = _off(law, parameters, c, xi_b, -wp.dot(u_ik, n_b)), _off(law, parameters, c, xi_a, -wp.dot(u_ik, n_a))
    push = _share(law, psi_b, xi_b, wp.sqrt(b2)) * Q_b * n_b + _share(law, psi_a, xi_a, wp.sqrt(a2)) * Q_a * n_a
    cosine = wp.dot(n_b, n_a)
    if psi_b > 0.0 and psi_a > 0.0 and xi_b > 0.0 and xi_a > 0.0 and cosine > 0.0:
        # Over both legs of a corner that recedes: the points of each share its Q, and the excess comes off here.
        apart = n_b - n_a
        least = 0.5 * (Q_b + Q_a) / (1.0 + cosine) * (n_b + n_a)
        least += (Q_b - Q_a) / wp.max(wp.dot(apart, apart), 1.0e-12) * apart
        if Q_a <= cosine * Q_b:
            least = Q_b * n_b
        elif Q_b <= cosine * Q_a:
            least = Q_a * n_a
        push += least - Q_b * n_b - Q_a * n_a
    return push


WALL_FORCE: Mapping[str, wp.Function] = {
    "radial": radial,
    "lennard_jones": lennard_jones,
    "monaghan_kos": monaghan_kos,
    "monaghan_kos_issa": monaghan_kos_issa,
}
# Those of distance alone, f_ik / x_ik [1/s2] from r^2 [m2]. A loop over them runs several points at a time.
WALL_PUSH: Mapping[str, wp.Function] = {"radial": radial_push, "lennard_jones": lennard_jones_push}
# Laws that need to know which way the wall runs. The others are of distance alone: their strength is divided by the
# wall points that stand where one fluid particle would.
BY_LEG = ("monaghan_kos", "monaghan_kos_issa")


@wp.func
def no_push(parameters: Parameters, c: float, square: float) -> float:
    """Of laws that go by legs there is no part of distance alone."""
    return 0.0


@wp.func
def friction(parameters: Parameters, nu: float, V_i: float, u_dot_x: float, r: float, slope: float) -> float:
    """- m_k Pi_ik grad_i W_ik / x_ik with m_k = m_i, rho_k = rho_i and Pi of eq 61 [1/s2].

    nu = wall_alpha c, u_dot_x = u_ik . x_ik, slope = s(q).
    """
    P_ik = -nu * u_dot_x / wp.max(r, 1.0e-9)
    return -(V_i * P_ik * parameters.gradient_norm * slope)


@cache
def wall_acceleration_kernel(force: str, smoothing: str, moving: bool = False, dimensions: int = 2) -> wp.Kernel:
    """The loop over wall points. With `moving` the points have velocities, and their work adds up.

    Vasco (2014) eq 63:  du_i/dt = sum_k (f_ik - m_k Pi_ik grad_i W_ik), with m_k = m_i, rho_k = rho_i and Pi of eq 61.
    """
    law, push = WALL_FORCE[force], WALL_PUSH.get(force, no_push)
    slope = SMOOTHING[smoothing].slope
    by_leg, one_by_one = force in BY_LEG, dimensions == 3

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options(one_by_one))
    def wall_acceleration(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        fluid: wp.array[int],
        wall_position: wp.array[float],
        wall_velocity: wp.array[float],
        wall_normal: wp.array[wp.vec3],
        wall_before: wp.array[wp.vec3],
        wall_after: wp.array[wp.vec3],
        wall_first: wp.array[int],
        wall_list: wp.array[int],
        wall_acceleration_inout: wp.array[wp.vec3],
        wall_distance_inout: wp.array[float],
    ):
        """a_i by walls [m/s2], and the distance to the nearest wall point within reach [m].

        Positions and velocities of wall points are three floats each: loaded as vectors they come one at a time.
        """
        i = first + wp.tid()
        xV_i, up_i = position_volume[i], velocity_pressure[i]
        c = parameters.sound_speed[fluid[i]]
        nu = parameters.wall_alpha[fluid[i]] * c

        a_x, a_y, a_z = float(0.0), float(0.0), float(0.0)
        nearest = parameters.list_radius
        if wp.static(moving):
            a = wall_acceleration_inout[i]
            a_x, a_y, a_z = a[0], a[1], a[2]
            nearest = wall_distance_inout[i]
        # Floats that are not negative have the order of their bits, and the least of integers runs several at a time.
        least = wp.cast(nearest * nearest, wp.int32)
        n = wall_first[i]
        end = wall_first[i + 1]
        while n < end:
            k = wall_list[n]
            x, y, z = (
                xV_i[0] - wall_position[3 * k],
                xV_i[1] - wall_position[3 * k + 1],
                xV_i[2] - wall_position[3 * k + 2],
            )
            u, v, w = up_i[0], up_i[1], up_i[2]
            if wp.static(moving):
                u, v, w = u - wall_velocity[3 * k], v - wall_velocity[3 * k + 1], w - wall_velocity[3 * k + 2]
            square = x * x + y * y + z * z
            r = wp.sqrt(square)
            f = friction(parameters, nu, xV_i[3], u * x + v * y + w * z, r, slope(r * parameters.inverse_h))
            if wp.static(by_leg):
                x_ik, u_ik = wp.vec3(x, y, z), wp.vec3(u, v, w)
                f_ik = law(parameters, c, x_ik, u_ik, wall_normal[k], wall_before[k], wall_after[k])
                a_x += f_ik[0]
                a_y += f_ik[1]
                a_z += f_ik[2]
            else:
                f += push(parameters, c, square)
            a_x += f * x
            a_y += f * y
            a_z += f * z
            least = wp.min(least, wp.cast(square, wp.int32))
            n += 1
        wall_acceleration_inout[i] = wp.vec3(a_x, a_y, a_z)
        wall_distance_inout[i] = wp.sqrt(wp.cast(least, wp.float32))

    return wall_acceleration
