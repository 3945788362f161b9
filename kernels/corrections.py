"""Corrections of the sums near a surface and in disorder: density made anew, gradients made exact for linear fields."""

from collections.abc import Mapping
from functools import cache

import warp as wp

from .blocks import Blocks, item_of
from .layout import CPU_LAYOUT, Layout, Rows
from .parameters import Parameters
from .smoothing import SMOOTHING
from .state_equation import internal_energy, pressure

# Neighbours span space if the mean eigenvalue of their moments and det(M) over the power of the mean are no less. The
# second is 1 inside a fluid, 0.6 in its corner, and 0.01 where one eigenvalue is 400 times another.
LEAST_MOMENT = wp.constant(1.0e-4)
LEAST_SPAN = wp.constant(1.0e-2)
# The same for what feeds back on the motion: a flat surface has 0.6 and 1, a corner 0.37 and 0.9, spray less.
LEAST_BODY = wp.constant(0.3)


@wp.func
def spanning_inverse(M: wp.mat33, least_moment: float, least_span: float) -> wp.mat33:
    """M^-1 of symmetric moments M, or 0 where the neighbours do not span space: too few, or all on one line.

    In a plane scene M has no y row. It is given the mean of the other two: nothing has a y to multiply it with.
    """
    flat = M[1, 1] == 0.0
    mean = wp.trace(M) / wp.where(flat, 2.0, 3.0)
    if mean < least_moment:
        return wp.mat33()
    filled = M / mean + wp.diag(wp.vec3(0.0, wp.where(flat, 1.0, 0.0), 0.0))
    if wp.determinant(filled) < least_span:
        return wp.mat33()
    return wp.inverse(filled) / mean


# --------------------------------------------------------------------------------------------------------- density


@wp.func
def plain(moment: float, first_moment: wp.vec3, second_moment: wp.mat33) -> wp.vec4:
    """W itself: Vasco (2014) eq 42."""
    return wp.vec4(1.0, 0.0, 0.0, 0.0)


@wp.func
def shepard(moment: float, first_moment: wp.vec3, second_moment: wp.mat33) -> wp.vec4:
    """W / sum_l V_l W_il, exact for constants: Shepard (1968), Vasco (2014) eq 45."""
    return wp.vec4(1.0 / moment, 0.0, 0.0, 0.0)


@wp.func
def mls(moment: float, first_moment: wp.vec3, second_moment: wp.mat33) -> wp.vec4:
    """Moving least squares of first order, exact for linear fields: Dilts (1999), Vasco (2014) eq 46-48.

    The 4 x 4 system of eq 47 by its blocks. Where the neighbours do not span space this is Shepard's.
    """
    slant = spanning_inverse(second_moment, LEAST_MOMENT, LEAST_SPAN) * first_moment
    zeta = 1.0 / (moment - wp.dot(first_moment, slant))
    return wp.vec4(zeta, -zeta * slant[0], -zeta * slant[1], -zeta * slant[2])


CORRECTION: Mapping[str, wp.Function] = {"plain": plain, "shepard": shepard, "mls": mls}


@wp.func
def is_due(step: int, every: int) -> bool:
    """Whether the step that follows `step` others is one of every so many."""
    return (step + 1) % every == 0


@cache
def density_filter_kernel(
    smoothing: str, correction: str, by_volume: bool = True, layout: Layout = CPU_LAYOUT
) -> wp.Kernel:
    """Density made anew from the density of all around, the particle's own too; within one fluid.

        rho_i = sum_j rho_j V_j (zeta_0 + zeta . (x_j - x_i) / h) W_ij,    zeta from the moments by `correction`

    Vasco (2014) 4.7.1, every n steps; in the steps between it returns at once. Summed as differences rho_j - rho_i, so
    that a density that is right already is not rounded. `by_volume` takes them from m_j / V_j, which is what every pair
    loop reads of a neighbour, for `shepard` and `mls`, whose weights add up to 1. Without it the density is read, and
    may be any other field: it is interpolated, by `plain` sums too.
    """
    shape = SMOOTHING[smoothing].shape
    coefficients, entry = CORRECTION[correction], layout.entry

    @wp.kernel(module="unique", enable_backward=False)
    def density_filter(
        first: int,
        parameters: Parameters,
        every: int,
        step: wp.array[int],
        position_volume: wp.array[wp.vec4],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: Rows,
        density: wp.array[wp.float64],
        filtered_density_out: wp.array[wp.float64],
    ):
        """rho_i made anew [kg/m3]; untouched in a step that is not due."""
        i = first + wp.tid()
        if not is_due(step[0], every):
            return
        xV_i, fluid_i, rho_i = position_volume[i], fluid[i], density[i]
        x_i, V_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2]), xV_i[3]
        m = parameters.mass[fluid_i]

        moment = V_i * shape(0.0)
        first_moment = wp.vec3()
        second_moment = wp.mat33()
        excess = float(0.0)
        first_excess = wp.vec3()
        for k in range(neighbour_count[i]):
            j = entry(neighbour_list, i, k)
            xV_j = position_volume[j]
            q_ji = (wp.vec3(xV_j[0], xV_j[1], xV_j[2]) - x_i) * parameters.inverse_h
            w_ij = wp.where(fluid[j] == fluid_i, xV_j[3] * shape(wp.sqrt(wp.dot(q_ji, q_ji))), 0.0)
            rho_ji = m * (V_i - xV_j[3]) / (V_i * xV_j[3]) if wp.static(by_volume) else float(density[j] - rho_i)

            moment += w_ij
            first_moment += w_ij * q_ji
            second_moment += w_ij * wp.outer(q_ji, q_ji)
            excess += w_ij * rho_ji
            first_excess += w_ij * rho_ji * q_ji
        n = parameters.kernel_norm
        zeta = coefficients(n * moment, n * first_moment, n * second_moment)
        slant = wp.vec3(zeta[1], zeta[2], zeta[3])
        # The sum of the corrected weights, which is 1 but for rounding and for plain ones.
        whole = 1.0 if wp.static(by_volume) else n * (zeta[0] * moment + wp.dot(slant, first_moment))
        difference = n * (zeta[0] * excess + wp.dot(slant, first_excess))
        filtered_density_out[i] = rho_i * wp.float64(whole) + wp.float64(difference)

    return density_filter


@wp.kernel(enable_backward=False)
def take_filtered_density(
    first: int,
    parameters: Parameters,
    every: int,
    step: wp.array[int],
    filtered_density: wp.array[wp.float64],
    fluid: wp.array[int],
    density_inout: wp.array[wp.float64],
    position_volume_inout: wp.array[wp.vec4],
    velocity_pressure_inout: wp.array[wp.vec4],
    particle_work_out: wp.array[wp.vec3],
):
    """Density, volume and pressure by the filter; the internal energy that goes with the change is dissipated [J]."""
    i = first + wp.tid()
    if not is_due(step[0], every):
        return
    f = fluid[i]
    old, rho = density_inout[i], filtered_density[i]
    rest, c, stiffening = parameters.rest_density[f], parameters.sound_speed[f], parameters.stiffening[f]
    lost = internal_energy(old, rest, c, stiffening) - internal_energy(rho, rest, c, stiffening)
    xV, up = position_volume_inout[i], velocity_pressure_inout[i]
    density_inout[i] = rho
    position_volume_inout[i] = wp.vec4(xV[0], xV[1], xV[2], parameters.mass[f] / float(rho))
    velocity_pressure_inout[i] = wp.vec4(up[0], up[1], up[2], pressure(rho, rest, c, stiffening))
    particle_work_out[i] = wp.vec3(parameters.mass[f] * float(lost), 0.0, 0.0)


@wp.kernel(enable_backward=False)
def add_filter_work(
    first: int,
    blocks: Blocks,
    every: int,
    step: wp.array[int],
    particle_work: wp.array[wp.vec3],
    work_inout: wp.array[wp.vec3d],
):
    """Energy that the filter took from a block of particles is added to the work done on it [J]."""
    block = first + wp.tid()
    if not is_due(step[0], every):
        return
    done = wp.vec3d()
    for k in range(blocks.size):
        i = item_of(blocks, block, k)
        if i < blocks.count:
            done += wp.vec3d(particle_work[i])
    work_inout[block] = work_inout[block] + done


# -------------------------------------------------------------------------------------------------------- gradient


@wp.struct
class Moments:
    """M = sum_j V_j (x_j - x_i) (x) grad_i W_ij without the constant of W; symmetric.

    The sums stand by themselves: a loop over neighbours takes several at a time, which it does not with a matrix.
    """

    xx: float
    yy: float
    zz: float
    xy: float
    xz: float
    yz: float


@wp.func
def moments_with(M: Moments, s: float, x: float, y: float, z: float) -> Moments:
    """M with one more neighbour: (x, y, z) = x_i - x_j and s = V_j s(q)."""
    return Moments(
        M.xx - s * x * x, M.yy - s * y * y, M.zz - s * z * z, M.xy - s * x * y, M.xz - s * x * z, M.yz - s * y * z
    )


@wp.func
def moments_in_plane_with(M: Moments, s: float, x: float, y: float, z: float) -> Moments:
    """The same in a plane, where nothing has a y."""
    return Moments(M.xx - s * x * x, M.yy, M.zz - s * z * z, M.xy, M.xz - s * x * z, M.yz)


@wp.func
def moments_matrix(M: Moments, n: float) -> wp.mat33:
    """n M."""
    return n * wp.mat33(M.xx, M.xy, M.xz, M.xy, M.yy, M.yz, M.xz, M.yz, M.zz)


@wp.struct
class Gradient:
    """L = sum_j V_j (u_j - u_i) (x) grad_i W_ij, likewise: L B is d u_a / d x_b, exact for linear velocities."""

    xx: float
    xy: float
    xz: float
    yx: float
    yy: float
    yz: float
    zx: float
    zy: float
    zz: float


@wp.func
def gradient_with(L: Gradient, s: float, u: float, v: float, w: float, x: float, y: float, z: float) -> Gradient:
    """L with one more neighbour: (u, v, w) = u_i - u_j, (x, y, z) = x_i - x_j and s = V_j s(q)."""
    return Gradient(
        L.xx - s * u * x,
        L.xy - s * u * y,
        L.xz - s * u * z,
        L.yx - s * v * x,
        L.yy - s * v * y,
        L.yz - s * v * z,
        L.zx - s * w * x,
        L.zy - s * w * y,
        L.zz - s * w * z,
    )


@wp.func
def gradient_in_plane_with(
    L: Gradient, s: float, u: float, v: float, w: float, x: float, y: float, z: float
) -> Gradient:
    """The same in a plane."""
    return Gradient(
        L.xx - s * u * x, L.xy, L.xz - s * u * z, L.yx, L.yy, L.yz, L.zx - s * w * x, L.zy, L.zz - s * w * z
    )


@wp.func
def gradient_matrix(L: Gradient, n: float) -> wp.mat33:
    """n L."""
    return n * wp.mat33(L.xx, L.xy, L.xz, L.yx, L.yy, L.yz, L.zx, L.zy, L.zz)


# By the dimensions of space.
MOMENTS_WITH: Mapping[int, wp.Function] = {2: moments_in_plane_with, 3: moments_with}
GRADIENT_WITH: Mapping[int, wp.Function] = {2: gradient_in_plane_with, 3: gradient_with}


@wp.func
def or_identity(B: wp.mat33) -> wp.mat33:
    """B, or the identity in place of 0."""
    if wp.trace(B) == 0.0:
        return wp.identity(n=3, dtype=float)
    return B


@wp.func
def renormalisation(M: wp.mat33) -> wp.mat33:
    """B = M^-1, M = sum_j V_j (x_j - x_i) (x) grad_i W_ij; the identity where the neighbours do not span space.

    Vasco (2014) eq 54 with the plain W, Bonet & Lok (1999). B is symmetric, and exact for linear f is

        grad f = B sum_j V_j (f_j - f_i) grad_i W_ij
    """
    return or_identity(spanning_inverse(M, LEAST_MOMENT, LEAST_SPAN))


@wp.func
def renormalisation_of_a_body(M: wp.mat33) -> wp.mat33:
    """B, or the identity in spray, where dividing by the moments of a few neighbours would feed it energy."""
    return or_identity(spanning_inverse(M, LEAST_BODY, LEAST_BODY))
