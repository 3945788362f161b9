"""The clock on the device: limits of the time step, absurd particles, the extremes of blocks, and the next step."""

import warp as wp

from .blocks import Blocks, item_of
from .parameters import Parameters

# What can be wrong with a particle; the host has a sentence for each.
SOUND = wp.constant(0)
NOT_FINITE = wp.constant(1)
TOO_LIGHT = wp.constant(2)
TOO_DENSE = wp.constant(3)
TOO_FAST = wp.constant(4)
OUTSIDE = wp.constant(5)


@wp.func
def longest_step(parameters: Parameters, c: float, alpha: float, u: wp.vec3, a: wp.vec3, wall_distance: float) -> float:
    """Longest stable step [s]: the least of

    sound      courant h / (c + |u|)                    Monaghan (1989)
    force      0.3 sqrt(h / |a|)                        Monaghan (1992)
    viscosity  0.25 h^2 / nu, nu = alpha c h / 8        Morris, Fox & Zhu (1997)
    wall       0.5 r / |u|, r the nearest wall point    in place of the thesis's |r - dx| / V, which can vanish
    """
    h = parameters.smoothing_length
    speed = wp.length(u)
    dt = parameters.courant * h / (c + speed)
    dt = wp.min(dt, 0.3 * wp.sqrt(h / wp.max(wp.length(a), 1.0e-9)))
    dt = wp.min(dt, 2.0 * h / wp.max(alpha * c, 1.0e-9))
    return wp.min(dt, 0.5 * wall_distance / wp.max(speed, 1.0e-9))


@wp.func
def find_fault(parameters: Parameters, x: wp.vec3d, u: wp.vec3, rho: wp.float64, rest_density: float, c: float) -> int:
    """What is absurd about a particle, relative to its own material."""
    compression = float(rho) / rest_density
    square_speed = wp.dot(u, u)
    p = wp.vec3(x)
    lower, upper = parameters.lower, parameters.upper
    is_inside = p[0] >= lower[0] and p[1] >= lower[1] and p[2] >= lower[2]
    is_inside = is_inside and p[0] <= upper[0] and p[1] <= upper[1] and p[2] <= upper[2]
    # Asked so that NaN is absurd too.
    is_liquid = compression >= parameters.least_compression and compression <= parameters.most_compression
    if is_inside and is_liquid and square_speed <= c * c:
        return SOUND
    if not (wp.isfinite(compression) and wp.isfinite(square_speed) and wp.isfinite(wp.dot(p, p))):
        return NOT_FINITE
    if compression < parameters.least_compression:
        return TOO_LIGHT
    if compression > parameters.most_compression:
        return TOO_DENSE
    if square_speed > c * c:
        return TOO_FAST
    return OUTSIDE


@wp.kernel(enable_backward=False)
def watch_blocks(
    first: int,
    blocks: Blocks,
    particle_dt_limit: wp.array[float],
    particle_fault: wp.array[int],
    particle_work: wp.array[wp.vec3],
    work_inout: wp.array[wp.vec3d],
    block_dt_limit_out: wp.array[float],
    block_fault_slot_out: wp.array[int],
):
    """Least dt limit and first faulty slot of each block of particles (-1: none); work adds up."""
    block = first + wp.tid()
    least = float(wp.inf)
    slot = int(-1)
    done = wp.vec3d()
    for k in range(blocks.size):
        i = item_of(blocks, block, k)
        if i < blocks.count:
            done += wp.vec3d(particle_work[i])
            least = wp.min(least, particle_dt_limit[i])
            if slot < 0 and particle_fault[i] != SOUND:
                slot = i
    work_inout[block] = work_inout[block] + done
    block_dt_limit_out[block] = least
    block_fault_slot_out[block] = slot


@wp.kernel(enable_backward=False)
def collect_blocks(
    first: int,
    blocks: Blocks,
    dt_limit: wp.array[float],
    fault_slot: wp.array[int],
    dt_limit_out: wp.array[float],
    fault_slot_out: wp.array[int],
):
    """Least dt limit and a faulty slot of blocks of blocks: fewer for the one thread of the clock."""
    top = first + wp.tid()
    least = float(wp.inf)
    slot = int(-1)
    for k in range(blocks.size):
        b = item_of(blocks, top, k)
        if b < blocks.count:
            least = wp.min(least, dt_limit[b])
            if slot < 0:
                slot = fault_slot[b]
    dt_limit_out[top] = least
    fault_slot_out[top] = slot


@wp.func
def aim(time: wp.float64, target: wp.float64, dt_limit: float) -> float:
    """The next step: the limit, shortened so that a whole number of equal steps ends at the target."""
    remaining = wp.max(float(target - time), 0.0)
    return remaining / wp.max(wp.ceil(remaining / dt_limit), 1.0)


@wp.kernel(enable_backward=False)
def advance_clock(
    first: int,
    block_count: int,
    strain_count: int,
    block_dt_limit: wp.array[float],
    block_fault_slot: wp.array[int],
    particle_fault: wp.array[int],
    strain: wp.array[float],
    target: wp.array[wp.float64],
    last_step: wp.array[int],
    time_inout: wp.array[wp.float64],
    dt_inout: wp.array[float],
    step_inout: wp.array[int],
    fault_inout: wp.array[int],
    fault_slot_inout: wp.array[int],
    dt_limit_out: wp.array[float],
    stale_out: wp.array[int],
    running_out: wp.array[int],
):
    """Time and step count go on, the next step is chosen; the first fault stops the clock. One thread."""
    i = first + wp.tid()
    limit = float(wp.inf)
    for b in range(block_count):
        limit = wp.min(limit, block_dt_limit[b])
        if fault_inout[i] == SOUND and block_fault_slot[b] >= 0:
            fault_slot_inout[i] = block_fault_slot[b]
            fault_inout[i] = particle_fault[block_fault_slot[b]]
    worst = float(0.0)
    for b in range(strain_count):
        worst = wp.max(worst, strain[b])
    dt = dt_inout[i]
    time = time_inout[i] + wp.float64(dt)
    if wp.abs(target[i] - time) < wp.float64(1.0e-3 * dt):
        time = target[i]
    if dt > 0.0:
        step_inout[i] = step_inout[i] + 1
    next_dt = wp.where(fault_inout[i] == SOUND, aim(time, target[i], limit), 0.0)
    time_inout[i] = time
    dt_inout[i] = next_dt
    dt_limit_out[i] = limit
    stale_out[i] = wp.where(worst > 1.0, 1, 0)
    running_out[i] = wp.where(next_dt > 0.0 and worst <= 1.0 and step_inout[i] < last_step[i], 1, 0)


@wp.kernel(enable_backward=False)
def aim_clock(
    first: int,
    time: wp.array[wp.float64],
    target: wp.array[wp.float64],
    last_step: wp.array[int],
    dt_limit: wp.array[float],
    stale: wp.array[int],
    fault: wp.array[int],
    step: wp.array[int],
    dt_out: wp.array[float],
    running_out: wp.array[int],
):
    """The next step after the host has set a new target or last step, or listed neighbours. One thread."""
    i = first + wp.tid()
    dt = wp.where(fault[i] == SOUND, aim(time[i], target[i], dt_limit[i]), 0.0)
    dt_out[i] = dt
    running_out[i] = wp.where(dt > 0.0 and stale[i] == 0 and step[i] < last_step[i], 1, 0)
