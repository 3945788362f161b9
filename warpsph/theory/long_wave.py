"""A viscous layer that is long beside its depth, with its inertia: what a dam break does before Huppert's law holds.

The equations of motion over the depth of a layer with a parabolic profile of velocity, Shkadov (1967):

    dh/dt + dq/dx = 0,    dq/dt + d(6/5 q^2 / h + g h^2 / 2)/dx = -3 nu q / h^2

Without viscosity and with a uniform profile they are Ritter's; without inertia they lead to Huppert's law.
"""

from collections.abc import Sequence

import numpy as np

_PARABOLIC = 1.2  # mean of u^2 over the square of the mean of u
# A front thinner than this share of the column is none, and friction is never reckoned with a thinner film.
_LEAST_FRONT, _LEAST_FILM = 0.01, 1e-4


def long_wave_fronts(
    times: Sequence[float],
    *,
    height: float,
    length: float,
    viscosity: float,
    gravity: float = 9.81,
    profile: float = _PARABOLIC,
    cells: int = 1500,
) -> np.ndarray:
    """Front [m] from the back wall at each of the increasing `times` [s] of a column `height` by `length` [m] let go.

    Finite volumes of the first order with the fluxes of Harten, Lax & van Leer (1983), friction implicit. `viscosity`
    is kinematic [m2/s]; `profile` is the mean of u^2 over the square of the mean of u, 1 where u is uniform.
    """
    reach = length + 2.0 * np.sqrt(gravity * height) * times[-1]
    dx = min(reach, 8.0 * length) / cells
    x = (np.arange(cells) + 0.5) * dx
    h, q, t = np.where(x < length, height, 0.0), np.zeros(cells), 0.0
    dry, film = _LEAST_FILM * height, _LEAST_FILM * height
    fronts = []
    for end in times:
        while t < end:
            u = np.where(h > dry, q / np.maximum(h, dry), 0.0)
            fastest = float(np.max(profile * np.abs(u) + np.sqrt(gravity * h)))
            dt = min(0.4 * dx / max(fastest, 1e-9), end - t)
            mass, momentum = _fluxes(h, u, gravity, profile, dry)
            h = np.maximum(h - dt / dx * np.diff(mass), 0.0)
            q = (q - dt / dx * np.diff(momentum)) / (1.0 + 3.0 * viscosity * dt / np.maximum(h, film) ** 2)
            t += dt
        fronts.append(x[h > _LEAST_FRONT * height].max() + 0.5 * dx)
    return np.array(fronts)


def _fluxes(h: np.ndarray, u: np.ndarray, gravity: float, profile: float, dry: float) -> tuple[np.ndarray, np.ndarray]:
    """Of mass and momentum through the faces of the cells, walls at both ends, shape [cells + 1]."""
    left_h, right_h = np.append(h[0], h), np.append(h, h[-1])
    left_u, right_u = np.append(-u[0], u), np.append(u, -u[-1])
    left_c, right_c = np.sqrt(gravity * left_h), np.sqrt(gravity * right_h)
    slow = np.minimum(np.minimum(profile * left_u - left_c, profile * right_u - right_c), 0.0)
    fast = np.maximum(np.maximum(profile * left_u + left_c, profile * right_u + right_c), 0.0)
    fast = np.where(right_h < dry, np.maximum(left_u + 2.0 * left_c, 0.0), fast)  # on to a dry bed
    width = np.maximum(fast - slow, 1e-12)

    def between(left: np.ndarray, right: np.ndarray, jump: np.ndarray) -> np.ndarray:
        return (fast * left - slow * right + slow * fast * jump) / width

    left_q, right_q = left_h * left_u, right_h * right_u
    left_p = profile * left_q * left_u + 0.5 * gravity * left_h**2
    right_p = profile * right_q * right_u + 0.5 * gravity * right_h**2
    return between(left_q, right_q, right_h - left_h), between(left_p, right_p, right_q - left_q)
