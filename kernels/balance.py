"""Balance: weights of pairs with which viscosity leaves a linear flow alone, wherever particles stand.

Of u = G x eq 99 makes an acceleration along G sum_j V_j grad_i W_ij, which is 0 on a lattice and noise in disorder. A
factor on the weight of each pair, the same for both of it, so that momentum stays conserved and kinetic energy is lost,

    f_ij = 1 + (lambda_i - lambda_j) . x_ij >= 0,    with sum_j V_j f_ij grad_i W_ij = 0

takes that away. lambda depends on positions alone. It is the solution of a system over all particles, which Jacobi's
iteration approaches by one sweep a step, starting from lambda of the step before; B_i is from eq 54:

    lambda_i = B_i sum_j V_j (1 - lambda_j . x_ij) grad_i W_ij

Near a surface, where neighbours are missing and not only out of place, lambda fades to 0.
"""

from collections.abc import Mapping
from functools import cache

import warp as wp

from .corrections import LEAST_MOMENT, LEAST_SPAN, MOMENTS_WITH, Moments, moments_matrix, spanning_inverse
from .images import Images
from .layout import CPU_LAYOUT, Layout, Rows, compiler_options
from .parameters import Parameters
from .smoothing import SMOOTHING

# Second moments below the first of these belong to a surface, above the second to the inside.
SURFACE_MOMENT = wp.constant(0.85)
INNER_MOMENT = wp.constant(0.95)


@wp.func
def share_inside(moment: float) -> float:
    """0 at a surface, 1 inside: by the second moment tr M_i / d of the neighbours, M of eq 54."""
    return wp.clamp((moment - SURFACE_MOMENT) / (INNER_MOMENT - SURFACE_MOMENT), 0.0, 1.0)


@wp.func
def balance_in_plane(balance: wp.array[float], i: int):
    """lambda_i [1/m] in a plane, of the floats of all."""
    return balance[3 * i], 0.0, balance[3 * i + 2]


@wp.func
def balance_in_space(balance: wp.array[float], i: int):
    """The same in space."""
    return balance[3 * i], balance[3 * i + 1], balance[3 * i + 2]


BALANCE: Mapping[int, wp.Function] = {2: balance_in_plane, 3: balance_in_space}  # by the dimensions of space


@wp.func
def balance_factor(b_x: float, b_y: float, b_z: float, x: float, y: float, z: float) -> float:
    """f_ij of a pair that lies x_ij apart, by b = lambda_i - lambda_j."""
    return wp.max(0.0, 1.0 + b_x * x + b_y * y + b_z * z)


@cache
def balance_kernel(
    smoothing: str, dimensions: int = 3, layout: Layout = CPU_LAYOUT, with_images: bool = False
) -> wp.Kernel:
    """The pair loop of lambda: one sweep of Jacobi's iteration."""
    slope, moments_with = SMOOTHING[smoothing].slope, MOMENTS_WITH[dimensions]
    load, packed, entry = layout.load[dimensions], layout.packed, layout.entry
    of = BALANCE[dimensions]

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def find_balance(
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
        balance: wp.array[float],
        balance_out: wp.array[wp.vec3],
    ):
        """lambda_i [1/m]; `balance` is lambda of the sweep before, `place` is `position_volume` as vectors."""
        i = first + wp.tid()
        x_i, y_i, z_i, _V_i, _u_i, _v_i, _w_i, _p_i = load(position_volume, packed_velocity, i)

        M = Moments()
        rest_x, rest_y, rest_z = float(0.0), float(0.0), float(0.0)
        k, end = int(0), int(inner_count[i])
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, y_j, z_j, V_j, _u_j, _v_j, _w_j, _p_j = load(position_volume, packed_velocity, j)
            b_x, b_y, b_z = of(balance, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            s = V_j * slope(wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h)
            t = s * (1.0 - b_x * x - b_y * y - b_z * z)
            M = moments_with(M, s, x, y, z)
            rest_x += t * x
            rest_y += t * y
            rest_z += t * z
            k += 1

        rest = wp.vec3(rest_x, rest_y, rest_z)
        if wp.static(with_images):
            x_vec = wp.vec3(x_i, y_i, z_i)
            end = neighbour_count[i]
            while k < end:
                j = entry(neighbour_list, i, k)
                g = j - particle_count
                b_x, b_y, b_z = of(balance, ghost_source[g])
                lambda_g = images.rotation[ghost_image[g]] * wp.vec3(b_x, b_y, b_z)
                xV_g = place[j]
                x_ig = x_vec - wp.vec3(xV_g[0], xV_g[1], xV_g[2])
                s = xV_g[3] * slope(wp.sqrt(wp.dot(x_ig, x_ig)) * parameters.inverse_h)
                M = moments_with(M, s, x_ig[0], x_ig[1], x_ig[2])
                rest += s * (1.0 - wp.dot(lambda_g, x_ig)) * x_ig
                k += 1
        n = parameters.gradient_norm
        inside = share_inside(n * (M.xx + M.yy + M.zz) / float(parameters.dimensions))
        balance_out[i] = inside * (spanning_inverse(moments_matrix(M, n), LEAST_MOMENT, LEAST_SPAN) * (n * rest))

    return find_balance


@wp.kernel(enable_backward=False)
def keep_balance(first: int, balance: wp.array[wp.vec3], kept_balance_out: wp.array[wp.vec3]):
    """lambda for the next step to begin with [1/m]."""
    i = first + wp.tid()
    kept_balance_out[i] = balance[i]
