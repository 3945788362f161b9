"""Density: its diffusion in the pair loop, and the density of fluid at rest."""

from collections.abc import Mapping

import warp as wp

from .parameters import Parameters
from .state_equation import density_of


@wp.func
def no_diffusion(p_i: float, p_j: float, rho0_g_dot_x: float) -> float:
    """No diffusion."""
    return 0.0


@wp.func
def molteni_colagrossi(p_i: float, p_j: float, rho0_g_dot_x: float) -> float:
    """p_j - p_i: Molteni & Colagrossi (2009). Simple, but it works against gravity at a free surface."""
    return p_j - p_i


@wp.func
def fourtakas(p_i: float, p_j: float, rho0_g_dot_x: float) -> float:
    """p_j - p_i + rho0 g . x_ij, so that fluid at rest is left alone: Fourtakas et al. (2019)."""
    return p_j - p_i + rho0_g_dot_x


DENSITY_DIFFUSION: Mapping[str, wp.Function] = {
    "none": no_diffusion,
    "molteni_colagrossi": molteni_colagrossi,
    "fourtakas": fourtakas,
}


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
            -parameters.rest_density[f] * parameters.gravity[2] * wp.max(depth, 0.0),
            parameters.rest_density[f],
            parameters.sound_speed[f],
            parameters.stiffening[f],
        )
        density_rate_out[i] = 0.0
        diffusion_rate_out[i] = 0.0
