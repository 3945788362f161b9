"""Laminar viscosity: forces of a viscosity mu_i [Pa s] that each particle has, its own or an apparent one.

Two ways. The pair forms of LAMINAR take the difference of two velocities at once. The stress form of eq 100 takes the
divergence of T = mu D', with D' from the velocity gradients: dearer, and blind to a velocity that alternates from
particle to particle, but good for any stress. All conserve momentum; `cleary` angular momentum as well.
"""

import math
from collections.abc import Mapping
from functools import cache

import numpy as np
import warp as wp

from .corrections import renormalisation
from .parameters import Parameters
from .rheology import deviator
from .smoothing import SMOOTHING

# ------------------------------------------------------------------------------------------------------ pair forms


@wp.func
def morris(mu: float, dimensions: int, u_ij: wp.vec3, x_ij: wp.vec3) -> wp.vec3:
    """2 mu u_ij: Morris, Fox & Zhu (1997), Vasco (2014) eq 99. For a flow without divergence."""
    return 2.0 * mu * u_ij


@wp.func
def cleary(mu: float, dimensions: int, u_ij: wp.vec3, x_ij: wp.vec3) -> wp.vec3:
    """2 (d + 2) mu (u_ij . x_ij) x_ij / r^2: Cleary (1998), Monaghan (2005).

    Along the line between: no torque, nothing in rigid rotation, and right at a free surface, where eq 99 is not
    (Colagrossi et al. 2011). Its bulk viscosity is 2 mu in the plane, 5 mu / 3 in space.
    """
    r2 = wp.max(wp.dot(x_ij, x_ij), 1.0e-18)
    return 2.0 * float(dimensions + 2) * mu * wp.dot(u_ij, x_ij) / r2 * x_ij


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
def laminar_acceleration_kernel(smoothing: str, form: str, mean: str) -> wp.Kernel:
    """The pair loop of viscosity.

        du_i/dt = 1 / rho_i sum_j V_j s_ij F(mu_ij, u_ij, x_ij),    grad_i W_ij = s_ij x_ij

    with F of LAMINAR and mu_ij of MEAN. As (1/r) dW/dr = s_ij, eq 99 needs no 0.01 h^2 beside r^2.
    """
    slope = SMOOTHING[smoothing].slope
    force, between = LAMINAR[form], MEAN[mean]

    @wp.kernel(module="unique", enable_backward=False)
    def laminar_acceleration(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: wp.array[int],
        viscosity: wp.array[float],
        dimensions: int,
        laminar_acceleration_out: wp.array[wp.vec3],
    ):
        """a_i by viscosity [m/s2]."""
        i = first + wp.tid()
        xV_i, up_i, mu_i = position_volume[i], velocity_pressure[i], viscosity[i]
        x_i, u_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2]), wp.vec3(up_i[0], up_i[1], up_i[2])
        inverse_rho_i = xV_i[3] / parameters.mass[fluid[i]]

        by_viscosity = wp.vec3()
        row = i * parameters.row_stride
        for k in range(neighbour_count[i]):
            j = neighbour_list[row + k * parameters.column_stride]
            xV_j, up_j = position_volume[j], velocity_pressure[j]
            x_ij = x_i - wp.vec3(xV_j[0], xV_j[1], xV_j[2])
            u_ij = u_i - wp.vec3(up_j[0], up_j[1], up_j[2])
            q = wp.sqrt(wp.dot(x_ij, x_ij)) * parameters.inverse_h
            by_viscosity += xV_j[3] * slope(q) * force(between(mu_i, viscosity[j]), dimensions, u_ij, x_ij)
        laminar_acceleration_out[i] = inverse_rho_i * parameters.gradient_norm * by_viscosity

    return laminar_acceleration


# ----------------------------------------------------------------------------------------------------- stress form


@wp.func
def as_it_is(L: wp.mat33, M: wp.mat33) -> wp.mat33:
    """The plain sum, whose partner is eq 100: together they lose the kinetic energy sum V T : L, never gain any."""
    return L


@wp.func
def renormalised(L: wp.mat33, M: wp.mat33) -> wp.mat33:
    """L B: exact for linear velocities, at a surface and in disorder."""
    return L * renormalisation(M)


@cache
def velocity_gradient_kernel(smoothing: str, renormalise: bool) -> wp.Kernel:
    """The pair loop of the velocity gradient.

        L_i = (sum_j V_j (u_j - u_i) (x) grad_i W_ij) B_i,    L_ab = d u_a / d x_b

    with B_i of Vasco (2014) eq 54, or without. Its trace is the divergence: renormalised continuity is -rho_i tr L_i.
    """
    slope = SMOOTHING[smoothing].slope
    corrected = renormalised if renormalise else as_it_is

    @wp.kernel(module="unique", enable_backward=False)
    def velocity_gradient(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        neighbour_count: wp.array[int],
        neighbour_list: wp.array[int],
        velocity_gradient_out: wp.array[wp.mat33],
    ):
        """L_i [1/s]."""
        i = first + wp.tid()
        xV_i, up_i = position_volume[i], velocity_pressure[i]
        x_i, u_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2]), wp.vec3(up_i[0], up_i[1], up_i[2])

        L = wp.mat33()
        M = wp.mat33()
        row = i * parameters.row_stride
        for k in range(neighbour_count[i]):
            j = neighbour_list[row + k * parameters.column_stride]
            xV_j, up_j = position_volume[j], velocity_pressure[j]
            x_ij = x_i - wp.vec3(xV_j[0], xV_j[1], xV_j[2])
            u_ij = u_i - wp.vec3(up_j[0], up_j[1], up_j[2])
            s_ij = xV_j[3] * slope(wp.sqrt(wp.dot(x_ij, x_ij)) * parameters.inverse_h)
            L -= s_ij * wp.outer(u_ij, x_ij)
            M -= s_ij * wp.outer(x_ij, x_ij)
        n = parameters.gradient_norm
        velocity_gradient_out[i] = corrected(n * L, n * M)

    return velocity_gradient


@wp.kernel(enable_backward=False)
def viscous_stress(
    first: int,
    velocity_gradient: wp.array[wp.mat33],
    viscosity: wp.array[float],
    dimensions: int,
    stress_out: wp.array[wp.mat33],
):
    """T_i = mu_i D'_i [Pa], D' of rheology.py: Vasco (2014) 6.1.3 with the trace put right."""
    i = first + wp.tid()
    stress_out[i] = viscosity[i] * deviator(velocity_gradient[i], dimensions)


@cache
def stress_acceleration_kernel(smoothing: str) -> wp.Kernel:
    """The pair loop of the divergence of a symmetric stress.

        du_i/dt = sum_j m_j (T_i + T_j) / (rho_i rho_j) . grad_i W_ij

    Vasco (2014) eq 100 without its pressure, which eq 38 holds, and with the material derivative that it means.
    """
    slope = SMOOTHING[smoothing].slope

    @wp.kernel(module="unique", enable_backward=False)
    def stress_acceleration(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: wp.array[int],
        stress: wp.array[wp.mat33],
        stress_acceleration_out: wp.array[wp.vec3],
    ):
        """a_i by stress [m/s2]."""
        i = first + wp.tid()
        xV_i, T_i = position_volume[i], stress[i]
        x_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2])
        inverse_rho_i = xV_i[3] / parameters.mass[fluid[i]]

        by_stress = wp.vec3()
        row = i * parameters.row_stride
        for k in range(neighbour_count[i]):
            j = neighbour_list[row + k * parameters.column_stride]
            xV_j = position_volume[j]
            x_ij = x_i - wp.vec3(xV_j[0], xV_j[1], xV_j[2])
            q = wp.sqrt(wp.dot(x_ij, x_ij)) * parameters.inverse_h
            by_stress += xV_j[3] * slope(q) * ((T_i + stress[j]) * x_ij)
        stress_acceleration_out[i] = inverse_rho_i * parameters.gradient_norm * by_stress

    return stress_acceleration


# dt <= C rho h^2 / mu. integrators.py predicts the velocity at half steps from the last two, u + dt/2 F: for viscosity
# that is Adams-Bashforth of second order, which takes lambda dt <= 1, lambda being the fastest rate at which a velocity
# decays. Heun's scheme and the midpoint rule take 2, so twice this step. The stress form does not see the fastest.
VISCOUS_COURANT: Mapping[str, float] = {"morris": 0.125, "cleary": 0.045, "stress": 0.4}

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
