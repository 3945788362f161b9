"""Walls, and volumes of fluid: distances, openings and samples against what is known of a box and a sheet."""

import math

import numpy as np
import pytest

from warpsph.shapes.crate import FACES, Crate
from warpsph.shapes.outline import Line, Outline
from warpsph.shapes.sheet import Sheet
from warpsph.shapes.volumes import Frame, Sphere

LOW, HIGH = np.array([0.0, -1.0, 0.5]), np.array([2.0, 1.0, 1.5])
SPACING = 0.07


def crate(*names: str) -> Crate:
    return Crate(LOW, HIGH, frozenset(names))


def corner() -> Sheet:
    """Down a wall and along a bed, 0.6 m across."""
    down, along = (Line(np.array(a), np.array(b)) for a, b in (([0.0, 1.0], [0.0, 0.0]), ([0.0, 0.0], [2.0, 0.0])))
    return Sheet(Outline((down, along), closed=False), (0.1, 0.7))


def cloud(count: int = 400) -> np.ndarray:
    return np.random.default_rng(3).uniform(-2.0, 3.0, (count, 3))


WALLS = {"box": crate(), "tank": crate("top"), "sides": crate("left", "right", "bottom", "top"), "sheet": corner()}


@pytest.mark.parametrize("wall", WALLS.values(), ids=WALLS.keys())
def test_distance_is_that_to_the_nearest_of_many_samples(wall):
    points, samples = cloud(), wall.sample(0.03)[0]
    brute = np.array([np.linalg.norm(samples - point, axis=1).min() for point in points])
    distance = wall.distance(points)
    assert np.all(distance <= brute + 1e-12)
    np.testing.assert_allclose(distance, brute, atol=0.03)


@pytest.mark.parametrize("wall", WALLS.values(), ids=WALLS.keys())
def test_samples_are_a_lattice_without_gaps_or_twins(wall):
    points, normals, areas = wall.sample(SPACING)
    np.testing.assert_allclose(wall.distance(points), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert areas.sum() == pytest.approx(wall.area)
    gap = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(gap, np.inf)
    nearest = gap.min(axis=1)
    assert 0.8 * SPACING < nearest.min() <= nearest.max() <= SPACING * (1 + 1e-9)
    # No place on the wall is farther from a point than half the diagonal of a cell.
    finer = wall.sample(0.3 * SPACING)[0]
    for place in finer[::7]:
        assert np.linalg.norm(points - place, axis=1).min() <= math.sqrt(0.5) * SPACING * (1 + 1e-9)


def test_area_is_that_of_the_faces_that_are_there():
    assert crate().area == pytest.approx(2 * (2 * 2 + 2 * 1 + 2 * 1))
    areas = {"left": 2, "right": 2, "front": 2, "back": 2, "bottom": 4, "top": 4}
    for name in FACES:
        assert crate(name).area == pytest.approx(16 - areas[name])
        assert len(crate(name).faces()) == 5
    assert corner().area == pytest.approx(3.0 * 0.6)


def test_faces_have_the_area_of_the_wall():
    for wall in WALLS.values():
        a, b, c, d = np.moveaxis(wall.faces(), 1, 0)
        area = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
        assert area.sum() == pytest.approx(wall.area)


@pytest.mark.parametrize(
    ("wall", "level", "where"),
    [
        (crate("top"), 1.5, None),
        (crate("top", "left"), 1.0, (0, 0.0)),
        (crate("top", "back"), 1.0, (1, 1.0)),
        (crate("top", "bottom"), 1.0, (2, 0.5)),
    ],
)
def test_openings_of_a_box(wall, level, where):
    """Water runs out through a side that is missing, and over the rim."""
    openings = wall.openings(level, 0.1)
    below = openings[openings[:, 2] < min(level, 1.5) - 1e-9]
    if where is None:
        assert not len(below)
    else:
        axis, place = where
        np.testing.assert_allclose(below[:, axis], place)
        other = 1 if axis == 0 else 0
        assert (below[:, other].min(), below[:, other].max()) == pytest.approx((LOW[other], HIGH[other]))
    over = wall.openings(2.0, 0.1)
    rim = over[over[:, 2] > 1.5 + 1e-9]
    assert len(rim) and rim[:, 2].max() == pytest.approx(2.0)


def test_openings_of_a_sheet():
    """Over the end of the bed, over the wall, and out of both sides."""
    openings = corner().openings(0.5, 0.1)
    at_end = np.isclose(openings[:, 0], 2.0)
    at_side = np.isclose(openings[:, 1], 0.1) | np.isclose(openings[:, 1], 0.7)
    assert at_end.any() and at_side.any() and np.all(at_end | at_side)
    assert openings[:, 2].max() < 0.5


def test_a_box_set_back_is_bigger_inside_and_smaller_outside():
    bigger, smaller = crate("top").set_back(0.1, 1), crate("top").set_back(0.1, -1)
    np.testing.assert_allclose([bigger.low, bigger.high], [LOW - 0.1, HIGH + 0.1])
    np.testing.assert_allclose([smaller.low, smaller.high], [LOW + 0.1, [1.9, 0.9, 1.6]])
    thin = Crate(LOW, LOW + np.array([1.0, 0.05, 1.0]), frozenset()).set_back(0.1, -1)
    assert np.all(thin.low < thin.high), "it turned inside out"


def test_a_sphere_in_a_turned_lattice_stays_a_sphere():
    ball, frame = Sphere(np.array([1.0, 2.0, 3.0]), 0.5), Frame(np.array([0.3, 0.1, -0.2]), 25.0, 0.1)
    points = np.random.default_rng(5).uniform(0.0, 4.0, (4000, 3))
    cells = frame.cells(points)
    np.testing.assert_allclose(frame.points(cells), points)
    inside = np.linalg.norm(points - ball.center, axis=1) < 0.5
    assert inside.any()
    np.testing.assert_array_equal(ball.holds(cells, frame), inside)
    low, high = ball.bounds(frame)
    assert np.all((cells[inside] > low) & (cells[inside] < high))


@pytest.mark.parametrize("steps", [1, 2, 3, 5])
@pytest.mark.parametrize("corner", [0.0, 0.123])
def test_layers_fill_a_square_though_the_last_is_a_point(steps, corner):
    """A square of an odd number of steps has a point for its innermost layer; without legs it once was a traceback."""
    corners = corner + 0.04 * steps * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    square = Outline(tuple(Line(a, b) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)), closed=True)
    points, volumes = Sheet(square).layers(-1, 0.04, 3, ())
    assert len(points) == steps**2
    assert volumes == pytest.approx(np.full(steps**2, 0.04**2))
