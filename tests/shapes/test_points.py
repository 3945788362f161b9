"""Points and vectors of the plane and of space."""

import math

import numpy as np

from warpsph.shapes.points import around, in_plane, in_space, inside_box, spatial, turned, unit


def test_plane_vectors_come_into_space():
    np.testing.assert_array_equal(spatial([1.0, 2.0]), [1.0, 0.0, 2.0])
    np.testing.assert_array_equal(spatial(np.array([1.0, 2.0])), [1.0, 0.0, 2.0])
    np.testing.assert_array_equal(spatial((1.0, 5.0, 2.0)), [1.0, 5.0, 2.0])


def test_sets_of_points_come_into_space_and_back():
    plane = np.array([[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(in_space(plane, y=5.0), [[1.0, 5.0, 2.0], [3.0, 5.0, 4.0]])
    np.testing.assert_array_equal(in_plane(in_space(plane)), plane)


def test_turns_are_counter_clockwise():
    np.testing.assert_allclose(turned([[1.0, 0.0], [0.0, 2.0]], 0.5 * math.pi), [[0.0, 1.0], [-2.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(turned([1.0, 0.0], math.radians(60.0)), [0.5, math.sqrt(0.75)], rtol=1e-15)
    np.testing.assert_allclose(turned([[3.0, 1.0]], math.pi, [2.0, 1.0]), [[1.0, 1.0]], atol=1e-15)


def test_unit_vectors():
    np.testing.assert_allclose(unit(np.array([3.0, 0.0, 4.0]), otherwise=(0.0, 0.0, 1.0)), [0.6, 0.0, 0.8])
    np.testing.assert_array_equal(unit(np.zeros(2), otherwise=(0.0, 1.0)), [0.0, 1.0])


def test_boxes_around_points():
    low, high = around(np.array([[1.0, 5.0, 2.0], [3.0, 4.0, 0.0]]), np.empty((0, 3)), np.array([[2.0, 6.0, 1.0]]))
    np.testing.assert_array_equal([low, high], [[1.0, 4.0, 0.0], [3.0, 6.0, 2.0]])
    places = np.array([[2.0, 5.0, 1.0], [1.0, 5.0, 1.0], [2.0, 7.0, 1.0]])  # within, on a face, and beyond
    np.testing.assert_array_equal(inside_box(places, low, high), [True, False, False])
