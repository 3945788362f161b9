"""Viscosity: forces of a viscosity mu_i [Pa s] that each particle has, its own or an apparent one.

Two ways. The pair forms of VISCOSITY take the difference of two velocities at once; the divergence of the stress is in
`stress.py`. All conserve momentum; `cleary` angular momentum as well. Both have the same stages of a step.

Pair loops read (x, y, z, V) and (u, v, w, mu), packed as in rates.py: in a plane x lies beside u, in the place of
v. Beyond the particles of a row come the ghosts that mirrors and periodic edges show of particles, each with the
velocity that `velocity_beyond` gives it; they are worked out from their particles in the loop, so that the stages of a
step never wait for ghosts. Or it is the dummy particles of walls that come, with the velocity and viscosity that
`carry_velocity_kernel` packed for them; those with a viscosity of 0 belong to walls that let fluid slip.
"""

from collections.abc import Mapping
from functools import cache

import warp as wp

from .balance import BALANCE, SURFACE_MOMENT, balance_factor, share_inside
from .images import Images, ghost_pair
from .layout import CPU_LAYOUT, Layout, Rows, compiler_options, pack_velocity
from .parameters import Parameters
from .rheology import Rheology
from .smoothing import SMOOTHING

# ------------------------------------------------------------------------------------------------------ pair forms
# A pair force is A u_ij + B x_ij, and a form gives (A, B): vectors would keep the loop from taking several at once.


@wp.func
def morris(mu: float, dimensions: int, u_dot_x: float, r2: float):
    """2 mu u_ij: Morris, Fox & Zhu (1997), Vasco (2014) eq 99. For a flow without divergence."""
    return 2.0 * mu, 0.0


@wp.func
def cleary(mu: float, dimensions: int, u_dot_x: float, r2: float):
    """2 (d + 2) mu (u_ij . x_ij) x_ij / r^2: Cleary (1998), Monaghan (2005).

    Along the line between: no torque, nothing in rigid rotation, and right at a free surface, where eq 99 is not
    (Colagrossi et al. 2011). Its bulk viscosity is 2 mu in the plane, 5 mu / 3 in space.
    """
    return 0.0, 2.0 * float(dimensions + 2) * mu * u_dot_x / wp.max(r2, 1.0e-18)


VISCOSITY: Mapping[str, wp.Function] = {"morris": morris, "cleary": cleary}


@wp.func
def arithmetic(mu_i: float, mu_j: float) -> float:
    """(mu_i + mu_j) / 2."""
    return 0.5 * (mu_i + mu_j)


@wp.func
def harmonic(mu_i: float, mu_j: float) -> float:
    """2 mu_i mu_j / (mu_i + mu_j): the flux across a jump of the viscosity, Cleary & Monaghan (1999)."""
    return 2.0 * mu_i * mu_j / wp.max(mu_i + mu_j, 1.0e-30)


MEAN: Mapping[str, wp.Function] = {"arithmetic": arithmetic, "harmonic": harmonic}


@wp.func
def unless_it_slips(particle_count: int, j: int, mu_j: float, s: float) -> float:
    """The weight of a pair, and 0 for a dummy of a wall that lets fluid slip."""
    return wp.where(j < particle_count, s, wp.where(mu_j > 0.0, s, 0.0))


@cache
def viscous_acceleration_kernel(
    smoothing: str,
    form: str,
    mean: str,
    dimensions: int = 3,
    layout: Layout = CPU_LAYOUT,
    with_images: bool = False,
    balanced: bool = False,
    walled: bool = False,
) -> wp.Kernel:
    """The pair loop of viscosity.

        du_i/dt = 1 / rho_i sum_j V_j s_ij F(mu_ij, u_ij, x_ij),    grad_i W_ij = s_ij x_ij

    with F of VISCOSITY and mu_ij of MEAN. As (1/r) dW/dr = s_ij, eq 99 needs no 0.01 h^2 beside r^2. Where it is
    `balanced` s_ij has the factor of balance.py; where it is `walled` rows end with dummy particles.
    """
    slope = SMOOTHING[smoothing].slope
    force, between, balance_of = VISCOSITY[form], MEAN[mean], BALANCE[dimensions]
    load, packed, entry = layout.load[dimensions], layout.packed, layout.entry
    with_ghost = ghost_pair(smoothing, dimensions, layout)

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def viscous_acceleration(
        first: int,
        parameters: Parameters,
        images: Images,
        particle_count: int,
        position_volume: wp.array[packed],
        velocity_viscosity: wp.array[packed],
        place: wp.array[wp.vec4],
        fluid: wp.array[int],
        inner_count: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: Rows,
        ghost_source: wp.array[int],
        ghost_image: wp.array[int],
        balance: wp.array[float],
        viscous_acceleration_out: wp.array[wp.vec3],
    ):
        """a_i by viscosity [m/s2]; `place` is `position_volume` as vectors, `balance` is read where that is in."""
        i = first + wp.tid()
        x_i, y_i, z_i, V_i, u_i, v_i, w_i, mu_i = load(position_volume, velocity_viscosity, i)
        dimensions = parameters.dimensions
        b_x, b_y, b_z = float(0.0), float(0.0), float(0.0)
        if wp.static(balanced):
            b_x, b_y, b_z = balance_of(balance, i)

        viscous_x, viscous_y, viscous_z = float(0.0), float(0.0), float(0.0)
        k, end = int(0), int(inner_count[i])
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, mu_j = load(position_volume, velocity_viscosity, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            u, v, w = u_i - u_j, v_i - v_j, w_i - w_j
            r2 = x * x + y * y + z * z
            s = V_j * slope(wp.sqrt(r2) * parameters.inverse_h)
            if wp.static(balanced):
                b_jx, b_jy, b_jz = balance_of(balance, j)
                s *= balance_factor(b_x - b_jx, b_y - b_jy, b_z - b_jz, x, y, z)
            if wp.static(walled):
                s = unless_it_slips(particle_count, j, mu_j, s)
            A, B = force(between(mu_i, mu_j), dimensions, u * x + v * y + w * z, r2)
            viscous_x += s * (A * u + B * x)
            viscous_y += s * (A * v + B * y)
            viscous_z += s * (A * w + B * z)
            k += 1

        by_viscosity = wp.vec3(viscous_x, viscous_y, viscous_z)
        if wp.static(with_images):
            x_vec, u_vec = wp.vec3(x_i, y_i, z_i), wp.vec3(u_i, v_i, w_i)
            end = neighbour_count[i]
            while k < end:
                j = entry(neighbour_list, i, k)
                g = j - particle_count
                source, image = ghost_source[g], ghost_image[g]
                s, x_ig, u_ig, mu_s = with_ghost(
                    parameters, images, position_volume, velocity_viscosity, source, image, place[j], x_vec, u_vec
                )
                if wp.static(balanced):
                    b_sx, b_sy, b_sz = balance_of(balance, source)
                    b = wp.vec3(b_x, b_y, b_z) - images.rotation[image] * wp.vec3(b_sx, b_sy, b_sz)
                    s *= balance_factor(b[0], b[1], b[2], x_ig[0], x_ig[1], x_ig[2])
                A, B = force(between(mu_i, mu_s), dimensions, wp.dot(u_ig, x_ig), wp.dot(x_ig, x_ig))
                by_viscosity += s * (A * u_ig + B * x_ig)
                k += 1

        inverse_rho_i = V_i / parameters.mass[fluid[i]]
        viscous_acceleration_out[i] = inverse_rho_i * parameters.gradient_norm * by_viscosity

    return viscous_acceleration


# dt <= C rho h^2 / mu. integrators.py predicts the velocity at half steps from the last two, u + dt/2 F: for viscosity
# that is Adams-Bashforth of second order, which takes lambda dt <= 1, lambda being the fastest rate at which a velocity
# decays. Heun's scheme and the midpoint rule take 2, so twice this step.
VISCOUS_COURANT: Mapping[str, float] = {"morris": 0.125, "cleary": 0.045, "stress": 0.125}
# The same of a kernel that is narrower at the same h.
NARROWER: Mapping[str, float] = {"quintic_spline": 0.8}


def viscous_courant(form: str, smoothing: str) -> float:
    """The longest stable step of a single sweep over h^2 / nu."""
    return VISCOUS_COURANT[form] * NARROWER.get(smoothing, 1.0)


# ----------------------------------------------------------------------------------------------- the stages of a step


@wp.kernel(enable_backward=False)
def newtonian_viscosity(first: int, rheology: Rheology, fluid: wp.array[int], viscosity_out: wp.array[float]):
    """mu_i [Pa s] of fluids that have but one."""
    i = first + wp.tid()
    viscosity_out[i] = rheology.consistency[fluid[i]]


@wp.kernel(enable_backward=False)
def normalised_viscosity(
    first: int, second_moment: wp.array[float], viscosity: wp.array[float], normalised_viscosity_out: wp.array[float]
):
    """mu_i over tr M_i / d, M = sum_j V_j (x_j - x_i) (x) grad_i W_ij of eq 54 [Pa s].

    All forms see a viscosity that is this moment too great, for it is what a parabola adds up to. It is 1 but for the
    sum over a lattice instead of an integral, and for volumes that are not those which particles fill: hydrostatic
    density on an even lattice makes them too small. At a surface, where half of the neighbours are missing, the moment
    says nothing of the kind, and mu is left as it is.
    """
    i = first + wp.tid()
    moment = second_moment[i]
    normalised_viscosity_out[i] = viscosity[i] * (
        1.0 + share_inside(moment) * (1.0 / wp.max(moment, SURFACE_MOMENT) - 1.0)
    )


@wp.kernel(enable_backward=False)
def with_viscosity(
    first: int,
    velocity_pressure: wp.array[wp.vec4],
    viscosity: wp.array[float],
    velocity_viscosity_out: wp.array[wp.vec4],
):
    """(u, v, w, mu) of the velocity that the pair loop of forces reads; in a plane (u, x, w, mu)."""
    i = first + wp.tid()
    up = velocity_pressure[i]
    velocity_viscosity_out[i] = wp.vec4(up[0], up[1], up[2], viscosity[i])


@wp.kernel(enable_backward=False)
def start_stages(
    first: int,
    parameters: Parameters,
    position_volume: wp.array[wp.vec4],
    velocity: wp.array[wp.vec3],
    viscosity: wp.array[float],
    velocity_viscosity_out: wp.array[wp.vec4],
):
    """Y_0 of `viscous_stage`, the velocity at the start of the step, packed."""
    i = first + wp.tid()
    velocity_viscosity_out[i] = pack_velocity(parameters.dimensions, position_volume[i][0], velocity[i], viscosity[i])


@wp.kernel(enable_backward=False)
def viscous_stage(
    first: int,
    parameters: Parameters,
    share: float,
    weight_before: float,
    weight_second: float,
    weight_rate: float,
    weight_first: float,
    elapsed: float,
    dt: wp.array[float],
    velocity: wp.array[wp.vec3],
    pressure_acceleration: wp.array[wp.vec3],
    dissipative_acceleration: wp.array[wp.vec3],
    wall_acceleration: wp.array[wp.vec3],
    fluid: wp.array[int],
    position_volume: wp.array[wp.vec4],
    viscosity: wp.array[float],
    rate: wp.array[wp.vec3],
    first_rate: wp.array[wp.vec3],
    before: wp.array[wp.vec3],
    viscous_acceleration_inout: wp.array[wp.vec3],
    velocity_viscosity_out: wp.array[wp.vec4],
):
    """Stage j of a super step of du/dt = F + L(u), F being the other forces: Meyer, Balsara & Aslam (2014), RKL2.

        Y_j = mu_j Y_(j-1) + nu_j Y_(j-2) + (1 - mu_j - nu_j) Y_0 + mu'_j dt (F + L(Y_(j-1))) + gamma'_j dt (F + L(Y_0))

    As Y_j = u + dt (a_j + c_j F) that is, without F and without rounding u at every stage,

        a_j = mu_j a_(j-1) + nu_j a_(j-2) + mu'_j L(Y_(j-1)) + gamma'_j L(Y_0)

    and the last a_j is the acceleration by viscosity over the step: a sum of L, so it conserves what they conserve.
    Weights are (mu, nu, mu', gamma') in this order, `elapsed` is c_j; `share` is the part of dt that is stepped over.
    """
    i = first + wp.tid()
    f = fluid[i]
    a = weight_before * before[i] + weight_second * viscous_acceleration_inout[i]
    a += weight_rate * rate[i] + weight_first * first_rate[i]
    F = parameters.gravity + pressure_acceleration[i] + dissipative_acceleration[i] + wall_acceleration[i]
    u = velocity[i] + share * dt[0] * parameters.mobility[f] * (a + elapsed * F)
    viscous_acceleration_inout[i] = a
    velocity_viscosity_out[i] = pack_velocity(parameters.dimensions, position_volume[i][0], u, viscosity[i])


@wp.kernel(enable_backward=False)
def add_acceleration(first: int, acceleration: wp.array[wp.vec3], acceleration_inout: wp.array[wp.vec3]):
    """One acceleration onto another [m/s2]."""
    i = first + wp.tid()
    acceleration_inout[i] = acceleration_inout[i] + acceleration[i]
