"""What a body that falls into water did, from the records of a run: its impact, and the wave that it made.

Records are in metres and seconds; energies are for each metre of width. A scene in the plane is meant, with one depth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpsph.theory.analytic import SolitaryFit, fit_solitary_wave, solitary_celerity

# A wave reaches as far to both sides of its crest as it stands above this share of it.
FOOT = 0.1


@dataclass(frozen=True)
class Impact:
    """The instant at which the centre of a body sinks through the still level.

    Attributes:
        time: [s].
        speed: Of the centre [m/s].
        froude: F = speed / sqrt(g depth).
        energy: Kinetic energy of the body [J/m].
        arrival: The same as its lowest point first meets still water, or at the start if that is in water then [J/m].
        fall: Energy that gravity gives the body from the impact to the end of the record [J/m].
    """

    time: float
    speed: float
    froude: float
    energy: float
    arrival: float
    fall: float


@dataclass(frozen=True)
class Wave:
    """The highest wave in the record of a gauge.

    Attributes:
        fit: The solitary wave that is nearest to it, where it stands above its foot.
        period: How long it stands above half of its crest [s].
        kinetic, potential: Its energy [J/m], if it passes with the celerity of the fit and its water moves as in long
            waves, u = c eta / (d + eta).
    """

    fit: SolitaryFit
    period: float
    kinetic: float
    potential: float


def find_impact(
    record: Mapping[str, np.ndarray],
    corners: np.ndarray,
    *,
    level: float,
    depth: float,
    gravity: float,
    mass: float,
    inertia: float,
) -> Impact | None:
    """The impact in the `record` of a body on water at `level` [m]; None if its centre never sinks into it from above.

    `corners` [m], shape [n, 2], are the corners of its outline about its centre where its angle is 0, `depth` [m] is
    the depth of the water, `mass` [kg/m] and `inertia` [kg m] belong to the body.
    """
    z, angle = record["z [m]"], np.radians(record["angle [deg]"])[:, None]
    when = _sinks(z, level)
    if when is None:
        return None
    lowest = z + (np.sin(angle) * corners[:, 0] + np.cos(angle) * corners[:, 1]).min(axis=1)
    meets = _sinks(lowest, level)

    def at(row: float, name: str) -> float:
        return float(np.interp(row, np.arange(len(z)), record[name]))

    def kinetic(row: float) -> float:
        u, w, spin = (at(row, name) for name in ("u [m/s]", "w [m/s]", "spin [rad/s]"))
        return 0.5 * mass * (u**2 + w**2) + 0.5 * inertia * spin**2

    speed = math.hypot(at(when, "u [m/s]"), at(when, "w [m/s]"))
    return Impact(
        time=at(when, "time [s]"),
        speed=speed,
        froude=speed / math.sqrt(gravity * depth),
        energy=kinetic(when),
        arrival=kinetic(0.0 if meets is None else meets),
        fall=mass * gravity * (level - float(z[-1])),
    )


def _sinks(z: np.ndarray, level: float) -> float | None:
    """The row, and share of the way to the next, at which `z` [m] first sinks through `level`; None if it starts below
    or never does."""
    below = np.flatnonzero((z[1:] < level) & (z[:-1] >= level))
    if not len(below) or z[0] < level:
        return None
    k = below[0]
    return k + (z[k] - level) / (z[k] - z[k + 1])


def find_wave(time: np.ndarray, elevation: np.ndarray, *, depth: float, gravity: float, density: float) -> Wave | None:
    """The highest wave of a gauge's record, `elevation` [m] above still water at `time` [s]; None if there is none."""
    # The median of five: a drop of air under the surface makes a gauge look through it for a sample or two.
    padded = np.pad(elevation, 2, mode="edge")
    elevation = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
    top = int(np.argmax(elevation))
    if elevation[top] <= 0.0:
        return None
    around = _run(elevation > FOOT * elevation[top], top)
    if around.stop - around.start < 5:
        return None
    t, eta = time[around], elevation[around]
    fit = fit_solitary_wave(t, eta, depth=depth, gravity=gravity)
    half = _run(elevation > 0.5 * elevation[top], top)
    c = solitary_celerity(depth=depth, amplitude=fit.amplitude, gravity=gravity)
    return Wave(
        fit,
        period=float(time[half.stop - 1] - time[half.start]),
        kinetic=float(0.5 * density * c**3 * np.trapezoid(eta**2 / (depth + eta), t)),
        potential=float(0.5 * density * gravity * c * np.trapezoid(eta**2, t)),
    )


def celerity(near: Wave, far: Wave, distance: float) -> float:
    """Of the crest from one gauge to the next, `distance` [m] apart, by the crests of the fits [m/s]."""
    return distance / (far.fit.crest - near.fit.crest)


def _run(wanted: np.ndarray, at: int) -> slice:
    """The unbroken run of True around `at`."""
    gaps = np.flatnonzero(~wanted)
    return slice(int(gaps[gaps < at].max(initial=-1)) + 1, int(gaps[gaps > at].min(initial=len(wanted))))
