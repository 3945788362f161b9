"""Rheology: the apparent viscosity of fluids that thin, thicken or have a yield stress.

With the velocity gradient L_ab = d u_a / d x_b the rate of strain is D = L + L^T, its deviator in d dimensions is
D' = D - (2 / d) (div u) I, and

    T = mu D',    rate = sqrt(D' : D' / 2),    tau = sqrt(T : T / 2) = mu rate.

In a shear flow `rate` is |du/dz|; where div u = 0 it is sqrt(D : D / 2). Vasco (2014) 6.3.2 takes sqrt(D : D), which is
sqrt(2) times as much, and another trace. The deviator keeps the sound of a nearly incompressible scheme out of the
rate: it would melt a plug.
"""

from collections.abc import Mapping
from functools import cache

import warp as wp

# Below this a rate of shear [1/s] is none: it keeps powers and quotients finite, far beyond any viscosity_max.
LEAST_RATE = wp.constant(1.0e-12)


@wp.struct
class Rheology:
    """Numbers of the laws. Arrays have one entry for each fluid of the scene."""

    consistency: wp.array[float]  # K [Pa s^N]; where N = 1 it is the viscosity [Pa s]
    exponent: wp.array[float]  # N: < 1 thins, > 1 thickens
    yield_stress: wp.array[float]  # tau_y [Pa]
    viscosity_max: wp.array[float]  # mu_max, never exceeded [Pa s]


# ------------------------------------------------------------------------------------------------------ invariants


@wp.func
def isotropic(value: float, dimensions: int) -> wp.mat33:
    """`value` times the identity, which in the plane has no y."""
    return wp.diag(wp.vec3(value, wp.where(dimensions == 3, value, 0.0), value))


@wp.func
def deviator(gradient: wp.mat33, dimensions: int) -> wp.mat33:
    """D' = L + L^T - (2 / d) (div u) I [1/s] of the velocity gradient L [1/s]."""
    dilation = isotropic(2.0 / float(dimensions) * wp.trace(gradient), dimensions)
    return gradient + wp.transpose(gradient) - dilation


@wp.func
def magnitude(T: wp.mat33) -> float:
    """sqrt(T : T / 2): shear stress of a stress, rate of shear of D'."""
    return wp.sqrt(0.5 * wp.ddot(T, T))


# ------------------------------------------------------------------------------------------------------------ laws


@wp.func
def newtonian(rheology: Rheology, f: int, rate: float) -> wp.vec2:
    """tau = mu rate."""
    return wp.vec2(rheology.consistency[f], 0.0)


@wp.func
def power_law(rheology: Rheology, f: int, rate: float) -> wp.vec2:
    """tau = K rate^N: Ostwald (1929), de Waele (1923)."""
    return wp.vec2(rheology.consistency[f] * wp.pow(wp.max(rate, LEAST_RATE), rheology.exponent[f] - 1.0), 0.0)


@wp.func
def bingham(rheology: Rheology, f: int, rate: float) -> wp.vec2:
    """tau = tau_y + K rate: Bingham (1922)."""
    return wp.vec2(rheology.consistency[f], rheology.yield_stress[f])


@wp.func
def herschel_bulkley(rheology: Rheology, f: int, rate: float) -> wp.vec2:
    """tau = tau_y + K rate^N: Herschel & Bulkley (1926), Vasco (2014) eq 105."""
    flow = rheology.consistency[f] * wp.pow(wp.max(rate, LEAST_RATE), rheology.exponent[f] - 1.0)
    return wp.vec2(flow, rheology.yield_stress[f])


# (fluid, rate [1/s]) -> (P [Pa s], tau_y [Pa]) of tau = P rate + tau_y. The last law holds the other three, for scenes
# of several fluids: N = 1, tau_y = 0 or both.
RHEOLOGY: Mapping[str, wp.Function] = {
    "newtonian": newtonian,
    "power_law": power_law,
    "bingham": bingham,
    "herschel_bulkley": herschel_bulkley,
}

# -------------------------------------------------------------------------------------------------- regularisations


@wp.func
def bi_viscous(P: float, yield_stress: float, viscosity_max: float, rate: float) -> float:
    """mu = min(P + tau_y / rate, mu_max): Vasco (2014) eq 106 and 107."""
    return wp.min(P + yield_stress / wp.max(rate, LEAST_RATE), viscosity_max)


@wp.func
def relaxation(x: float) -> float:
    """(1 - exp(-x)) / x for x >= 0, without the loss of digits at small x: to 1e-6."""
    if x < 0.1:
        return 1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0)))
    return (1.0 - wp.exp(-x)) / x


@wp.func
def papanastasiou(P: float, yield_stress: float, viscosity_max: float, rate: float) -> float:
    """mu = P + tau_y / rate (1 - exp(-m rate)), m = (mu_max - P) / tau_y, P <= mu_max: Papanastasiou (1987).

    With this m the viscosity at rest is mu_max, whatever the law.
    """
    flow = wp.min(P, viscosity_max)
    rest = viscosity_max - flow
    if yield_stress > 0.0:
        return flow + rest * relaxation(rest * rate / yield_stress)
    return flow


@wp.func
def cross(P: float, yield_stress: float, viscosity_max: float, rate: float) -> float:
    """mu = P + (mu_max - P) / (1 + k rate), k = (mu_max - P) / tau_y, P <= mu_max: Cross (1965), Shao & Lo (2003).

    Shao & Lo write k = mu_max / tau_y, with which a fast flow feels a yield stress that is P / mu_max too low.
    """
    flow = wp.min(P, viscosity_max)
    rest = viscosity_max - flow
    if yield_stress > 0.0:
        return flow + rest / (1.0 + rest * rate / yield_stress)
    return flow


REGULARISATION: Mapping[str, wp.Function] = {
    "bi_viscous": bi_viscous,
    "papanastasiou": papanastasiou,
    "cross": cross,
}


@cache
def apparent_viscosity_kernel(law: str, regularisation: str) -> wp.Kernel:
    """mu(rate) of each particle, one of RHEOLOGY kept finite by one of REGULARISATION."""
    parts, regularised = RHEOLOGY[law], REGULARISATION[regularisation]

    @wp.kernel(module="unique", enable_backward=False)
    def apparent_viscosity(
        first: int,
        rheology: Rheology,
        fluid: wp.array[int],
        velocity_gradient: wp.array[wp.mat33],
        dimensions: int,
        viscosity_out: wp.array[float],
    ):
        """mu_i [Pa s]."""
        i = first + wp.tid()
        f = fluid[i]
        rate = magnitude(deviator(velocity_gradient[i], dimensions))
        part = parts(rheology, f, rate)
        viscosity_out[i] = regularised(part[0], part[1], rheology.viscosity_max[f], rate)

    return apparent_viscosity
