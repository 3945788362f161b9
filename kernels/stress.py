"""The stress of viscosity: velocity gradients, the divergence of the stress, and where it is above the yield.

The form of eq 100 takes the divergence of T = mu D', with D' from the velocity gradients: dearer than the pair forms of
viscosity.py, but right at a free surface and good for any stress. Pair loops read particles and ghosts as those do.
"""

from collections.abc import Mapping
from functools import cache

import warp as wp

from .balance import BALANCE, balance_factor
from .corrections import (
    GRADIENT_WITH,
    MOMENTS_WITH,
    Gradient,
    Moments,
    gradient_matrix,
    moments_matrix,
    renormalisation,
)
from .images import Images, ghost_pair
from .layout import CPU_LAYOUT, Layout, Rows, compiler_options, high, low
from .parameters import Parameters
from .rheology import deviator, isotropic, magnitude
from .smoothing import SMOOTHING
from .viscosity import MEAN, unless_it_slips


@cache
def velocity_gradient_kernel(
    smoothing: str,
    dimensions: int = 3,
    layout: Layout = CPU_LAYOUT,
    with_images: bool = False,
    walled: bool = False,
) -> wp.Kernel:
    """The pair loop of the velocity gradient.

        L_i = (sum_j V_j (u_j - u_i) (x) grad_i W_ij) B_i,    L_ab = d u_a / d x_b

    with B_i of Vasco (2014) eq 54: exact for linear velocities, at a surface and in disorder. Where it is `walled` rows
    end with dummy particles, and the fourth number of the packed velocity is a viscosity.
    """
    slope, moments_with, gradient_with = SMOOTHING[smoothing].slope, MOMENTS_WITH[dimensions], GRADIENT_WITH[dimensions]
    load, packed, entry = layout.load[dimensions], layout.packed, layout.entry
    with_ghost = ghost_pair(smoothing, dimensions, layout)

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
        neighbour_list: Rows,
        ghost_source: wp.array[int],
        ghost_image: wp.array[int],
        velocity_gradient_out: wp.array[wp.mat33],
        second_moment_out: wp.array[float],
    ):
        """L_i [1/s], and tr M_i / d. Behind velocities anything may be packed; `place` is `position_volume`."""
        i = first + wp.tid()
        x_i, y_i, z_i, _V_i, u_i, v_i, w_i, _p_i = load(position_volume, packed_velocity, i)

        M, L = Moments(), Gradient()
        k, end = int(0), int(inner_count[i])
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, mu_j = load(position_volume, packed_velocity, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            u, v, w = u_i - u_j, v_i - v_j, w_i - w_j
            s = V_j * slope(wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h)
            if wp.static(walled):
                s = unless_it_slips(particle_count, j, mu_j, s)
            M = moments_with(M, s, x, y, z)
            L = gradient_with(L, s, u, v, w, x, y, z)
            k += 1

        if wp.static(with_images):
            x_vec, u_vec = wp.vec3(x_i, y_i, z_i), wp.vec3(u_i, v_i, w_i)
            end = neighbour_count[i]
            while k < end:
                j = entry(neighbour_list, i, k)
                g = j - particle_count
                source, image = ghost_source[g], ghost_image[g]
                s, x_ig, u_ig, _p_s = with_ghost(
                    parameters, images, position_volume, packed_velocity, source, image, place[j], x_vec, u_vec
                )
                M = moments_with(M, s, x_ig[0], x_ig[1], x_ig[2])
                L = gradient_with(L, s, u_ig[0], u_ig[1], u_ig[2], x_ig[0], x_ig[1], x_ig[2])
                k += 1
        n = parameters.gradient_norm
        velocity_gradient_out[i] = gradient_matrix(L, n) * renormalisation(moments_matrix(M, n))
        second_moment_out[i] = n * (M.xx + M.yy + M.zz) / float(parameters.dimensions)

    return velocity_gradient


@cache
def yielding_kernel(
    smoothing: str,
    mean: str,
    dimensions: int = 3,
    layout: Layout = CPU_LAYOUT,
    with_images: bool = False,
    walled: bool = False,
) -> wp.Kernel:
    """The pair loop of the stress that acts between pairs, and whether it is above the yield stress.

        T_i = D'(sum_j V_j mu_ij (u_j - u_i) (x) grad_i W_ij B_i),    yielded: sqrt(T : T / 2) > tau_y

    with mu_ij of MEAN. Across the edge of a plug the stress is smooth, and the rate of shear is not: a rate that is
    summed over neighbours on both sides melts the edge of the plug in, the stress of the same pairs does not.
    """
    slope, between = SMOOTHING[smoothing].slope, MEAN[mean]
    moments_with, gradient_with = MOMENTS_WITH[dimensions], GRADIENT_WITH[dimensions]
    load, packed, entry = layout.load[dimensions], layout.packed, layout.entry
    with_ghost = ghost_pair(smoothing, dimensions, layout)

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
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
        neighbour_list: Rows,
        ghost_source: wp.array[int],
        ghost_image: wp.array[int],
        viscosity: wp.array[float],
        yield_stress: wp.array[float],
        yielded_out: wp.array[int],
    ):
        """1 where the fluid flows, 0 where it is a plug: tau <= tau_y, Vasco (2014) eq 104."""
        i = first + wp.tid()
        x_i, y_i, z_i, _V_i, u_i, v_i, w_i, _p_i = load(position_volume, packed_velocity, i)
        mu_i = viscosity[i]

        M, G = Moments(), Gradient()
        k, end = int(0), int(inner_count[i])
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, packed_j = load(position_volume, packed_velocity, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            s = V_j * slope(wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h)
            mu_j = float(packed_j)
            if wp.static(walled):
                s = unless_it_slips(particle_count, j, packed_j, s)
            else:
                mu_j = viscosity[j]
            M = moments_with(M, s, x, y, z)
            G = gradient_with(G, s * between(mu_i, mu_j), u_i - u_j, v_i - v_j, w_i - w_j, x, y, z)
            k += 1

        if wp.static(with_images):
            x_vec, u_vec = wp.vec3(x_i, y_i, z_i), wp.vec3(u_i, v_i, w_i)
            end = neighbour_count[i]
            while k < end:
                j = entry(neighbour_list, i, k)
                g = j - particle_count
                source, image = ghost_source[g], ghost_image[g]
                s, x_ig, u_ig, _p_s = with_ghost(
                    parameters, images, position_volume, packed_velocity, source, image, place[j], x_vec, u_vec
                )
                M = moments_with(M, s, x_ig[0], x_ig[1], x_ig[2])
                s *= between(mu_i, viscosity[source])
                G = gradient_with(G, s, u_ig[0], u_ig[1], u_ig[2], x_ig[0], x_ig[1], x_ig[2])
                k += 1
        n = parameters.gradient_norm
        tau = magnitude(deviator(gradient_matrix(G, n) * renormalisation(moments_matrix(M, n)), parameters.dimensions))
        tau_y = yield_stress[fluid[i]]
        yielded_out[i] = wp.where(tau_y > 0.0 and tau <= tau_y, 0, 1)

    return find_yielding


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
    velocity stands for every ghost's, or it is extrapolated from the wall, the flow goes on beyond the wall as it
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
    walled: bool = False,
) -> wp.Kernel:
    """The pair loop of the divergence of the stress T = mu (grad u + grad u^T - (2 / d) (div u) I) = mu grad u + S.

        du_i/dt = 1 / rho_i sum_j V_j s_ij ((S_i + S_j) x_ij + 2 mu_ij u_ij)

    The first part is Vasco (2014) eq 100, without its pressure, which eq 38 holds, and with the material derivative
    that it means; the second is eq 99. Eq 100 for all of T is blind to a velocity that alternates from particle to
    particle: it has no gradient there, and whatever has made it, a wall for one, it stays. In a linear flow of one
    viscosity both are the same. Rigid rotation is left alone, and a free surface feels no stress. Where it is
    `balanced` s_ij has the factor of balance.py. Where it is `walled` rows end with dummy particles: S goes on into a
    wall as it is before it.
    """
    slope, between, balance_of = SMOOTHING[smoothing].slope, MEAN[mean], BALANCE[dimensions]
    load, packed, entry = layout.load[dimensions], layout.packed, layout.entry
    with_ghost = ghost_pair(smoothing, dimensions, layout)
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
        neighbour_list: Rows,
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
        k, end = int(0), int(inner_count[i])
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, mu_j = load(position_volume, velocity_viscosity, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            u, v, w = u_i - u_j, v_i - v_j, w_i - w_j
            s = V_j * slope(wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h)
            if wp.static(balanced):
                b_jx, b_jy, b_jz = balance_of(balance, j)
                s *= balance_factor(b_x - b_jx, b_y - b_jy, b_z - b_jz, x, y, z)
            stressed = int(j)
            if wp.static(walled):
                s = unless_it_slips(particle_count, j, mu_j, s)
                stressed = wp.where(j < particle_count, j, i)
            mu = 2.0 * between(mu_i, mu_j)
            xx, xy, xz, yx, yy, yz, zx, zy, zz = tensor(stress, stressed)
            stress_x += s * ((xx_i + xx) * x + (xz_i + xz) * z + mu * u)
            stress_z += s * ((zx_i + zx) * x + (zz_i + zz) * z + mu * w)
            if wp.static(spatial):
                stress_x += s * (xy_i + xy) * y
                stress_y += s * ((yx_i + yx) * x + (yy_i + yy) * y + (yz_i + yz) * z + mu * v)
                stress_z += s * (zy_i + zy) * y
            k += 1

        by_stress = wp.vec3(stress_x, stress_y, stress_z)
        if wp.static(with_images):
            x_vec, u_vec = wp.vec3(x_i, y_i, z_i), wp.vec3(u_i, v_i, w_i)
            S_i = wp.mat33(xx_i, xy_i, xz_i, yx_i, yy_i, yz_i, zx_i, zy_i, zz_i)
            end = neighbour_count[i]
            while k < end:
                j = entry(neighbour_list, i, k)
                g = j - particle_count
                source, image = ghost_source[g], ghost_image[g]
                s, x_ig, u_ig, mu_s = with_ghost(
                    parameters, images, position_volume, velocity_viscosity, source, image, place[j], x_vec, u_vec
                )
                xx, xy, xz, yx, yy, yz, zx, zy, zz = tensor(stress, source)
                S_s = wp.mat33(xx, xy, xz, yx, yy, yz, zx, zy, zz)
                S_g = stress_beyond(images, image, S_s, parameters.dimensions)
                if wp.static(balanced):
                    b_sx, b_sy, b_sz = balance_of(balance, source)
                    b = wp.vec3(b_x, b_y, b_z) - images.rotation[image] * wp.vec3(b_sx, b_sy, b_sz)
                    s *= balance_factor(b[0], b[1], b[2], x_ig[0], x_ig[1], x_ig[2])
                by_stress += s * ((S_i + S_g) * x_ig + 2.0 * between(mu_i, mu_s) * u_ig)
                k += 1
        inverse_rho_i = V_i / parameters.mass[fluid[i]]
        stress_acceleration_out[i] = inverse_rho_i * parameters.gradient_norm * by_stress

    return stress_acceleration
