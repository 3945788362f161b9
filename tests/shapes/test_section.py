"""Mass properties of outlines against closed forms, and what is refused."""

import math

import numpy as np
import pytest

from warpsph.shapes.outline import Bend, Line, Outline, box_outline, polygon_outline, reversed_outline
from warpsph.shapes.points import turned
from warpsph.shapes.section import plane_mass, refuse_crossing, section_of

# Double precision, sums along a few legs: relative.
TOLERANCE = 1e-12

DISC = Outline((Bend(np.array([3.0, -2.0]), 0.25, -0.5 * math.pi, 2.0 * math.pi),), closed=True)
BOX = box_outline((1.0, 2.0), (1.6, 2.2))
# The chamfered block of Maciel & Nascimento (2002), cut at 45 degrees over its whole height.
BLOCK = polygon_outline([[0.0, 0.0], [0.325 - 0.075, 0.0], [0.325, 0.075], [0.0, 0.075]])


def test_box():
    mass = plane_mass(BOX, density=700.0)
    m = 700.0 * 0.6 * 0.2
    assert mass.mass == pytest.approx(m, rel=TOLERANCE)
    np.testing.assert_allclose(mass.centre, [1.3, 0.0, 2.1], rtol=TOLERANCE)
    assert mass.inertia[1, 1] == pytest.approx(m * (0.6**2 + 0.2**2) / 12.0, rel=TOLERANCE)


def test_disc():
    mass = plane_mass(DISC, mass=4.0)
    assert section_of(DISC).area == pytest.approx(math.pi * 0.25**2, rel=TOLERANCE)
    np.testing.assert_allclose(mass.centre, [3.0, 0.0, -2.0], rtol=TOLERANCE)
    assert mass.inertia[1, 1] == pytest.approx(4.0 * 0.25**2 / 2.0, rel=TOLERANCE)


def test_wedge():
    """Of beam b and height a, apex down: the centre lies a / 3 below the beam, and I = m (b^2 / 24 + a^2 / 18)."""
    b, a = 1.2, 0.4
    mass = plane_mass(polygon_outline([[0.0, 0.0], [b / 2, a], [-b / 2, a]]), density=500.0)
    assert mass.mass == pytest.approx(500.0 * a * b / 2.0, rel=TOLERANCE)
    np.testing.assert_allclose(mass.centre, [0.0, 0.0, 2.0 * a / 3.0], rtol=TOLERANCE, atol=1e-15)
    assert mass.inertia[1, 1] == pytest.approx(mass.mass * (b**2 / 24.0 + a**2 / 18.0), rel=TOLERANCE)


def test_stadium_of_lines_and_arcs():
    """A box with a half disc at either end, by the parallel-axis theorem; the half disc's centre is 4 r / 3 pi off."""
    r, half = 0.1, 0.3
    legs = (
        Line(np.array([-half, -r]), np.array([half, -r])),
        Bend(np.array([half, 0.0]), r, -0.5 * math.pi, math.pi),
        Line(np.array([half, r]), np.array([-half, r])),
        Bend(np.array([-half, 0.0]), r, 0.5 * math.pi, math.pi),
    )
    section = section_of(Outline(legs, closed=True))
    cap, off = math.pi * r**2 / 2.0, 4.0 * r / (3.0 * math.pi)
    box = 2.0 * half * 2.0 * r
    moment = box * ((2 * half) ** 2 + (2 * r) ** 2) / 12.0
    moment += 2.0 * (cap * r**2 / 2.0 - cap * off**2 + cap * (half + off) ** 2)
    assert section.area == pytest.approx(box + 2.0 * cap, rel=TOLERANCE)
    assert section.moment == pytest.approx(moment, rel=TOLERANCE)


def test_block_of_the_thesis():
    """cards.md, V-7.2.5.2: area 0.0216 m2, and 1440 kg/m3 for 9 kg over 0.29 m."""
    section = section_of(BLOCK)
    assert section.area == pytest.approx(0.325 * 0.075 - 0.075**2 / 2.0, rel=TOLERANCE)
    assert 9.0 / 0.29 / section.area == pytest.approx(1440.0, rel=2e-3)


@pytest.mark.parametrize("outline", [BOX, DISC, BLOCK])
def test_neither_place_nor_turn_nor_sense_changes_the_shape(outline):
    section = section_of(outline)
    backwards = section_of(reversed_outline(outline))
    assert backwards.area == pytest.approx(section.area, rel=TOLERANCE)
    assert backwards.moment == pytest.approx(section.moment, rel=TOLERANCE)
    if not isinstance(outline.legs[0], Bend):
        far = np.array([50.0, -30.0])
        moved = section_of(polygon_outline(turned([leg.start for leg in outline.legs], 0.7) + far))
        assert moved.area == pytest.approx(section.area, rel=1e-9)
        assert moved.moment == pytest.approx(section.moment, rel=1e-9)
        np.testing.assert_allclose(moved.centre, turned(section.centre[None], 0.7)[0] + far, rtol=1e-12)


def test_given_centre_moves_the_inertia_and_given_inertia_stays():
    """Steiner: m d^2 more about another place."""
    uniform = plane_mass(BOX, mass=10.0)
    off = plane_mass(BOX, mass=10.0, centre=[1.3, 2.0])
    assert off.inertia[1, 1] == pytest.approx(uniform.inertia[1, 1] + 10.0 * 0.1**2, rel=TOLERANCE)
    assert plane_mass(BOX, mass=10.0, inertia=0.5).inertia[1, 1] == 0.5


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "crosses or touches itself"),
        ([[0, 0], [2, 0], [2, 1], [1, 0], [0, 1]], "crosses or touches itself"),
        ([[0, 0], [1, 0], [1, 0], [0, 1]], "same place"),
        ([[0, 0], [1, 0], [2, 0]], "crosses|straight back|no area"),
        ([[0, 0], [1, 0], [0.5, 0], [0.5, 1]], "straight back|touches"),
    ],
)
def test_impossible_outlines_are_refused(corners, words):
    with pytest.raises(ValueError, match=words) as caught:
        section_of(polygon_outline(corners))
    assert "\n" not in str(caught.value)


def test_open_outline_is_refused():
    with pytest.raises(ValueError, match="open"):
        refuse_crossing(Outline(BOX.legs[:3], closed=False))
    with pytest.raises(ValueError, match="open"):
        refuse_crossing(Outline(BOX.legs[:3], closed=True))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"mass": 0.0}, "mass of 0 kg is not above 0"),
        ({"density": -1.0}, "density of -1"),
        ({"density": math.nan}, "density of nan"),
        ({}, "a mass or a density"),
        ({"mass": 1.0, "density": 1.0}, "one of them"),
        ({"mass": 1.0, "inertia": 0.0}, "inertia of 0"),
    ],
)
def test_impossible_masses_are_refused(given, words):
    with pytest.raises(ValueError, match=words):
        plane_mass(BOX, **given)
