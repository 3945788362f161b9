"""Laminar viscosity: forces of a viscosity mu_i [Pa s] that each particle has, its own or an apparent one.

Two ways. The pair forms of LAMINAR take the difference of two velocities at once. The stress form of eq 100 takes the
divergence of T = mu D', with D' from the velocity gradients: dearer, but right at a free surface and good for any
stress. All conserve momentum; `cleary` angular momentum as well.

Pair loops read (x, y, z, V) and (u, v, w, mu), packed as those of rates.py: in a plane x lies beside u, in the place of
v. Beyond the particles of a row come the ghosts that mirrors and periodic edges show of particles, each with the
velocity that `velocity_beyond` gives it; they are worked out from their particles in the loop, so that the stages of a
step never wait for ghosts.
"""

import math
from collections.abc import Mapping
from functools import cache

import numpy as np
import warp as wp

from .balance import BALANCE, SURFACE_MOMENT, share_inside
from .corrections import renormalisation
from .images import Images, velocity_beyond
from .parameters import Parameters
from .rates import CPU_LAYOUT, Layout, compiler_options, high, low
from .rheology import Rheology, deviator, magnitude
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


LAMINAR: Mapping[str, wp.Function] = {"morris": morris, "cleary": cleary}


@wp.func
def arithmetic(mu_i: float, mu_j: float) -> float:
    """(mu_i + mu_j) / 2."""
    return 0.5 * (mu_i + mu_j)


@wp.func
def harmonic(mu_i: float, mu_j: float) -> float:
    """2 mu_i mu_j / (mu_i + mu_j): the flux across a jump of the viscosity, Cleary & Monaghan (1999)."""
    return 2.0 * mu_i * mu_j / wp.max(mu_i + mu_j, 1.0e-30)


MEAN: Mapping[str, wp.Function] = {"arithmetic": arithmetic, "harmonic": harmonic}


@cache
def laminar_acceleration_kernel(
    smoothing: str,
    form: str,
    mean: str,
    dimensions: int = 3,
    layout: Layout = CPU_LAYOUT,
    with_images: bool = False,
    balanced: bool = False,
) -> wp.Kernel:
    """The pair loop of viscosity.

        du_i/dt = 1 / rho_i sum_j V_j s_ij F(mu_ij, u_ij, x_ij),    grad_i W_ij = s_ij x_ij

    with F of LAMINAR and mu_ij of MEAN. As (1/r) dW/dr = s_ij, eq 99 needs no 0.01 h^2 beside r^2. Where it is
    `balanced` s_ij has the factor of balance.py.
    """
    slope = SMOOTHING[smoothing].slope
    force, between, balance_of = LAMINAR[form], MEAN[mean], BALANCE[dimensions]
    load, packed, by_column = layout.load[dimensions], layout.packed, layout.by_column

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def laminar_acceleration(
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
        neighbour_list: wp.array[int],
        ghost_source: wp.array[int],
        ghost_image: wp.array[int],
        balance: wp.array[float],
        laminar_acceleration_out: wp.array[wp.vec3],
    ):
        """a_i by viscosity [m/s2]; `place` is `position_volume` as vectors, `balance` is read where that is in."""
        i = first + wp.tid()
        x_i, y_i, z_i, V_i, u_i, v_i, w_i, mu_i = load(position_volume, velocity_viscosity, i)
        dimensions = parameters.dimensions
        b_x, b_y, b_z = float(0.0), float(0.0), float(0.0)
        if wp.static(balanced):
            b_x, b_y, b_z = balance_of(balance, i)

        viscous_x, viscous_y, viscous_z = float(0.0), float(0.0), float(0.0)
        stride = parameters.column_stride if wp.static(by_column) else 1
        k = i * parameters.row_stride
        end = k + inner_count[i] * stride
        while k < end:
            j = neighbour_list[k]
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, mu_j = load(position_volume, velocity_viscosity, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            u, v, w = u_i - u_j, v_i - v_j, w_i - w_j
            r2 = x * x + y * y + z * z
            s = V_j * slope(wp.sqrt(r2) * parameters.inverse_h)
            if wp.static(balanced):
                b_jx, b_jy, b_jz = balance_of(balance, j)
                s *= wp.max(0.0, 1.0 + (b_x - b_jx) * x + (b_y - b_jy) * y + (b_z - b_jz) * z)
            A, B = force(between(mu_i, mu_j), dimensions, u * x + v * y + w * z, r2)
            viscous_x += s * (A * u + B * x)
            viscous_y += s * (A * v + B * y)
            viscous_z += s * (A * w + B * z)
            k += stride

        by_viscosity = wp.vec3(viscous_x, viscous_y, viscous_z)
        if wp.static(with_images):
            x_vec, u_vec = wp.vec3(x_i, y_i, z_i), wp.vec3(u_i, v_i, w_i)
            end = i * parameters.row_stride + neighbour_count[i] * stride
            while k < end:
                j = neighbour_list[k]
                g = j - particle_count
                xV_g = place[j]
                x_s, y_s, z_s, _V_s, u_s, v_s, w_s, mu_s = load(position_volume, velocity_viscosity, ghost_source[g])
                u_g = velocity_beyond(
                    images, ghost_image[g], x_vec, u_vec, wp.vec3(x_s, y_s, z_s), wp.vec3(u_s, v_s, w_s)
                )
                x_ig = x_vec - wp.vec3(xV_g[0], xV_g[1], xV_g[2])
                u_ig = u_vec - u_g
                r2 = wp.dot(x_ig, x_ig)
                s = xV_g[3] * slope(wp.sqrt(r2) * parameters.inverse_h)
                if wp.static(balanced):
                    b_sx, b_sy, b_sz = balance_of(balance, ghost_source[g])
                    b_g = images.rotation[ghost_image[g]] * wp.vec3(b_sx, b_sy, b_sz)
                    s *= wp.max(0.0, 1.0 + wp.dot(wp.vec3(b_x, b_y, b_z) - b_g, x_ig))
                A, B = force(between(mu_i, mu_s), dimensions, wp.dot(u_ig, x_ig), r2)
                by_viscosity += s * (A * u_ig + B * x_ig)
                k += stride

        inverse_rho_i = V_i / parameters.mass[fluid[i]]
        laminar_acceleration_out[i] = inverse_rho_i * parameters.gradient_norm * by_viscosity

    return laminar_acceleration


# ----------------------------------------------------------------------------------------------------- stress form


@cache
def velocity_gradient_kernel(
    smoothing: str, dimensions: int = 3, layout: Layout = CPU_LAYOUT, with_images: bool = False
) -> wp.Kernel:
    """The pair loop of the velocity gradient.

        L_i = (sum_j V_j (u_j - u_i) (x) grad_i W_ij) B_i,    L_ab = d u_a / d x_b

    with B_i of Vasco (2014) eq 54: exact for linear velocities, at a surface and in disorder.
    """
    slope = SMOOTHING[smoothing].slope
    load, packed, by_column = layout.load[dimensions], layout.packed, layout.by_column
    spatial = dimensions == 3

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def velocity_gradient(
        first: int,
        parameters: Parameters,
        images: Images,
        particle_count: int,
        position_volume: wp.array[packed],
        packed_velocity: wp.array[packed],
        place: wp.array[wp.vec4],
        inner_count: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: wp.array[int],
        ghost_source: wp.array[int],
        ghost_image: wp.array[int],
        velocity_gradient_out: wp.array[wp.mat33],
        second_moment_out: wp.array[float],
    ):
        """L_i [1/s], and tr M_i / d. Behind the velocity anything may be packed; `place` is `position_volume`."""
        i = first + wp.tid()
        x_i, y_i, z_i, _V_i, u_i, v_i, w_i, _p_i = load(position_volume, packed_velocity, i)

        L_xx, L_xy, L_xz = float(0.0), float(0.0), float(0.0)
        L_yx, L_yy, L_yz = float(0.0), float(0.0), float(0.0)
        L_zx, L_zy, L_zz = float(0.0), float(0.0), float(0.0)
        M_xx, M_xy, M_xz = float(0.0), float(0.0), float(0.0)
        M_yy, M_yz, M_zz = float(0.0), float(0.0), float(0.0)
        stride = parameters.column_stride if wp.static(by_column) else 1
        k = i * parameters.row_stride
        end = k + inner_count[i] * stride
        while k < end:
            j = neighbour_list[k]
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, _p_j = load(position_volume, packed_velocity, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            u, v, w = u_i - u_j, v_i - v_j, w_i - w_j
            s = V_j * slope(wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h)
            sx, sy, sz = s * x, s * y, s * z
            L_xx -= u * sx
            L_xz -= u * sz
            L_zx -= w * sx
            L_zz -= w * sz
            M_xx -= x * sx
            M_xz -= x * sz
            M_zz -= z * sz
            if wp.static(spatial):
                L_xy -= u * sy
                L_yx -= v * sx
                L_yy -= v * sy
                L_yz -= v * sz
                L_zy -= w * sy
                M_xy -= x * sy
                M_yy -= y * sy
                M_yz -= y * sz
            k += stride

        L = wp.mat33(L_xx, L_xy, L_xz, L_yx, L_yy, L_yz, L_zx, L_zy, L_zz)
        M = wp.mat33(M_xx, M_xy, M_xz, M_xy, M_yy, M_yz, M_xz, M_yz, M_zz)
        if wp.static(with_images):
            x_vec, u_vec = wp.vec3(x_i, y_i, z_i), wp.vec3(u_i, v_i, w_i)
            end = i * parameters.row_stride + neighbour_count[i] * stride
            while k < end:
                j = neighbour_list[k]
                g = j - particle_count
                xV_g = place[j]
                x_s, y_s, z_s, _V_s, u_s, v_s, w_s, _p_s = load(position_volume, packed_velocity, ghost_source[g])
                u_g = velocity_beyond(
                    images, ghost_image[g], x_vec, u_vec, wp.vec3(x_s, y_s, z_s), wp.vec3(u_s, v_s, w_s)
                )
                x_ig = x_vec - wp.vec3(xV_g[0], xV_g[1], xV_g[2])
                s = xV_g[3] * slope(wp.sqrt(wp.dot(x_ig, x_ig)) * parameters.inverse_h)
                L -= s * wp.outer(u_vec - u_g, x_ig)
                M -= s * wp.outer(x_ig, x_ig)
                k += stride
        n = parameters.gradient_norm
        velocity_gradient_out[i] = (n * L) * renormalisation(n * M)
        second_moment_out[i] = n * wp.trace(M) / float(parameters.dimensions)

    return velocity_gradient


@cache
def yielding_kernel(
    smoothing: str, mean: str, dimensions: int = 3, layout: Layout = CPU_LAYOUT, with_images: bool = False
) -> wp.Kernel:
    """The pair loop of the stress that acts between pairs, and whether it is above the yield stress.

        T_i = D'(sum_j V_j mu_ij (u_j - u_i) (x) grad_i W_ij B_i),    yielded: sqrt(T : T / 2) > tau_y

    with mu_ij of MEAN. Across the edge of a plug the stress is smooth, and the rate of shear is not: a rate that is
    summed over neighbours on both sides melts the edge of the plug in, the stress of the same pairs does not.
    """
    slope, between = SMOOTHING[smoothing].slope, MEAN[mean]
    load, packed, by_column = layout.load[dimensions], layout.packed, layout.by_column

    @wp.kernel(module="unique", enable_backward=False)
    def find_yielding(
        first: int,
        parameters: Parameters,
        images: Images,
        particle_count: int,
        position_volume: wp.array[packed],
        packed_velocity: wp.array[packed],
        place: wp.array[wp.vec4],
        fluid: wp.array[int],
        inner_count: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: wp.array[int],
        ghost_source: wp.array[int],
        ghost_image: wp.array[int],
        viscosity: wp.array[float],
        yield_stress: wp.array[float],
        yielded_out: wp.array[int],
    ):
        """1 where the fluid flows, 0 where it is a plug: tau <= tau_y, Vasco (2014) eq 104."""
        i = first + wp.tid()
        x_i, y_i, z_i, _V_i, u_i, v_i, w_i, _p_i = load(position_volume, packed_velocity, i)
        x_vec, u_vec = wp.vec3(x_i, y_i, z_i), wp.vec3(u_i, v_i, w_i)
        G = wp.mat33()
        M = wp.mat33()
        stride = parameters.column_stride if wp.static(by_column) else 1
        row = i * parameters.row_stride
        for k in range(inner_count[i]):
            j = neighbour_list[row + k * stride]
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, _p_j = load(position_volume, packed_velocity, j)
            x_ij, u_ij = x_vec - wp.vec3(x_j, y_j, z_j), u_vec - wp.vec3(u_j, v_j, w_j)
            s = V_j * slope(wp.length(x_ij) * parameters.inverse_h)
            G -= s * between(viscosity[i], viscosity[j]) * wp.outer(u_ij, x_ij)
            M -= s * wp.outer(x_ij, x_ij)
        if wp.static(with_images):
            for k in range(inner_count[i], neighbour_count[i]):
                j = neighbour_list[row + k * stride]
                g = j - particle_count
                source = ghost_source[g]
                xV_g = place[j]
                x_s, y_s, z_s, _V_s, u_s, v_s, w_s, _p_s = load(position_volume, packed_velocity, source)
                u_g = velocity_beyond(
                    images, ghost_image[g], x_vec, u_vec, wp.vec3(x_s, y_s, z_s), wp.vec3(u_s, v_s, w_s)
                )
                x_ig = x_vec - wp.vec3(xV_g[0], xV_g[1], xV_g[2])
                s = xV_g[3] * slope(wp.length(x_ig) * parameters.inverse_h)
                G -= s * between(viscosity[i], viscosity[source]) * wp.outer(u_vec - u_g, x_ig)
                M -= s * wp.outer(x_ig, x_ig)
        n = parameters.gradient_norm
        tau = magnitude(deviator((n * G) * renormalisation(n * M), parameters.dimensions))
        tau_y = yield_stress[fluid[i]]
        yielded_out[i] = wp.where(tau_y > 0.0 and tau <= tau_y, 0, 1)

    return find_yielding


@wp.func
def isotropic(value: float, dimensions: int) -> wp.mat33:
    """`value` times the identity, which in the plane has no y."""
    return wp.diag(wp.vec3(value, wp.where(dimensions == 3, value, 0.0), value))


@cache
def transposed_stress_kernel(dimensions: int) -> wp.Kernel:
    """S = mu (grad u^T - (2 / d) (div u) I) of each particle: T of rheology.py less mu grad u, which eq 99 holds."""
    spatial = dimensions == 3

    @wp.kernel(module="unique", enable_backward=False)
    def transposed_stress(
        first: int,
        velocity_gradient: wp.array[wp.mat33],
        viscosity: wp.array[float],
        dimensions: int,
        stress_out: wp.array[wp.vec4],
    ):
        """S_i [Pa], packed: (xx, xz, zx, zz) in the plane, and in space three rows, each with a place to spare."""
        i = first + wp.tid()
        L = velocity_gradient[i]
        dilation = isotropic(2.0 / float(dimensions) * wp.trace(L), dimensions)
        S = viscosity[i] * (wp.transpose(L) - dilation)
        if wp.static(spatial):
            stress_out[3 * i] = wp.vec4(S[0, 0], S[0, 1], S[0, 2], 0.0)
            stress_out[3 * i + 1] = wp.vec4(S[1, 0], S[1, 1], S[1, 2], 0.0)
            stress_out[3 * i + 2] = wp.vec4(S[2, 0], S[2, 1], S[2, 2], 0.0)
        else:
            stress_out[i] = wp.vec4(S[0, 0], S[0, 2], S[2, 0], S[2, 2])

    return transposed_stress


@wp.func
def tensor_of_pairs_in_plane(stress: wp.array[wp.uint64], i: int):
    """xx, xy, xz, yx, yy, yz, zx, zy, zz of particle i in a plane, in two loads of two floats."""
    xx_xz, zx_zz = stress[2 * i], stress[2 * i + 1]
    return low(xx_xz), 0.0, high(xx_xz), 0.0, 0.0, 0.0, low(zx_zz), 0.0, high(zx_zz)


@wp.func
def tensor_of_pairs(stress: wp.array[wp.uint64], i: int):
    """The same in space, in six."""
    xx_xy, xz, yx_yy = stress[6 * i], stress[6 * i + 1], stress[6 * i + 2]
    yz, zx_zy, zz = stress[6 * i + 3], stress[6 * i + 4], stress[6 * i + 5]
    return low(xx_xy), high(xx_xy), low(xz), low(yx_yy), high(yx_yy), low(yz), low(zx_zy), high(zx_zy), low(zz)


@wp.func
def tensor_of_vectors_in_plane(stress: wp.array[wp.vec4], i: int):
    """The same in a plane, in one load of four floats."""
    S = stress[i]
    return S[0], 0.0, S[1], 0.0, 0.0, 0.0, S[2], 0.0, S[3]


@wp.func
def tensor_of_vectors(stress: wp.array[wp.vec4], i: int):
    """The same in space, in three."""
    x, y, z = stress[3 * i], stress[3 * i + 1], stress[3 * i + 2]
    return x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]


# By what memory is seen as, and the dimensions of space.
TENSOR: Mapping[tuple[type, int], wp.Function] = {
    (wp.uint64, 2): tensor_of_pairs_in_plane,
    (wp.uint64, 3): tensor_of_pairs,
    (wp.vec4, 2): tensor_of_vectors_in_plane,
    (wp.vec4, 3): tensor_of_vectors,
}


@wp.func
def stress_beyond(images: Images, k: int, S: wp.mat33, dimensions: int) -> wp.mat33:
    """S [Pa] at the ghost of a particle with S through image k.

    u' = F u + f at x' = R x + t has the gradient F L R^T, and mu L = S^T - (2 / d) (tr S) I. Where the wall's own
    velocity stands for that of every ghost, or it is extrapolated from the wall, the flow goes on beyond the wall as it
    comes, F = -1: a velocity that is the same everywhere would end the stress at the wall.
    """
    F = images.friction[k]
    if images.extrapolates[k] != 0 or wp.ddot(F, F) == 0.0:
        F = -wp.identity(n=3, dtype=float)
    share = 2.0 / float(dimensions)
    mu_L = wp.transpose(S) - isotropic(share * wp.trace(S), dimensions)
    beyond = F * mu_L * wp.transpose(images.rotation[k])
    return wp.transpose(beyond) - isotropic(share * wp.trace(beyond), dimensions)


@cache
def stress_acceleration_kernel(
    smoothing: str,
    mean: str,
    dimensions: int = 3,
    layout: Layout = CPU_LAYOUT,
    with_images: bool = False,
    balanced: bool = False,
) -> wp.Kernel:
    """The pair loop of the divergence of the stress T = mu (grad u + grad u^T - (2 / d) (div u) I) = mu grad u + S.

        du_i/dt = 1 / rho_i sum_j V_j s_ij ((S_i + S_j) x_ij + 2 mu_ij u_ij)

    The first part is Vasco (2014) eq 100, without its pressure, which eq 38 holds, and with the material derivative
    that it means; the second is eq 99. Eq 100 for all of T is blind to a velocity that alternates from particle to
    particle: it has no gradient there, and whatever has made it, a wall for one, it stays. In a linear flow of one
    viscosity both are the same. Rigid rotation is left alone, and a free surface feels no stress. Where it is
    `balanced` s_ij has the factor of balance.py.
    """
    slope, between, balance_of = SMOOTHING[smoothing].slope, MEAN[mean], BALANCE[dimensions]
    load, packed, by_column = layout.load[dimensions], layout.packed, layout.by_column
    tensor = TENSOR[layout.packed, dimensions]
    spatial = dimensions == 3

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def stress_acceleration(
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
        neighbour_list: wp.array[int],
        ghost_source: wp.array[int],
        ghost_image: wp.array[int],
        stress: wp.array[packed],
        balance: wp.array[float],
        stress_acceleration_out: wp.array[wp.vec3],
    ):
        """a_i by stress [m/s2]; `stress` is S of `transposed_stress_kernel`, `balance` is read where that is in."""
        i = first + wp.tid()
        x_i, y_i, z_i, V_i, u_i, v_i, w_i, mu_i = load(position_volume, velocity_viscosity, i)
        b_x, b_y, b_z = float(0.0), float(0.0), float(0.0)
        if wp.static(balanced):
            b_x, b_y, b_z = balance_of(balance, i)
        xx_i, xy_i, xz_i, yx_i, yy_i, yz_i, zx_i, zy_i, zz_i = tensor(stress, i)

        stress_x, stress_y, stress_z = float(0.0), float(0.0), float(0.0)
        stride = parameters.column_stride if wp.static(by_column) else 1
        k = i * parameters.row_stride
        end = k + inner_count[i] * stride
        while k < end:
            j = neighbour_list[k]
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, mu_j = load(position_volume, velocity_viscosity, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            u, v, w = u_i - u_j, v_i - v_j, w_i - w_j
            s = V_j * slope(wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h)
            if wp.static(balanced):
                b_jx, b_jy, b_jz = balance_of(balance, j)
                s *= wp.max(0.0, 1.0 + (b_x - b_jx) * x + (b_y - b_jy) * y + (b_z - b_jz) * z)
            mu = 2.0 * between(mu_i, mu_j)
            xx, xy, xz, yx, yy, yz, zx, zy, zz = tensor(stress, j)
            stress_x += s * ((xx_i + xx) * x + (xz_i + xz) * z + mu * u)
            stress_z += s * ((zx_i + zx) * x + (zz_i + zz) * z + mu * w)
            if wp.static(spatial):
                stress_x += s * (xy_i + xy) * y
                stress_y += s * ((yx_i + yx) * x + (yy_i + yy) * y + (yz_i + yz) * z + mu * v)
                stress_z += s * (zy_i + zy) * y
            k += stride

        by_stress = wp.vec3(stress_x, stress_y, stress_z)
        if wp.static(with_images):
            x_vec, u_vec = wp.vec3(x_i, y_i, z_i), wp.vec3(u_i, v_i, w_i)
            S_i = wp.mat33(xx_i, xy_i, xz_i, yx_i, yy_i, yz_i, zx_i, zy_i, zz_i)
            end = i * parameters.row_stride + neighbour_count[i] * stride
            while k < end:
                j = neighbour_list[k]
                g = j - particle_count
                source, image, xV_g = ghost_source[g], ghost_image[g], place[j]
                x_s, y_s, z_s, _V_s, u_s, v_s, w_s, mu_s = load(position_volume, velocity_viscosity, source)
                u_g = velocity_beyond(images, image, x_vec, u_vec, wp.vec3(x_s, y_s, z_s), wp.vec3(u_s, v_s, w_s))
                xx, xy, xz, yx, yy, yz, zx, zy, zz = tensor(stress, source)
                S_s = wp.mat33(xx, xy, xz, yx, yy, yz, zx, zy, zz)
                S_g = stress_beyond(images, image, S_s, parameters.dimensions)
                x_ig = x_vec - wp.vec3(xV_g[0], xV_g[1], xV_g[2])
                s = xV_g[3] * slope(wp.sqrt(wp.dot(x_ig, x_ig)) * parameters.inverse_h)
                if wp.static(balanced):
                    b_sx, b_sy, b_sz = balance_of(balance, source)
                    b_g = images.rotation[image] * wp.vec3(b_sx, b_sy, b_sz)
                    s *= wp.max(0.0, 1.0 + wp.dot(wp.vec3(b_x, b_y, b_z) - b_g, x_ig))
                by_stress += s * ((S_i + S_g) * x_ig + 2.0 * between(mu_i, mu_s) * (u_vec - u_g))
                k += stride
        inverse_rho_i = V_i / parameters.mass[fluid[i]]
        stress_acceleration_out[i] = inverse_rho_i * parameters.gradient_norm * by_stress

    return stress_acceleration


# dt <= C rho h^2 / mu. integrators.py predicts the velocity at half steps from the last two, u + dt/2 F: for viscosity
# that is Adams-Bashforth of second order, which takes lambda dt <= 1, lambda being the fastest rate at which a velocity
# decays. Heun's scheme and the midpoint rule take 2, so twice this step.
VISCOUS_COURANT: Mapping[str, float] = {"morris": 0.125, "cleary": 0.045, "stress": 0.125}

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
    u = velocity[i]
    v = wp.where(parameters.dimensions == 2, position_volume[i][0], u[1])
    velocity_viscosity_out[i] = wp.vec4(u[0], v, u[2], viscosity[i])


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
    v = wp.where(parameters.dimensions == 2, position_volume[i][0], u[1])
    viscous_acceleration_inout[i] = a
    velocity_viscosity_out[i] = wp.vec4(u[0], v, u[2], viscosity[i])


@wp.kernel(enable_backward=False)
def add_acceleration(first: int, acceleration: wp.array[wp.vec3], acceleration_inout: wp.array[wp.vec3]):
    """One acceleration onto another [m/s2]."""
    i = first + wp.tid()
    acceleration_inout[i] = acceleration_inout[i] + acceleration[i]


# ---------------------------------------------------------------------------------- artificial viscosity, read anew


def artificial_share(viscosity: str, smoothing: str, dimensions: int) -> float:
    """The artificial viscosity as a real one: nu = share alpha c h [m2/s].

    A pair pressure -g(r) (u_ij . x_ij) is a viscosity of nu = (1 / (2 (d + 2))) <g r^2>, weighted with -r dW/dr, whose
    integral over space is d. For `signal` (eq 61) g = alpha c / r, so that nu = 3/16 alpha c <r> in the plane: 1/8 with
    the Wendland kernel, 15/112 with the cubic spline. For `monaghan` (eq 58, beta = 0) g = alpha c h / (r^2 + 0.01 h^2)
    on approaching pairs, which in shear are half of them: 1/16 in the plane, less 1 or 2 % by the 0.01 h^2.
    """
    kernel = SMOOTHING[smoothing]
    # Gauss-Legendre nodes between the knots of the kernels, all of them whole numbers.
    node, weight = np.polynomial.legendre.leggauss(24)
    q = np.concatenate([0.5 * (node + 1.0) + knot for knot in range(int(kernel.support))])
    weight = 0.5 * np.tile(weight, int(kernel.support))
    slope = np.array([float(kernel.slope(float(value))) for value in q])
    sphere = 2.0 * math.pi if dimensions == 2 else 4.0 * math.pi
    density = -sphere * kernel.normalisation[dimensions] * slope * q ** (dimensions + 1) / dimensions
    g = {"signal": q, "monaghan": 0.5 * q**2 / (q**2 + 0.01)}[viscosity]
    return float(np.sum(weight * density * g)) / (2.0 * (dimensions + 2))
