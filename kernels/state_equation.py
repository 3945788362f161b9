"""Equations of state p(rho) of a weakly compressible fluid, and the internal energy that goes with them."""

import warp as wp

from .parameters import Parameters


@wp.func
def pressure(density: wp.float64, rest_density: float, sound_speed: float, stiffening: float) -> float:
    """Pressure [Pa] from density [kg/m3].

    Tait, Vasco (2014) eq 56:   p = c^2 rho0 / 7 ((rho / rho0)^7 - 1)
    linear, Vasco (2014) eq 57: p = c^2 (rho - rho0)

    With s = rho / rho0 - 1, the first is c^2 rho0 (s + 3 s^2 + 5 s^3 + 5 s^4 + 3 s^5 + s^6 + s^7 / 7): exact, free of
    cancellation at small s and of `pow`. Its first term is the second law, so `stiffening` (1 or 0) chooses.
    """
    s = float(density / wp.float64(rest_density) - wp.float64(1.0))
    tail = s * s * (3.0 + s * (5.0 + s * (5.0 + s * (3.0 + s * (1.0 + s / 7.0)))))
    return sound_speed * sound_speed * rest_density * (s + stiffening * tail)


@wp.func
def density_of(p: float, rest_density: float, sound_speed: float, stiffening: float) -> wp.float64:
    """Density [kg/m3] from pressure [Pa]: the inverse of `pressure`."""
    compression = wp.float64(p / (sound_speed * sound_speed * rest_density))
    tait = wp.pow(wp.float64(1.0) + wp.float64(7.0) * compression, wp.float64(1.0) / wp.float64(7.0))
    return wp.float64(rest_density) * wp.where(stiffening > 0.5, tait, wp.float64(1.0) + compression)


@wp.func
def internal_energy(density: wp.float64, rest_density: float, sound_speed: float, stiffening: float) -> wp.float64:
    """Internal energy per mass, e = integral of p / rho^2 d rho from rho0 [J/kg].

    Tait:   e = c^2 / 7 (x^6 / 6 + 1 / x - 7 / 6), x = rho / rho0
    linear: e = c^2 (ln x + 1 / x - 1)
    """
    one = wp.float64(1.0)
    c2 = wp.float64(sound_speed) * wp.float64(sound_speed)
    x = density / wp.float64(rest_density)
    x3 = x * x * x
    tait = (x3 * x3 / wp.float64(6.0) + one / x - wp.float64(7.0) / wp.float64(6.0)) / wp.float64(7.0)
    linear = wp.log(x) + one / x - one
    return c2 * wp.where(stiffening > 0.5, tait, linear)


@wp.kernel(enable_backward=False)
def find_pressure(
    first: int,
    parameters: Parameters,
    density: wp.array[wp.float64],
    fluid: wp.array[int],
    pressure_out: wp.array[float],
):
    """p_i [Pa] of a density, for outputs between steps."""
    i = first + wp.tid()
    f = fluid[i]
    pressure_out[i] = pressure(
        density[i], parameters.rest_density[f], parameters.sound_speed[f], parameters.stiffening[f]
    )
