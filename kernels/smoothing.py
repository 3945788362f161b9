"""Smoothing kernels W(r, h) with compact support, and their gradients.

A kernel is written through its shape w(q), q = r / h, as W = n w(q) with n = normalisation / h^D, and

    grad_i W_ij = n / h^2 s(q) x_ij,   s(q) = (dw/dq) / q,

so that no formula divides by r. Each shape vanishes by itself beyond its support: `max(a - q, 0)` needs no branch,
and a list that holds a few neighbours too many (its skin) costs no mispredicted jump.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import warp as wp


@dataclass(frozen=True)
class SmoothingKernel:
    """One smoothing kernel.

    Attributes:
        shape: wp.func w(q), dimensionless.
        slope: wp.func s(q) = w'(q) / q, dimensionless, <= 0.
        support: W = 0 for r >= support h.
        normalisation: n h^D for D = 2 and 3, so that the integral of W over space is 1.
    """

    shape: wp.Function
    slope: wp.Function
    support: float
    normalisation: Mapping[int, float]


@wp.func
def wendland_c2(q: float) -> float:
    """w = (1 - q/2)^4 (1 + 2 q), Wendland (1995); the thesis's "Wendland 2D quartic"."""
    t = wp.max(1.0 - 0.5 * q, 0.0)
    return t * t * t * t * (1.0 + 2.0 * q)


@wp.func
def wendland_c2_slope(q: float) -> float:
    """s = -5 (1 - q/2)^3."""
    t = wp.max(1.0 - 0.5 * q, 0.0)
    return -5.0 * t * t * t


@wp.func
def cubic_spline(q: float) -> float:
    """w = ((2 - q)^3 - 4 (1 - q)^3) / 6, each bracket >= 0: Vasco (2014) eq 32, whose constant is corrected below."""
    outer = wp.max(2.0 - q, 0.0)
    inner = wp.max(1.0 - q, 0.0)
    return (outer * outer * outer - 4.0 * inner * inner * inner) / 6.0


@wp.func
def cubic_spline_slope(q: float) -> float:
    """s = (-(2 - q)^2 / 2 + 2 (1 - q)^2) / q, each bracket >= 0."""
    outer = wp.max(2.0 - q, 0.0)
    inner = wp.max(1.0 - q, 0.0)
    return (2.0 * inner * inner - 0.5 * outer * outer) / wp.max(q, 1.0e-6)


@wp.func
def fourth(a: float) -> float:
    """a^4."""
    square = a * a
    return square * square


@wp.func
def quintic_spline(q: float) -> float:
    """w = (3 - s)^5 - 6 (2 - s)^5 + 15 (1 - s)^5, each bracket >= 0, s = 3 q / 2: Morris, Fox & Zhu (1997).

    They have h so that it ends at 3 h; here it ends at 2 h like the others.
    """
    s = 1.5 * q
    outer, middle, inner = wp.max(3.0 - s, 0.0), wp.max(2.0 - s, 0.0), wp.max(1.0 - s, 0.0)
    return outer * fourth(outer) - 6.0 * middle * fourth(middle) + 15.0 * inner * fourth(inner)


@wp.func
def quintic_spline_slope(q: float) -> float:
    """s = -15/2 ((3 - s)^4 - 6 (2 - s)^4 + 15 (1 - s)^4) / q, each bracket >= 0, s = 3 q / 2."""
    s = 1.5 * q
    outer, middle, inner = wp.max(3.0 - s, 0.0), wp.max(2.0 - s, 0.0), wp.max(1.0 - s, 0.0)
    return -7.5 * (fourth(outer) - 6.0 * fourth(middle) + 15.0 * fourth(inner)) / wp.max(q, 1.0e-6)


@wp.func
def gaussian(q: float) -> float:
    """w = exp(-q^2), cut at q = 3: Vasco (2014) eq 30 with the constant of two or three dimensions."""
    if q < 3.0:
        return wp.exp(-q * q)
    return 0.0


@wp.func
def gaussian_slope(q: float) -> float:
    """s = -2 exp(-q^2), cut at q = 3: Vasco (2014) eq 31."""
    if q < 3.0:
        return -2.0 * wp.exp(-q * q)
    return 0.0


# What is left of a Gaussian after the cut: in the plane 1 - exp(-9), in space erf(3) - 6 exp(-9) / sqrt(pi).
_GAUSSIAN_KEPT_2D = 1.0 - math.exp(-9.0)
_GAUSSIAN_KEPT_3D = math.erf(3.0) - 6.0 * math.exp(-9.0) / math.sqrt(math.pi)

SMOOTHING: Mapping[str, SmoothingKernel] = {
    "wendland_c2": SmoothingKernel(
        wendland_c2, wendland_c2_slope, 2.0, {2: 7.0 / (4.0 * math.pi), 3: 21.0 / (16.0 * math.pi)}
    ),
    # Vasco (2014) eq 32 prints 10 / (7 pi), which integrates to 2/3.
    "cubic_spline": SmoothingKernel(
        cubic_spline, cubic_spline_slope, 2.0, {2: 15.0 / (7.0 * math.pi), 3: 3.0 / (2.0 * math.pi)}
    ),
    "quintic_spline": SmoothingKernel(
        quintic_spline,
        quintic_spline_slope,
        2.0,
        {2: 9.0 / 4.0 * 7.0 / (478.0 * math.pi), 3: 27.0 / 8.0 / (120.0 * math.pi)},
    ),
    "gaussian": SmoothingKernel(
        gaussian,
        gaussian_slope,
        3.0,
        {2: 1.0 / (math.pi * _GAUSSIAN_KEPT_2D), 3: 1.0 / (math.pi**1.5 * _GAUSSIAN_KEPT_3D)},
    ),
}
