"""Momentum: the tensile correction of the pair loop."""

import warp as wp

from .parameters import Parameters


@wp.func
def tensile_strength(p: float) -> float:
    """e |p| of eq 67: e = 0.01 in compression and 0.2 in tension."""
    return wp.max(0.01 * p, -0.2 * p)


@wp.func
def tensile(parameters: Parameters, p_i: float, p_j: float, shape: float) -> float:
    """rho_i rho_j R_ij = (e_i |p_i| + e_j |p_j|) (W_ij / W(dx))^4: Vasco (2014) eq 67, Monaghan (2000)."""
    f = shape * parameters.inverse_shape_dx
    return (tensile_strength(p_i) + tensile_strength(p_j)) * f * f * f * f
