"""Shifting: particles drift to where there are fewer of them, so that they stay in order.

Fick's law for the concentration C = sum_j V_j W_ij, as Lind et al. (2012) have it, with the term by which Sun et al.
(2017) keep pairs apart:

    du_i = -A h^2 g_i P_i grad C_i,    grad C_i = sum_j V_j (1 + R (W_ij / W(dx))^4) grad_i W_ij

Others scale it with the speed, Sun et al. with the highest of all. Here g_i is the shear rate: strain is what brings
disorder, so what undoes it goes at that pace, in any frame of reference. Fluid at rest, in rigid motion or in the plug
of a yield stress is not shifted. Near a surface, where C falls without any disorder, P_i = I - n n leaves out what
would go through it; the surface and its normal are told by the least eigenvalue of the moments, Marrone et al. (2010).

Velocities are left alone, which conserves momentum, or become the velocities of the places that particles drift to,

    du_i/dt = L_i du_i,    L_ab = d u_a / d x_b

as in Xu, Stansby & Laurence (2009). A velocity that a particle takes along through a shear is an error of first order.
"""

from functools import cache

import warp as wp

from .corrections import (
    GRADIENT_WITH,
    MOMENTS_WITH,
    Gradient,
    Moments,
    gradient_matrix,
    moments_matrix,
    renormalisation,
)
from .layout import CPU_LAYOUT, Layout, Rows, compiler_options
from .parameters import Parameters
from .rates import Formulas
from .smoothing import SMOOTHING

PAIRING = wp.constant(0.2)  # R of Sun et al. (2017)
# Least eigenvalues: 1 inside, 0.84 in the second row of a lattice, 0.5 at its surface, 0.25 in a corner. What has less
# than the first is spray and is not shifted; less than the second is a surface.
SPRAY, SURFACE = wp.constant(0.4), wp.constant(0.75)
# Most that a particle drifts, over h times the shear rate.
MOST_DRIFT = wp.constant(1.0)


@wp.func
def least_eigenvalue(M: wp.mat33) -> float:
    """Of a symmetric matrix, in closed form; in a plane, where M has no y row, of the other two."""
    flat = M[1, 1] == 0.0
    mean = wp.trace(M) / wp.where(flat, 2.0, 3.0)
    A = M - wp.diag(wp.vec3(mean, wp.where(flat, 0.0, mean), mean))
    p = wp.sqrt(wp.ddot(A, A) / 6.0)
    if p < 1.0e-6:
        return mean
    angle = wp.acos(wp.clamp(0.5 * wp.determinant(A / p), -1.0, 1.0)) / 3.0
    return mean + 2.0 * p * wp.cos(angle + 2.0943951)


@cache
def cover_kernel(formulas: Formulas, layout: Layout = CPU_LAYOUT) -> wp.Kernel:
    """The pair loop of the moments of neighbours, M = sum_j V_j (x_j - x_i) (x) grad_i W_ij; as in rates.py."""
    slope, moments_with = SMOOTHING[formulas.smoothing].slope, MOMENTS_WITH[formulas.dimensions]
    load, packed, entry = layout.load[formulas.dimensions], layout.packed, layout.entry

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def find_cover(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[packed],
        velocity_pressure: wp.array[packed],
        neighbour_count: wp.array[int],
        neighbour_list: Rows,
        cover_out: wp.array[float],
    ):
        """The least eigenvalue of M: 1 where there are neighbours on all sides, less near a surface."""
        i = first + wp.tid()
        x_i, y_i, z_i, _V_i, _u_i, _v_i, _w_i, _p_i = load(position_volume, velocity_pressure, i)
        M = Moments()
        k, end = int(0), int(neighbour_count[i])
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, y_j, z_j, V_j, _u_j, _v_j, _w_j, _p_j = load(position_volume, velocity_pressure, j)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            s = V_j * slope(wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h)
            M = moments_with(M, s, x, y, z)
            k += 1
        cover_out[i] = least_eigenvalue(moments_matrix(M, parameters.gradient_norm))

    return find_cover


@cache
def shifting_kernel(formulas: Formulas, layout: Layout = CPU_LAYOUT) -> wp.Kernel:
    """The pair loop of the drift, on top of XSPH's velocity if there is XSPH; components as in rates.py."""
    shape, slope = SMOOTHING[formulas.smoothing].shape, SMOOTHING[formulas.smoothing].slope
    load, packed, entry = layout.load[formulas.dimensions], layout.packed, layout.entry
    moments_with, gradient_with = MOMENTS_WITH[formulas.dimensions], GRADIENT_WITH[formulas.dimensions]
    in_space, on_top, walled = formulas.dimensions == 3, formulas.xsph, formulas.walled

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def shifting(
        first: int,
        parameters: Parameters,
        particle_count: int,
        strength: float,
        position_volume: wp.array[packed],
        velocity_pressure: wp.array[packed],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: Rows,
        cover: wp.array[float],
        xsph_velocity_inout: wp.array[wp.vec3],
    ):
        """du_i [m/s], the velocity by which the particle moves beside its own."""
        i = first + wp.tid()
        x_i, y_i, z_i, _V_i, u_i, v_i, w_i, _p_i = load(position_volume, velocity_pressure, i)
        cover_i = cover[i]
        M, L = Moments(), Gradient()
        outward_x, outward_y, outward_z = float(0.0), float(0.0), float(0.0)
        crowd_x, crowd_y, crowd_z = float(0.0), float(0.0), float(0.0)
        surface = wp.where(cover_i < SURFACE, 1.0, 0.0)
        k, end = int(0), int(neighbour_count[i])
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, y_j, z_j, V_j, u_j, v_j, w_j, _p_j = load(position_volume, velocity_pressure, j)
            # An image or a wall, behind the particles, has no cover of its own.
            cover_j = wp.where(j < particle_count, cover[wp.min(j, particle_count - 1)], cover_i)
            x, y, z = x_i - x_j, y_i - y_j, z_i - z_j
            u, v, w = u_i - u_j, v_i - v_j, w_i - w_j
            q = wp.sqrt(x * x + y * y + z * z) * parameters.inverse_h
            s = V_j * slope(q)
            f = shape(q) * parameters.inverse_shape_dx
            repel = s * (1.0 + PAIRING * f * f * f * f)
            fall = s * (cover_i - cover_j)
            surface += wp.where(s < 0.0 and cover_j < SURFACE, 1.0, 0.0)
            shears = float(s)
            if wp.static(walled):
                # How fast a wall goes says nothing of the shear of fluid that slips along it.
                shears = wp.where(j < particle_count, s, 0.0)
            M = moments_with(M, shears, x, y, z)
            L = gradient_with(L, shears, u, v, w, x, y, z)
            outward_x += fall * x
            outward_z += fall * z
            crowd_x += repel * x
            crowd_z += repel * z
            if wp.static(in_space):
                outward_y += fall * y
                crowd_y += repel * y
            k += 1
        n, h = parameters.gradient_norm, parameters.smoothing_length
        B = renormalisation(moments_matrix(M, n))
        G = gradient_matrix(L, n) * B
        D = G + wp.transpose(G)
        pace = h * wp.sqrt(0.5 * wp.ddot(D, D))

        drift = -strength * h * pace * n * wp.vec3(crowd_x, crowd_y, crowd_z)
        if surface > 0.0:
            normal = wp.normalize(B * wp.vec3(outward_x, outward_y, outward_z))
            drift -= wp.dot(drift, normal) * normal
        drift *= wp.where(cover_i > SPRAY, parameters.mobility[fluid[i]], 0.0)
        drift *= wp.min(1.0, MOST_DRIFT * pace / wp.max(wp.length(drift), 1.0e-20))
        if wp.static(on_top):
            drift += xsph_velocity_inout[i]
        xsph_velocity_inout[i] = drift

    return shifting


@wp.kernel(enable_backward=False)
def change_with_place(
    first: int, velocity_gradient: wp.array[wp.mat33], drift: wp.array[wp.vec3], acceleration_inout: wp.array[wp.vec3]
):
    """The rate [m/s2] at which a velocity changes with the place that the particle drifts through."""
    i = first + wp.tid()
    acceleration_inout[i] = acceleration_inout[i] + velocity_gradient[i] * drift[i]
