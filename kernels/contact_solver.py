"""Contact of rigid bodies with walls and with each other: impulses that make velocities admissible.

In each step, once the loads have been taken up, impulses p_n >= 0 along n and p_t across it are sought such that

    u_n >= max(-gap / dt, bounce),  p_n > 0 only where that is an equality         (no overlap at the end of the step)
    |p_t| <= mu p_n,  and where it is less, u_t = 0                                                        (Coulomb)

at every contact, u being the velocity of a point of one body relative to the surface of another (Moreau 1988, solved
by the sweeps of Jean 1999 that graphics calls sequential impulses, warm-started). bounce = restitution x the speed of
approach before the step, and is not asked for where it would be a mere creep; mu is the static coefficient where the
point stood still before the step, the dynamic one where it slid.

Why not springs and dashpots? Their stiffness is bounded by dt, and shared by all the points that touch: stiff enough
for a corner that hits the toe of a ramp, a face of a hundred points bursts; soft enough for the face, the corner sinks
in by v sqrt(m / k), 5 mm at 0.5 m/s. Static friction needs a spring with a memory as well, else all slopes creep. Here
nothing has a time scale: any dt is stable, sticking is u_t = 0 to rounding, and a contact is seen before it closes
(-gap / dt), so that nothing tunnels that moves less than `margin` in a step.

Which contacts there are is found in contact.py.
"""

import warp as wp

from .bodies import Bodies
from .contact import LEG_BLOCK, MOST_SLOTS, Chosen, Contact, may_touch, point_coordinates

# The share of an overlap that is put right in a step, and the sweeps for it.
OVERLAP_SHARE = wp.constant(wp.float64(0.2))
OVERLAP_SWEEPS = wp.constant(10)


@wp.func
def mixed(a: wp.float64, b: wp.float64) -> wp.float64:
    """The coefficient of a pair: the geometric mean, or the only one there is."""
    if a < wp.float64(0.0):
        return b
    if b < wp.float64(0.0):
        return a
    return wp.sqrt(a * b)


@wp.func
def within(vector: wp.vec3d, most: wp.float64) -> wp.vec3d:
    """`vector`, shortened to the length `most` where it is longer."""
    length = wp.length(vector)
    if length > most:
        return (most / length) * vector
    return vector


@wp.func
def compliance(
    by_mass: wp.vec3d,
    by_inertia: wp.mat33d,
    by_mass_other: wp.vec3d,
    by_inertia_other: wp.mat33d,
    arm: wp.vec3d,
    arm_other: wp.vec3d,
    n: wp.vec3d,
) -> wp.float64:
    """Relative velocity along n by a unit impulse along n [1/kg]."""
    turned, turned_other = wp.cross(arm, n), wp.cross(arm_other, n)
    return (
        wp.dot(n, wp.cw_mul(by_mass + by_mass_other, n))
        + wp.dot(turned, by_inertia * turned)
        + wp.dot(turned_other, by_inertia_other * turned_other)
    )


@wp.kernel(enable_backward=False)
def gather_contacts(
    first: int,
    contact: Contact,
    leg_count: int,
    dt: wp.array[float],
    point: wp.array2d[int],
    position: wp.array[wp.vec3d],
    orientation: wp.array[wp.quatd],
    velocity: wp.array[wp.vec3d],
    spin: wp.array[wp.vec3d],
    velocity_before: wp.array[wp.vec3d],
    spin_before: wp.array[wp.vec3d],
    inverse_mass: wp.array[wp.vec3d],
    inverse_inertia: wp.array[wp.mat33d],
    last_count: wp.array[int],
    last_key: wp.array2d[wp.int64],
    last_impulse: wp.array2d[wp.vec3d],
    count_out: wp.array[int],
    key_out: wp.array2d[wp.int64],
    other_out: wp.array2d[int],
    place_out: wp.array2d[wp.vec3d],
    normal_out: wp.array2d[wp.vec3d],
    gap_out: wp.array2d[wp.float64],
    target_out: wp.array2d[wp.float64],
    friction_out: wp.array2d[wp.float64],
    inverse_compliance_out: wp.array2d[wp.float64],
    start_impulse_out: wp.array2d[wp.vec3d],
    touched_inout: wp.array2d[int],
):
    """The contacts of body b: place, normal, gap, the velocity to reach [m/s], mu, and the impulse of last time."""
    b = first + wp.tid()
    step = wp.float64(dt[0])
    found = int(0)
    for block in range((leg_count + LEG_BLOCK - 1) // LEG_BLOCK):
        # One after the other, so that contacts keep their order; but few blocks have any.
        begin = block * LEG_BLOCK
        end = wp.where(touched_inout[b, block] > 0, wp.min(begin + LEG_BLOCK, leg_count), begin)
        touched_inout[b, block] = 0
        for leg in range(begin, end):
            if may_touch(contact, b, leg, position, orientation, inverse_mass):
                other = contact.leg_body[leg]
                taken = Chosen()
                for slot in range(MOST_SLOTS):
                    taken[slot] = -1
                for slot in range(contact.slots):
                    k = point[b * leg_count + leg, slot]
                    taken[slot] = k
                    is_new = k >= 0 and found < contact.capacity
                    for earlier in range(slot):
                        if taken[earlier] == k:
                            is_new = False
                    if is_new:
                        gap, n, _t, _s, _is_near, arm = point_coordinates(
                            contact, leg, b, k, position[b], orientation[b], position[other], orientation[other]
                        )
                        x = position[b] + arm
                        arm_other = x - position[other]
                        before = velocity_before[b] + wp.cross(spin_before[b], arm)
                        before -= velocity_before[other] + wp.cross(spin_before[other], arm_other)
                        now = velocity[b] + wp.cross(spin[b], arm)
                        now -= velocity[other] + wp.cross(spin[other], arm_other)
                        target = -wp.max(gap, wp.float64(0.0)) / step
                        approach = -wp.dot(before, n)
                        bounce = mixed(contact.restitution[b], contact.restitution[other]) * approach
                        if wp.dot(now, n) < target and bounce > contact.creep:
                            target = bounce
                        mu = mixed(contact.dynamic_friction[b], contact.dynamic_friction[other])
                        if wp.length(before + approach * n) < contact.still:
                            mu = mixed(contact.static_friction[b], contact.static_friction[other])
                        yielding = compliance(
                            inverse_mass[b],
                            inverse_inertia[b],
                            inverse_mass[other],
                            inverse_inertia[other],
                            arm,
                            arm_other,
                            n,
                        )
                        key = wp.int64(k) * wp.int64(leg_count) + wp.int64(leg)
                        impulse = wp.vec3d()
                        for old in range(last_count[b]):
                            if last_key[b, old] == key:
                                impulse = last_impulse[0, b * contact.capacity + old]
                        if yielding > wp.float64(0.0):
                            key_out[b, found] = key
                            other_out[b, found] = other
                            place_out[b, found] = x
                            normal_out[b, found] = n
                            gap_out[b, found] = gap
                            target_out[b, found] = target
                            friction_out[b, found] = mu
                            inverse_compliance_out[b, found] = wp.float64(1.0) / yielding
                            start_impulse_out[b, found] = impulse
                            found += 1
    count_out[b] = found


@wp.kernel(enable_backward=False)
def solve_contacts(
    first: int,
    bodies: Bodies,
    contact: Contact,
    count: wp.array[int],
    key: wp.array2d[wp.int64],
    other: wp.array2d[int],
    place: wp.array2d[wp.vec3d],
    normal: wp.array2d[wp.vec3d],
    gap: wp.array2d[wp.float64],
    target: wp.array2d[wp.float64],
    friction: wp.array2d[wp.float64],
    inverse_compliance: wp.array2d[wp.float64],
    start_impulse: wp.array2d[wp.vec3d],
    position: wp.array[wp.vec3d],
    inverse_mass: wp.array[wp.vec3d],
    inverse_inertia: wp.array[wp.mat33d],
    velocity_inout: wp.array2d[wp.vec3d],
    spin_inout: wp.array2d[wp.vec3d],
    shift_inout: wp.array2d[wp.vec3d],
    turn_inout: wp.array2d[wp.vec3d],
    impulse_inout: wp.array2d[wp.vec3d],
    received_inout: wp.array2d[wp.vec3d],
    last_count_out: wp.array[int],
    last_key_out: wp.array2d[wp.int64],
):
    """One thread solves all contacts in order: each reads what the one before it has made of the velocities, which is
    what the sweeps converge by, so that more threads would only take turns.

    Each `*_inout` array has one row, so that it keeps to its own index.

    Velocities [m/s] and spins [rad/s] become admissible. Overlaps of more than the slack are put right by a shift [m]
    and a turn [rad], which leave no velocity behind. Impulses [N s] are kept for the next start, entry b capacity + n,
    and `received` is their sum on each body.
    """
    i = first + wp.tid()
    zero = wp.float64(0.0)
    contacts = int(0)
    overlaps = int(0)
    for b in range(bodies.count):
        received_inout[i, b] = wp.vec3d()
        last_count_out[b] = count[b]
        for n in range(count[b]):
            last_key_out[b, n] = key[b, n]
            o = other[b, n]
            unit = normal[b, n]
            p_n = wp.max(wp.dot(start_impulse[b, n], unit), zero)
            p_t = within(start_impulse[b, n] - wp.dot(start_impulse[b, n], unit) * unit, friction[b, n] * p_n)
            p = p_n * unit + p_t
            impulse_inout[i, b * contact.capacity + n] = p
            r_b, r_o = place[b, n] - position[b], place[b, n] - position[o]
            velocity_inout[i, b] = velocity_inout[i, b] + wp.cw_mul(inverse_mass[b], p)
            velocity_inout[i, o] = velocity_inout[i, o] - wp.cw_mul(inverse_mass[o], p)
            spin_inout[i, b] = spin_inout[i, b] + inverse_inertia[b] * wp.cross(r_b, p)
            spin_inout[i, o] = spin_inout[i, o] - inverse_inertia[o] * wp.cross(r_o, p)
            contacts += 1
            if gap[b, n] < -contact.slack:
                overlaps += 1

    change = wp.float64(1.0)
    largest = zero
    sweep = int(0)
    while contacts > 0 and sweep < contact.sweeps and change > contact.tolerance * largest:
        change = zero
        largest = zero
        for b in range(bodies.count):
            # One contact waits for what the one before it has done to the body: that stays at hand.
            velocity_b, spin_b = wp.vec3d(velocity_inout[i, b]), wp.vec3d(spin_inout[i, b])
            for n in range(count[b]):
                o = other[b, n]
                unit = normal[b, n]
                row = b * contact.capacity + n
                r_b, r_o = place[b, n] - position[b], place[b, n] - position[o]
                u = velocity_b + wp.cross(spin_b, r_b)
                u -= velocity_inout[i, o] + wp.cross(spin_inout[i, o], r_o)
                old = impulse_inout[i, row]
                old_n = wp.dot(old, unit)
                old_t = old - old_n * unit
                p_n = wp.max(old_n + (target[b, n] - wp.dot(u, unit)) * inverse_compliance[b, n], zero)
                # Friction sees what the normal impulse has done to the velocity across.
                p = (p_n - old_n) * unit
                velocity_b += wp.cw_mul(inverse_mass[b], p)
                velocity_o = velocity_inout[i, o] - wp.cw_mul(inverse_mass[o], p)
                spin_b += inverse_inertia[b] * wp.cross(r_b, p)
                spin_o = spin_inout[i, o] - inverse_inertia[o] * wp.cross(r_o, p)
                u = velocity_b + wp.cross(spin_b, r_b) - velocity_o - wp.cross(spin_o, r_o)
                u_t = u - wp.dot(u, unit) * unit
                speed = wp.length(u_t)
                p_t = old_t
                if speed > zero:
                    yielding = compliance(
                        inverse_mass[b],
                        inverse_inertia[b],
                        inverse_mass[o],
                        inverse_inertia[o],
                        r_b,
                        r_o,
                        u_t / speed,
                    )
                    if yielding > zero:
                        p_t = old_t - u_t / yielding
                p_t = within(p_t, friction[b, n] * p_n)
                p = p_t - old_t
                velocity_b += wp.cw_mul(inverse_mass[b], p)
                velocity_inout[i, o] = velocity_o - wp.cw_mul(inverse_mass[o], p)
                spin_b += inverse_inertia[b] * wp.cross(r_b, p)
                spin_inout[i, o] = spin_o - inverse_inertia[o] * wp.cross(r_o, p)
                new = p_n * unit + p_t
                impulse_inout[i, row] = new
                change = wp.max(change, wp.length(new - old))
                largest = wp.max(largest, wp.length(new))
            velocity_inout[i, b] = velocity_b
            spin_inout[i, b] = spin_b
        sweep += 1

    for b in range(bodies.count):
        for n in range(count[b]):
            p = impulse_inout[i, b * contact.capacity + n]
            received_inout[i, b] = received_inout[i, b] + p
            received_inout[i, other[b, n]] = received_inout[i, other[b, n]] - p

    sweep = int(0)
    while overlaps > 0 and sweep < OVERLAP_SWEEPS:
        for b in range(bodies.count):
            for n in range(count[b]):
                o = other[b, n]
                unit = normal[b, n]
                r_b, r_o = place[b, n] - position[b], place[b, n] - position[o]
                moved = shift_inout[i, b] + wp.cross(turn_inout[i, b], r_b)
                moved -= shift_inout[i, o] + wp.cross(turn_inout[i, o], r_o)
                lacking = OVERLAP_SHARE * (-gap[b, n] - contact.slack) - wp.dot(moved, unit)
                if gap[b, n] < -contact.slack and lacking > zero:
                    p = lacking * inverse_compliance[b, n] * unit
                    shift_inout[i, b] = shift_inout[i, b] + wp.cw_mul(inverse_mass[b], p)
                    shift_inout[i, o] = shift_inout[i, o] - wp.cw_mul(inverse_mass[o], p)
                    turn_inout[i, b] = turn_inout[i, b] + inverse_inertia[b] * wp.cross(r_b, p)
                    turn_inout[i, o] = turn_inout[i, o] - inverse_inertia[o] * wp.cross(r_o, p)
        sweep += 1
