"""Density: its diffusion in the pair loop, and the density of fluid at rest."""

from collections.abc import Mapping
from functools import cache

import warp as wp

from .corrections import renormalisation
from .layout import CPU_LAYOUT, Layout, Rows
from .parameters import Parameters
from .smoothing import SMOOTHING
from .state_equation import density_of


@wp.func
def no_diffusion(p_i: float, p_j: float, weight: float, slope: float) -> float:
    """No diffusion."""
    return 0.0


@wp.func
def molteni_colagrossi(p_i: float, p_j: float, weight: float, slope: float) -> float:
    """p_j - p_i: Molteni & Colagrossi (2009). Simple, but it works against gravity at a free surface."""
    return p_j - p_i


@wp.func
def fourtakas(p_i: float, p_j: float, weight: float, slope: float) -> float:
    """p_j - p_i + rho0 g . x_ij, so that fluid at rest is left alone: Fourtakas et al. (2019)."""
    return p_j - p_i + weight


@wp.func
def antuono(p_i: float, p_j: float, weight: float, slope: float) -> float:
    """p_j - p_i + (<grad p>_i + <grad p>_j) / 2 . x_ij, the delta-SPH of Antuono et al. (2010).

    Whatever is linear is left alone, at the price of a sweep for the gradients.
    """
    return p_j - p_i + slope


DENSITY_DIFFUSION: Mapping[str, wp.Function] = {
    "none": no_diffusion,
    "molteni_colagrossi": molteni_colagrossi,
    "fourtakas": fourtakas,
    "antuono": antuono,
}
# Those that need the gradient of pressure.
BY_GRADIENT = frozenset({"antuono"})


@cache
def pressure_gradient_kernel(smoothing: str, layout: Layout = CPU_LAYOUT) -> wp.Kernel:
    """The pair loop of <grad p>_i = B_i sum_j V_j (p_j - p_i) grad_i W_ij within a fluid, B_i of Vasco (2014) eq 54."""
    slope, entry = SMOOTHING[smoothing].slope, layout.entry

    @wp.kernel(module="unique", enable_backward=False)
    def pressure_gradient(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[wp.vec4],
        velocity_pressure: wp.array[wp.vec4],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: Rows,
        pressure_gradient_out: wp.array[wp.vec3],
    ):
        """<grad p>_i [Pa/m], exact for a linear pressure wherever neighbours of the same fluid span space."""
        i = first + wp.tid()
        xV_i, p_i, fluid_i = position_volume[i], velocity_pressure[i][3], fluid[i]
        x_i = wp.vec3(xV_i[0], xV_i[1], xV_i[2])

        M, rise = wp.mat33(), wp.vec3()
        for k in range(neighbour_count[i]):
            j = entry(neighbour_list, i, k)
            xV_j, p_j = position_volume[j], velocity_pressure[j][3]
            x_ij = x_i - wp.vec3(xV_j[0], xV_j[1], xV_j[2])
            q = wp.sqrt(wp.dot(x_ij, x_ij)) * parameters.inverse_h
            s = wp.where(fluid[j] == fluid_i, parameters.gradient_norm * xV_j[3] * slope(q), 0.0)
            M -= s * wp.outer(x_ij, x_ij)
            rise += s * (p_j - p_i) * x_ij
        pressure_gradient_out[i] = renormalisation(M) * rise

    return pressure_gradient


@wp.kernel(enable_backward=False)
def rest_density(
    first: int,
    parameters: Parameters,
    position: wp.array[wp.vec3d],
    fluid: wp.array[int],
    density_out: wp.array[wp.float64],
    density_rate_out: wp.array[float],
    diffusion_rate_out: wp.array[float],
):
    """Density at which the fluid carries its own weight below its still level, p = rho0 g (level - z).

    While the water settles among reactive walls its particles leave the lattice. Continuity would book that as
    compression here and expansion there, and the pressure of the resting fluid would be off by some percent. With the
    density of rest the particles themselves come to places at which the pressure balances gravity.
    """
    i = first + wp.tid()
    f = fluid[i]
    depth = parameters.still_level[f] - float(position[i][2])
    if depth > -1.0e30:
        density_out[i] = density_of(
            -parameters.rest_density[f] * parameters.hydrostatic[2] * wp.max(depth, 0.0),
            parameters.rest_density[f],
            parameters.sound_speed[f],
            parameters.stiffening[f],
        )
        density_rate_out[i] = 0.0
        diffusion_rate_out[i] = 0.0
