"""Reactive wall laws: the push of one wall point on one fluid particle, all with one signature.

    law(wall, c, x_ik, u_ik, n_k, before_k, after_k) -> acceleration of particle i by wall point k [m/s2]

c is the speed of sound of the particle's material [m/s]; x_ik = x_i - x_k [m] and u_ik = u_i - u_k [m/s]; n_k is the
wall point's unit normal towards the fluid; before_k and after_k lead from it to its neighbours on the wall [m], zero
where the wall ends. Laws that depend on distance alone ignore the last four.

Two families. `radial` and `lennard_jones` act along x_ik, and what a flat wall does is the sum over its points: their
strength is divided by beta, the points in a spacing of the fluid. `monaghan_kos` and `monaghan_kos_issa` act along the
normal: f = P(along) Q(off the wall) n, where P shares each leg between the two points at its ends so that the shares
add up to 1. A particle that slides over a leg feels exactly Q, whatever beta, and their strength is not divided.

Corners, after Monaghan, Kos & Issa (2003), for both laws of the second family. A point lies between two legs with
normals of their own:
- where the wall bulges towards the fluid (the edge of a block) a particle between the two normals is pushed by the
  corner alone, away from it: P = 1, n = x_ik / r, Q(r). On the rim of that fan it is what the leg says: the force is
  continuous. Every point of an arc is such a corner, a slight one;
- where it recedes from the fluid (the corner of a tank) the particle is over both legs: the push is the least that is
  no less than Q along either normal. That is the sum of both in a right corner, and one Q where the wall is flat, so
  that an arc that recedes is smooth too.
Beyond the free end of a wall its last point pushes like a corner.

The two laws of the second family hold in the x-z plane, where a wall is a line.
"""

from collections.abc import Mapping

import warp as wp


@wp.struct
class WallForce:
    """Numbers of the law."""

    inverse_h: float  # 1 / h [1/m]
    inverse_spacing: float  # 1 / dx of the fluid [1/m]
    strength: float  # K / c^2 (0.01 is usual), divided by beta (in 3-D its square) for the laws of distance alone
    approach: float  # beta_v of Monaghan & Kos (1999): what the speed of approach adds; 0 keeps energy, 1 is theirs


@wp.func
def radial(
    wall: WallForce, c: float, x_ik: wp.vec3, u_ik: wp.vec3, n_k: wp.vec3, before_k: wp.vec3, after_k: wp.vec3
) -> wp.vec3:
    """f_ik = K / beta x_ik / r^2 W(r/h), W = 1.77/32 (1 + 5 q/2 + 2 q^2) (2 - q)^5, K = strength c^2.

    Vasco (2014) eq 66 with the 1/r^2 that it lost, Monaghan & Kajtar (2009). Their mass factor 2 m_k / (m_i + m_k) is
    1: a wall point counts as heavy as the particle that it pushes, so that a wall holds light and heavy fluids alike.
    """
    r2 = wp.dot(x_ik, x_ik)
    q = wp.sqrt(r2) * wall.inverse_h
    t = wp.max(2.0 - q, 0.0)
    W = (1.77 / 32.0) * (1.0 + q * (2.5 + 2.0 * q)) * t * t * t * t * t
    return (wall.strength * c * c * W / wp.max(r2, 1.0e-12)) * x_ik


@wp.func
def lennard_jones(
    wall: WallForce, c: float, x_ik: wp.vec3, u_ik: wp.vec3, n_k: wp.vec3, before_k: wp.vec3, after_k: wp.vec3
) -> wp.vec3:
    """f_ik = D ((dx/r)^4 - (dx/r)^2) x_ik / r^2 for r < dx, else 0; D = strength c^2.

    Vasco (2014) eq 64 with one length in both brackets and the cut-off that it lacks, Monaghan (1994), whose D = g H is
    c^2 / 100 where c = 10 sqrt(g H). Its length is the fluid's spacing. Along a wall it is rough.
    """
    r2 = wp.max(wp.dot(x_ik, x_ik), 1.0e-12)
    s = 1.0 / (r2 * wall.inverse_spacing * wall.inverse_spacing)
    return (wall.strength * c * c * wp.max(s * s - s, 0.0) / r2) * x_ik


@wp.func
def _leg_normal(n_k: wp.vec3, way: wp.vec3) -> wp.vec3:
    """The unit normal, on the side of n_k, of the leg that leads `way` from the point."""
    along = wp.normalize(way)
    return wp.normalize(n_k - wp.dot(n_k, along) * along)


@wp.func
def monaghan_kos(
    wall: WallForce, c: float, x_ik: wp.vec3, u_ik: wp.vec3, n_k: wp.vec3, before_k: wp.vec3, after_k: wp.vec3
) -> wp.vec3:
    """f_ik = P Q n, P = (1 + cos(pi psi / l)) / 2, Q = A (1 - q) / sqrt(q), q = xi / (2 dx) up to 1.

    Vasco (2014) eq 65 with the pair of Monaghan & Kos (1999): A = (K + beta_v c u_n) / h, K = strength c^2, u_n >= 0
    the speed at which the particle comes closer, psi the distance along the leg of length l, and xi that off it.
    """
    return _along_legs(1, wall, c, x_ik, u_ik, n_k, before_k, after_k)


@wp.func
def monaghan_kos_issa(
    wall: WallForce, c: float, x_ik: wp.vec3, u_ik: wp.vec3, n_k: wp.vec3, before_k: wp.vec3, after_k: wp.vec3
) -> wp.vec3:
    """f_ik = P Q n, P = 1 - psi / l, Q = K / xi w(q), q = xi / h.

    w = 2/3 up to q = 2/3, 2 q - 3/2 q^2 up to 1, (2 - q)^2 / 2 up to 2.

    Vasco (2014) eq 87-88, Monaghan, Kos & Issa (2003), whose 0.02 c^2 m_k / (m_i + m_k) is K = strength c^2 with
    m_k = m_i.
    """
    return _along_legs(2, wall, c, x_ik, u_ik, n_k, before_k, after_k)


# Closer than this share of a spacing the force does not grow any more: a particle that is thrown at the wall is not
# shot back. As far as half a leg behind the wall it stays what it is there: who has slipped through is pushed back.
LEAST_DISTANCE = wp.constant(0.05)


@wp.func
def _off(law: int, wall: WallForce, c: float, xi: float, closing: float) -> float:
    """Q of the law [m/s2]."""
    distance = wp.max(xi, LEAST_DISTANCE / wall.inverse_spacing)
    K = wall.strength * c * c
    if law == 1:
        q = 0.5 * distance * wall.inverse_spacing
        A = (K + wall.approach * c * wp.max(closing, 0.0)) * wall.inverse_h
        return A * wp.max(1.0 - q, 0.0) / wp.sqrt(q)
    q = distance * wall.inverse_h
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
    wall: WallForce,
    c: float,
    x_ik: wp.vec3,
    u_ik: wp.vec3,
    n_k: wp.vec3,
    before_k: wp.vec3,
    after_k: wp.vec3,
) -> wp.vec3:
    """What the two legs that meet in a point do, as far as it is the point's share, or the corner between them."""
    b2, a2 = wp.dot(before_k, before_k), wp.dot(after_k, after_k)
    psi_b, psi_a = wp.dot(x_ik, before_k) / wp.max(b2, 1.0e-20), wp.dot(x_ik, after_k) / wp.max(a2, 1.0e-20)
    if psi_b <= 0.0 and psi_a <= 0.0:
        # Between the normals of a corner that bulges, or straight above a point of a flat wall.
        r = wp.length(x_ik)
        n = x_ik / wp.max(r, 1.0e-12)
        if wp.dot(x_ik, n_k) <= 0.0:
            # Or straight behind one.
            if 4.0 * r * r > wp.max(b2, a2):
                return wp.vec3()
            n = n_k
            r = 0.0
        return _off(law, wall, c, r, -wp.dot(u_ik, n)) * n

    n_b, n_a = _leg_normal(n_k, before_k), _leg_normal(n_k, after_k)
    xi_b, xi_a = wp.dot(x_ik, n_b), wp.dot(x_ik, n_a)
    Q_b, Q_a = _off(law, wall, c, xi_b, -wp.dot(u_ik, n_b)), _off(law, wall, c, xi_a, -wp.dot(u_ik, n_a))
    push = _share(law, psi_b, xi_b, wp.sqrt(b2)) * Q_b * n_b + _share(law, psi_a, xi_a, wp.sqrt(a2)) * Q_a * n_a
    cosine = wp.dot(n_b, n_a)
    if psi_b > 0.0 and psi_a > 0.0 and xi_b > 0.0 and xi_a > 0.0 and cosine > 0.0:
        # Over both legs of a corner that recedes: the points of each share its Q, and what is too much comes off here.
        apart = n_b - n_a
        least = 0.5 * (Q_b + Q_a) / (1.0 + cosine) * (n_b + n_a)
        least += (Q_b - Q_a) / wp.max(wp.dot(apart, apart), 1.0e-12) * apart
        if Q_a <= cosine * Q_b:
            least = Q_b * n_b
        elif Q_b <= cosine * Q_a:
            least = Q_a * n_a
        push += least - Q_b * n_b - Q_a * n_a
    return push


WALL_FORCES: Mapping[str, wp.Function] = {
    "radial": radial,
    "lennard_jones": lennard_jones,
    "monaghan_kos": monaghan_kos,
    "monaghan_kos_issa": monaghan_kos_issa,
}
# Laws of distance alone, whose strength is divided by the wall points in a spacing of the fluid.
BY_POINT = ("radial", "lennard_jones")
