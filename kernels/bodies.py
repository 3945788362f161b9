"""Rigid bodies: where they go by their loads or by a prescribed motion, and what the points of their surface do.

Newton and Euler for each body, Vasco (2014) eq 108-112 and 115 with the gravity that 108 lacks (errata):

    M dU/dt = sum_k F_k + M g          J dW/dt + W x J W = sum_k (x_k - X) x F_k         dx_k/dt = U + W x (x_k - X)

in double precision, with drift, kick, drift as for the fluid (`integrators.py`). Body 0 is the ground: the walls.
The x-z plane is a body that may neither move along y nor turn about x and z. Turning is positive from z to x.
"""

import math

import warp as wp

# How a body moves; all but the first two by formula or table.
FREE = wp.constant(0)
FIXED = wp.constant(1)
CONSTANT = wp.constant(2)
RAMP = wp.constant(3)
SINE = wp.constant(4)
TABLE = wp.constant(5)

# The fixed point of a turn gains a factor of |W| dt a sweep; with turns of 0.1 rad a step these are enough.
TURN_SWEEPS = wp.constant(30)
WHOLE_TURN = wp.constant(wp.float64(2.0 * math.pi))


@wp.struct
class Bodies:
    """Constants of the bodies; arrays have one entry for each, the ground first."""

    count: int
    gravity: wp.vec3d  # [m/s2]
    mass: wp.array[wp.float64]  # [kg], or [kg/m] in 2-D
    inertia: wp.array[wp.mat33d]  # about the centre, in body coordinates [kg m2], or [kg m]
    free_shift: wp.array[wp.vec3d]  # 1: free, 0: locked, along each axis of the world
    free_turn: wp.array[wp.vec3d]  # the same about each axis
    release: wp.array[wp.float64]  # held where it is until then [s]


@wp.struct
class Motions:
    """Prescribed motions: shift direction s(t), turn about an axis through a pivot by rate s(t), or rows of a table."""

    kind: wp.array[int]  # FREE, FIXED, ...
    position: wp.array[wp.vec3d]  # of the centre at the start [m]
    orientation: wp.array[wp.quatd]
    pivot: wp.array[wp.vec3d]  # at the start [m]
    axis: wp.array[wp.vec3d]  # unit vector
    direction: wp.array[wp.vec3d]  # [m per unit of s]
    turn: wp.array[wp.float64]  # [rad per unit of s]
    begin: wp.array[wp.float64]  # [s]
    period: wp.array[wp.float64]  # of the sine, or how long the ramp rises [s]
    phase: wp.array[wp.float64]  # [rad]
    first_row: wp.array[int]  # rows first_row[b] .. first_row[b + 1] - 1
    row_time: wp.array[wp.float64]  # after `begin` [s]
    row_shift: wp.array[wp.vec3d]  # [m]
    row_angle: wp.array[wp.float64]  # [rad]
    row_shift_rate: wp.array[wp.vec3d]  # [m/s]
    row_angle_rate: wp.array[wp.float64]  # [rad/s]


@wp.func
def course(kind: int, t: wp.float64, period: wp.float64, phase: wp.float64):
    """s(t) and ds/dt; both 0 at rest before t = 0.

    constant  s = t [s]
    ramp      s = t^2 / (2 T) up to T, then t - T / 2 [s]: the speed rises evenly to its full value
    sine      s = sin(2 pi t / T + phase) - sin(phase)
    """
    s = t
    rate = wp.float64(1.0)
    if t <= wp.float64(0.0):
        s = wp.float64(0.0)
        rate = wp.float64(0.0)
    elif kind == RAMP and t < period:
        s = wp.float64(0.5) * t * t / period
        rate = t / period
    elif kind == RAMP:
        s = t - wp.float64(0.5) * period
    elif kind == SINE:
        frequency = WHOLE_TURN / period
        s = wp.sin(frequency * t + phase) - wp.sin(phase)
        rate = frequency * wp.cos(frequency * t + phase)
    return s, rate


@wp.func
def table_course(motions: Motions, b: int, t: wp.float64):
    """Shift, its rate, angle, its rate by the table of body b: cubic between rows, at rest outside of them."""
    low = motions.first_row[b]
    high = motions.first_row[b + 1] - 1
    is_moving = t > motions.row_time[low] and t < motions.row_time[high]
    t_inside = wp.clamp(t, motions.row_time[low], motions.row_time[high])
    while high - low > 1:
        middle = (low + high) // 2
        if motions.row_time[middle] <= t_inside:
            low = middle
        else:
            high = middle
    span = motions.row_time[high] - motions.row_time[low]
    p = (t_inside - motions.row_time[low]) / span
    # Hermite's cubics of the value and of the rate, and their derivatives.
    one, two, three, six = wp.float64(1.0), wp.float64(2.0), wp.float64(3.0), wp.float64(6.0)
    to_high = p * p * (three - two * p)
    by_low = p * (one - p) * (one - p) * span
    by_high = p * p * (p - one) * span
    slope = six * p * (one - p) / span
    slope_by_low = (one - p) * (one - three * p)
    slope_by_high = p * (three * p - two)

    shift_step = motions.row_shift[high] - motions.row_shift[low]
    shift_low, shift_high = motions.row_shift_rate[low], motions.row_shift_rate[high]
    shift = motions.row_shift[low] + to_high * shift_step + by_low * shift_low + by_high * shift_high
    shift_rate = slope * shift_step + slope_by_low * shift_low + slope_by_high * shift_high
    angle_step = motions.row_angle[high] - motions.row_angle[low]
    angle_low, angle_high = motions.row_angle_rate[low], motions.row_angle_rate[high]
    angle = motions.row_angle[low] + to_high * angle_step + by_low * angle_low + by_high * angle_high
    angle_rate = slope * angle_step + slope_by_low * angle_low + slope_by_high * angle_high
    if not is_moving:
        shift_rate = wp.vec3d()
        angle_rate = wp.float64(0.0)
    return shift, shift_rate, angle, angle_rate


@wp.func
def prescribed(motions: Motions, b: int, t: wp.float64):
    """Position [m], orientation, velocity [m/s] and spin [rad/s] of body b at time t [s]."""
    since = t - motions.begin[b]
    kind = motions.kind[b]
    shift = wp.vec3d()
    shift_rate = wp.vec3d()
    angle = wp.float64(0.0)
    angle_rate = wp.float64(0.0)
    if kind == TABLE:
        shift, shift_rate, angle, angle_rate = table_course(motions, b, since)
    elif kind != FIXED:
        s, rate = course(kind, since, motions.period[b], motions.phase[b])
        shift = s * motions.direction[b]
        shift_rate = rate * motions.direction[b]
        angle = s * motions.turn[b]
        angle_rate = rate * motions.turn[b]
    turned = wp.quat_from_axis_angle(motions.axis[b], angle)
    arm = wp.quat_rotate(turned, motions.position[b] - motions.pivot[b])
    spin = angle_rate * motions.axis[b]
    return (
        motions.pivot[b] + shift + arm,
        turned * motions.orientation[b],
        shift_rate + wp.cross(spin, arm),
        spin,
    )


@wp.func
def world_inertia(bodies: Bodies, b: int, orientation: wp.quatd) -> wp.mat33d:
    """R J R^T [kg m2]."""
    R = wp.quat_to_matrix(orientation)
    return R * bodies.inertia[b] * wp.transpose(R)


@wp.func
def is_free_to_turn(bodies: Bodies, b: int) -> bool:
    """Whether body b may turn about every axis."""
    free = bodies.free_turn[b]
    return free[0] * free[1] * free[2] > wp.float64(0.0)


@wp.func
def locked_inverse(J: wp.mat33d, free: wp.vec3d) -> wp.mat33d:
    """The inverse of J among the axes about which a body may turn, 0 about the others."""
    one = wp.float64(1.0)
    masked = wp.mat33d()
    for a in range(3):
        for b in range(3):
            masked[a, b] = J[a, b] * free[a] * free[b]
        masked[a, a] = masked[a, a] + one - free[a]
    inverse = wp.inverse(masked)
    for a in range(3):
        for b in range(3):
            inverse[a, b] = inverse[a, b] * free[a] * free[b]
    return inverse


@wp.func
def turn_freely(J: wp.mat33d, orientation: wp.quatd, spin: wp.vec3d, dt: wp.float64):
    """Orientation and spin after dt [s] without torque, J in body coordinates.

    The midpoint rule for Euler's equations, with the attitude turned by Cayley's map of the same midpoint spin w:

        P' = P + dt (P + P') / 2 x w,   w = J^-1 (P + P') / 2,   q' = q (1, dt w / 2) / |(1, dt w / 2)|

    Simo & Wong (1991): exact in the energy P . J^-1 P / 2 and in the angular momentum R P, of second order in angle.
    """
    half = wp.float64(0.5)
    inverse = wp.inverse(J)
    P = J * wp.quat_rotate_inv(orientation, spin)
    P_new = P
    w = inverse * P
    for _ in range(TURN_SWEEPS):
        P_middle = half * (P + P_new)
        w = inverse * P_middle
        P_new = P + dt * wp.cross(P_middle, w)
    g = half * dt * w
    turned = wp.normalize(orientation * wp.quatd(g[0], g[1], g[2], wp.float64(1.0)))
    return turned, wp.quat_rotate(turned, inverse * P_new)


@wp.kernel(enable_backward=False)
def drift_bodies(
    first: int,
    bodies: Bodies,
    motions: Motions,
    begin: wp.float64,
    end: wp.float64,
    time: wp.array[wp.float64],
    dt: wp.array[float],
    shift_inout: wp.array[wp.vec3d],
    turn_inout: wp.array[wp.vec3d],
    position_inout: wp.array[wp.vec3d],
    orientation_inout: wp.array[wp.quatd],
    velocity_inout: wp.array[wp.vec3d],
    spin_inout: wp.array[wp.vec3d],
):
    """Bodies from the fractions `begin` to `end` of a step that starts at `time` [s].

    `shift` [m] and `turn` [rad] are what contact has put right in the place of a body: taken up here, once.
    """
    b = first + wp.tid()
    step = wp.float64(dt[0])
    h = (end - begin) * step
    if motions.kind[b] != FREE:
        x, q, u, w = prescribed(motions, b, time[0] + end * step)
        position_inout[b] = x
        orientation_inout[b] = q
        velocity_inout[b] = u
        spin_inout[b] = w
    elif time[0] >= bodies.release[b]:
        position_inout[b] = position_inout[b] + h * velocity_inout[b] + shift_inout[b]
        q = orientation_inout[b]
        w = spin_inout[b]
        if is_free_to_turn(bodies, b):
            q, w = turn_freely(bodies.inertia[b], q, w, h)
        else:
            # What a lock takes up keeps the spin as it is.
            g = wp.float64(0.5) * h * w
            q = wp.normalize(wp.quatd(g[0], g[1], g[2], wp.float64(1.0)) * q)
        g = wp.float64(0.5) * turn_inout[b]
        orientation_inout[b] = wp.normalize(wp.quatd(g[0], g[1], g[2], wp.float64(1.0)) * q)
        spin_inout[b] = w
    shift_inout[b] = wp.vec3d()
    turn_inout[b] = wp.vec3d()


@wp.kernel(enable_backward=False)
def kick_bodies(
    first: int,
    bodies: Bodies,
    motions: Motions,
    time: wp.array[wp.float64],
    dt: wp.array[float],
    force: wp.array[wp.vec3d],
    torque: wp.array[wp.vec3d],
    orientation: wp.array[wp.quatd],
    velocity_inout: wp.array[wp.vec3d],
    spin_inout: wp.array[wp.vec3d],
    velocity_before_out: wp.array[wp.vec3d],
    spin_before_out: wp.array[wp.vec3d],
    inverse_mass_out: wp.array[wp.vec3d],
    inverse_inertia_out: wp.array[wp.mat33d],
):
    """Velocity and spin by gravity and by the loads of a whole step, force [N] and torque about the centre [N m].

    Also what contact asks: velocity and spin before, and the inverse mass along each axis [1/kg] and inertia
    [1/(kg m2)] of the world: 0 for a body or an axis that is locked, held or prescribed.
    """
    b = first + wp.tid()
    h = wp.float64(dt[0])
    u, w = velocity_inout[b], spin_inout[b]
    velocity_before_out[b] = u
    spin_before_out[b] = w
    by_mass = wp.vec3d()
    by_inertia = wp.mat33d()
    if motions.kind[b] == FREE and time[0] >= bodies.release[b]:
        by_mass = bodies.free_shift[b] / bodies.mass[b]
        by_inertia = locked_inverse(world_inertia(bodies, b, orientation[b]), bodies.free_turn[b])
        velocity_inout[b] = u + h * (wp.cw_mul(by_mass, force[b]) + wp.cw_mul(bodies.free_shift[b], bodies.gravity))
        spin_inout[b] = w + h * (by_inertia * torque[b])
    inverse_mass_out[b] = by_mass
    inverse_inertia_out[b] = by_inertia


@wp.kernel(enable_backward=False)
def move_points(
    first: int,
    body: wp.array[int],
    offset: wp.array[wp.vec3d],
    outward: wp.array[wp.vec3d],
    position: wp.array[wp.vec3d],
    orientation: wp.array[wp.quatd],
    velocity: wp.array[wp.vec3d],
    spin: wp.array[wp.vec3d],
    point_position_out: wp.array[wp.vec3],
    point_velocity_out: wp.array[wp.vec3],
    point_normal_out: wp.array[wp.vec3],
):
    """Points of the surfaces from body coordinates `offset` [m] and their outward normals to the world, eq 115."""
    k = first + wp.tid()
    b = body[k]
    arm = wp.quat_rotate(orientation[b], offset[k])
    point_position_out[k] = wp.vec3(position[b] + arm)
    point_velocity_out[k] = wp.vec3(velocity[b] + wp.cross(spin[b], arm))
    point_normal_out[k] = wp.vec3(wp.quat_rotate(orientation[b], outward[k]))


@wp.kernel(enable_backward=False)
def turn_vectors(
    first: int,
    body: wp.array[int],
    vector: wp.array[wp.vec3d],
    orientation: wp.array[wp.quatd],
    turned_out: wp.array[wp.vec3],
):
    """Vectors in body coordinates, such as from a point to the next, as they lie in the world."""
    k = first + wp.tid()
    turned_out[k] = wp.vec3(wp.quat_rotate(orientation[body[k]], vector[k]))


@wp.kernel(enable_backward=False)
def sum_load_blocks(
    first: int,
    block_first: wp.array[int],
    block_body: wp.array[int],
    offset: wp.array[wp.vec3d],
    orientation: wp.array[wp.quatd],
    point_force: wp.array[wp.vec3],
    force_out: wp.array[wp.vec3d],
    torque_out: wp.array[wp.vec3d],
):
    """Force [N] and torque about the centre of its body [N m] of each block of points, eq 110 and 111.

    Block k has the points block_first[k] .. block_first[k + 1] - 1, all of one body.
    """
    k = first + wp.tid()
    q = orientation[block_body[k]]
    force = wp.vec3d()
    torque = wp.vec3d()
    for n in range(block_first[k], block_first[k + 1]):
        f = wp.vec3d(point_force[n])
        force += f
        torque += wp.cross(wp.quat_rotate(q, offset[n]), f)
    force_out[k] = force
    torque_out[k] = torque


@wp.kernel(enable_backward=False)
def sum_loads(
    first: int,
    body_first_block: wp.array[int],
    block_force: wp.array[wp.vec3d],
    block_torque: wp.array[wp.vec3d],
    force_out: wp.array[wp.vec3d],
    torque_out: wp.array[wp.vec3d],
):
    """Force [N] and torque [N m] on body b: blocks body_first_block[b] .. body_first_block[b + 1] - 1 in order."""
    b = first + wp.tid()
    force = wp.vec3d()
    torque = wp.vec3d()
    for k in range(body_first_block[b], body_first_block[b + 1]):
        force += block_force[k]
        torque += block_torque[k]
    force_out[b] = force
    torque_out[b] = torque
