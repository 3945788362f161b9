"""What an outline encloses, and what a body of a given shape weighs: area, mass, centre, inertia.

Everything here happens once, on the host, in double precision. Outlines are of the x-z plane, points [x, z]; masses
and inertias in 2-D are for a slice 1 m wide.

A refusal is a ValueError of one line, for the scene to put a place before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpsph.shapes.outline import Leg, Line, Outline
from warpsph.shapes.points import Array

# Nodes of Gauss's rule along a leg: with 32 a whole circle's moments are exact to rounding.
GAUSS_NODES = 32
# Corners of an outline, arcs in steps of half a degree, that are tested for crossings a piece at a time.
CROSSING_ROWS = 500


@dataclass(frozen=True)
class Section:
    """What an outline encloses.

    Attributes:
        area: [m2].
        centre: [m], shape [2].
        moment: Integral of the square of the distance to the centre [m4].
    """

    area: float
    centre: Array
    moment: float


@dataclass(frozen=True)
class MassProperties:
    """Mass, where it is, and how it resists turning.

    Attributes:
        mass: [kg], or [kg/m] in 2-D.
        centre: [m], shape [3].
        inertia: About the centre, along the axes in which the shape was given [kg m2] or [kg m], shape [3, 3]. In 2-D
            only the middle entry has a meaning, about y; the matrix is that number times unity.
    """

    mass: float
    centre: Array
    inertia: Array


def section_of(outline: Outline) -> Section:
    """Area, centre and moment by Green's theorem along the exact legs, whichever way round they run.

    A = oint (x dz - z dx) / 2,  A x_c = oint x^2 dz / 2,  A z_c = -oint z^2 dx / 2,
    integral of x^2 + z^2 = oint (x^3 dz - z^3 dx) / 3.

    Raises ValueError for an outline that is open, crosses or touches itself, or encloses nothing.
    """
    refuse_crossing(outline)
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS_NODES)
    fractions, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    # About a point of the outline, so that a far-away shape loses no digits.
    origin = outline.legs[0].points(np.zeros(1))[0]
    sums = np.zeros(4)
    for leg in outline.legs:
        x, z = (leg.points(fractions) - origin).T
        normals = leg.normals(fractions) * (leg.length * weights)[:, None]
        dx, dz = normals[:, 1], -normals[:, 0]
        sums += [
            0.5 * np.sum(x * dz - z * dx),
            0.5 * np.sum(x * x * dz),
            -0.5 * np.sum(z * z * dx),
            np.sum(x**3 * dz - z**3 * dx) / 3.0,
        ]
    sums *= math.copysign(1.0, sums[0])
    area, centre = sums[0], sums[1:3] / max(sums[0], 1e-300)
    if area <= 1e-12 * outline.length**2:
        raise ValueError("its outline encloses no area")
    return Section(float(area), origin + centre, float(sums[3] - area * centre @ centre))


def refuse_crossing(outline: Outline) -> None:
    """Raises ValueError where an outline is open, stands still, or crosses or touches itself."""
    if not outline.closed:
        raise ValueError("its outline is open")
    for i, leg in enumerate(outline.legs):
        if leg.length == 0.0:
            raise ValueError(f"corner {i} of its outline is the same place as the next")
        gap = np.linalg.norm(leg.points(np.ones(1)) - outline.legs[(i + 1) % len(outline.legs)].points(np.zeros(1)))
        if gap > 1e-9 * outline.length:
            raise ValueError(f"its outline is open: leg {i} ends {gap:.3g} m from where the next begins")
    starts = np.concatenate([leg.points(np.linspace(0.0, 1.0, _pieces(leg) + 1))[:-1] for leg in outline.legs])
    ends = np.roll(starts, -1, axis=0)
    count = len(starts)
    slack = 1e-12 * outline.length**2
    for first in range(0, count, CROSSING_ROWS):
        rows = np.arange(first, min(first + CROSSING_ROWS, count))
        a, b = starts[rows, None], ends[rows, None]
        apart = (np.arange(count) - rows[:, None]) % count
        # Each end of a piece on either side of the other piece, or on it.
        touching = (
            (_side(a, b, starts) * _side(a, b, ends) <= slack**2)
            & (_side(starts, ends, a) * _side(starts, ends, b) <= slack**2)
            & np.all(np.minimum(a, b) <= np.maximum(starts, ends) + 1e-12, axis=2)
            & np.all(np.minimum(starts, ends) <= np.maximum(a, b) + 1e-12, axis=2)
            & (apart > 1)
            & (apart < count - 1)
        )
        if touching.any():
            x, z = starts[rows[np.argmax(touching.any(axis=1))]]
            raise ValueError(f"its outline crosses or touches itself near x = {x:.4g} m, z = {z:.4g} m")
    # Neighbouring pieces share a corner; they overlap only where the outline turns straight back.
    ways = ends - starts
    nexts = np.roll(ways, -1, axis=0)
    cosine = np.einsum("ij,ij->i", ways, nexts) / (np.linalg.norm(ways, axis=1) * np.linalg.norm(nexts, axis=1))
    if cosine.min() < -1.0 + 1e-12:
        x, z = ends[np.argmin(cosine)]
        raise ValueError(f"its outline turns straight back at x = {x:.4g} m, z = {z:.4g} m")


def plane_mass(
    outline: Outline,
    *,
    density: float | None = None,
    mass: float | None = None,
    centre: ArrayLike | None = None,
    inertia: float | None = None,
) -> MassProperties:
    """Mass properties of a slice 1 m wide of the area that `outline` encloses.

    Of `density` [kg/m3] and `mass` [kg/m] one is given. `centre` [x, z] [m] and `inertia` about it [kg m] replace those
    of a uniform body.

    Raises ValueError for an impossible outline, or a mass or inertia that is not positive.
    """
    section = section_of(outline)
    total = total_mass(section.area, density, mass)
    place = section.centre if centre is None else np.asarray(centre, float)
    offset = place - section.centre
    resisting = total * (section.moment / section.area + offset @ offset) if inertia is None else inertia
    if not (math.isfinite(resisting) and resisting > 0.0):
        raise ValueError(f"an inertia of {resisting:g} kg m is not above 0")
    return MassProperties(total, np.array([place[0], 0.0, place[1]]), resisting * np.eye(3))


def total_mass(measure: float, density: float | None, mass: float | None) -> float:
    """The mass of a shape of `measure` [m3], or [m2] in 2-D, given its density or its mass.

    Raises ValueError where both or neither is given, or what is given is not above 0.
    """
    if (density is None) == (mass is None):
        raise ValueError("it needs a mass or a density, one of them")
    for name, value, unit in (("mass", mass, "kg"), ("density", density, "kg/m3")):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"a {name} of {value:g} {unit} is not above 0")
    return float(density * measure if density is not None else mass or 0.0)


def _pieces(leg: Leg) -> int:
    """Straight pieces that stand for a leg: arcs in steps of half a degree."""
    return 1 if isinstance(leg, Line) else max(1, math.ceil(abs(leg.turn) / math.radians(0.5)))


def _side(a: Array, b: Array, p: Array) -> Array:
    """Twice the area of the triangles a b p [m2], positive where p is on the left."""
    ab, ap = b - a, p - a
    return ab[..., 0] * ap[..., 1] - ab[..., 1] * ap[..., 0]
