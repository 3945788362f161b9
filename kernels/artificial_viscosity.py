"""Artificial viscosity: the pair pressures Pi_ij, here without their mean density, P_ij = rhobar_ij Pi_ij [m2/s2]."""

import math
from collections.abc import Mapping

import numpy as np
import warp as wp

from .parameters import Parameters
from .smoothing import SMOOTHING


@wp.func
def signal(parameters: Parameters, alpha: float, c: float, u_dot_x: float, r: float) -> float:
    """P = -alpha v_sig (u_ij . x_ij) / r, v_sig = (c_i + c_j) / 2, on all pairs: Vasco (2014) eq 61.

    Kajtar & Monaghan (2008); unlike eq 58 it has no h / r, so that the two alphas are not the same viscosity.
    As a shear viscosity of the Wendland kernel in 2-D: nu = alpha c h / 8.
    """
    return -alpha * c * u_dot_x / wp.max(r, 1.0e-9)


@wp.func
def monaghan(parameters: Parameters, alpha: float, c: float, u_dot_x: float, r: float) -> float:
    """P = -alpha c mu + beta mu^2, mu = h (u_ij . x_ij) / (r^2 + 0.01 h^2), u_ij . x_ij < 0: Vasco (2014) eq 58-59."""
    h = parameters.smoothing_length
    mu = h * wp.min(u_dot_x, 0.0) / (r * r + 0.01 * h * h)
    return -alpha * c * mu + parameters.artificial_viscosity_beta * mu * mu


ARTIFICIAL_VISCOSITY: Mapping[str, wp.Function] = {"signal": signal, "monaghan": monaghan}


def artificial_share(artificial_viscosity: str, smoothing: str, dimensions: int) -> float:
    """The artificial viscosity read anew as a real one: nu = share alpha c h [m2/s].

    A pair pressure -g(r) (u_ij . x_ij) is a viscosity of nu = (1 / (2 (d + 2))) <g r^2>, weighted with -r dW/dr, whose
    integral over space is d. For `signal` (eq 61) g = alpha c / r, so that nu = 3/16 alpha c <r> in the plane: 1/8 with
    the Wendland kernel, 15/112 with the cubic spline. For `monaghan` (eq 58, beta = 0) g = alpha c h / (r^2 + 0.01 h^2)
    on approaching pairs, which in shear are half of them: 1/16 in the plane, less 1 or 2 % by the 0.01 h^2.
    """
    kernel = SMOOTHING[smoothing]
    # Gauss-Legendre nodes between the knots of the kernels, all of them thirds.
    node, weight = np.polynomial.legendre.leggauss(24)
    q = np.concatenate([(0.5 * (node + 1.0) + knot) / 3.0 for knot in range(int(3.0 * kernel.support))])
    weight = np.tile(weight, int(3.0 * kernel.support)) / 6.0
    slope = np.array([float(kernel.slope(float(value))) for value in q])
    sphere = 2.0 * math.pi if dimensions == 2 else 4.0 * math.pi
    density = -sphere * kernel.normalisation[dimensions] * slope * q ** (dimensions + 1) / dimensions
    g = {"signal": q, "monaghan": 0.5 * q**2 / (q**2 + 0.01)}[artificial_viscosity]
    return float(np.sum(weight * density * g)) / (2.0 * (dimensions + 2))
