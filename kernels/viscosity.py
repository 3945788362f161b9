"""Artificial viscosity: the pair pressures Pi_ij, here without their mean density, P_ij = rhobar_ij Pi_ij [m2/s2]."""

from collections.abc import Mapping

import warp as wp

from .parameters import Parameters


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
    return -alpha * c * mu + parameters.viscosity_beta * mu * mu


VISCOSITY: Mapping[str, wp.Function] = {"signal": signal, "monaghan": monaghan}
