"""Momentum: the tensile correction of the pair loop."""

from collections.abc import Mapping

import warp as wp

from .parameters import Parameters


@wp.func
def tensile_strength(p: float) -> float:
    """e |p| of eq 67: e = 0.01 in compression and 0.2 in tension."""
    return wp.max(0.01 * p, -0.2 * p)


@wp.func
def nearness(parameters: Parameters, shape: float) -> float:
    """(W_ij / W(dx))^4."""
    f = shape * parameters.inverse_shape_dx
    return f * f * f * f


@wp.func
def no_tensile(parameters: Parameters, p_i: float, p_j: float, shape: float) -> float:
    """No correction."""
    return 0.0


@wp.func
def tensile(parameters: Parameters, p_i: float, p_j: float, shape: float) -> float:
    """rho_i rho_j R_ij = (e_i |p_i| + e_j |p_j|) (W_ij / W(dx))^4: Vasco (2014) eq 67, Monaghan (2000)."""
    return (tensile_strength(p_i) + tensile_strength(p_j)) * nearness(parameters, shape)


# (W_ij / W(dx))^4 at which e = 0.2 takes the whole tension of a pair away.
MOST_TENSILE = wp.constant(5.0)


@wp.func
def bounded_tensile(parameters: Parameters, p_i: float, p_j: float, shape: float) -> float:
    """The same in tension only, with (W_ij / W(dx))^4 <= 5, so that a pair in tension is never pushed apart.

    In compression nothing is to be corrected, and 0.01 |p| does harm: it is no energy's either, and makes the rows of a
    square lattice slide under the pressure of still water (kernels/README.md).

    Beyond that (nearer than 0.67 dx, Wendland kernel, h = 1.5 dx) eq 67 makes of tension a repulsion, up to 3.4 times
    as strong. It is no energy's, and feeds itself: particles pushed apart are less dense, in more tension, and pushed
    the harder. In water those around hold them; a drop of a few particles swings more and more until it bursts.
    """
    tension = wp.max(-0.2 * p_i, 0.0) + wp.max(-0.2 * p_j, 0.0)
    return tension * wp.min(nearness(parameters, shape), MOST_TENSILE)


# By what a scene says of it.
TENSILE: Mapping[bool | str, wp.Function] = {False: no_tensile, True: tensile, "bounded": bounded_tensile}
