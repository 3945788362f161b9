"""Outlines of legs and arcs: the other way round, moved, and their parallels."""

import math

import numpy as np
import pytest

from warpsph.shapes.outline import Bend, Line, Outline, box_outline, counter_clockwise, reversed_outline

BOX = box_outline((1.0, 2.0), (1.6, 2.2))
# A stadium: two straight legs and half a circle at each end.
STADIUM = Outline(
    (
        Line(np.array([-0.3, -0.1]), np.array([0.3, -0.1])),
        Bend(np.array([0.3, 0.0]), 0.1, -0.5 * math.pi, math.pi),
        Line(np.array([0.3, 0.1]), np.array([-0.3, 0.1])),
        Bend(np.array([-0.3, 0.0]), 0.1, 0.5 * math.pi, math.pi),
    ),
    closed=True,
)


def test_counter_clockwise():
    assert counter_clockwise(BOX) is BOX
    assert counter_clockwise(reversed_outline(BOX)).legs[0].points(np.zeros(1)) == pytest.approx(
        BOX.legs[0].points(np.zeros(1))
    )


def test_moved_outline_keeps_its_shape():
    """Turned by a quarter and moved: each point (x, z) of it comes to (2 - z, x - 1)."""
    fractions = np.linspace(0.0, 1.0, 7)
    for before, after in zip(STADIUM.legs, STADIUM.moved([2.0, -1.0], 0.5 * math.pi).legs, strict=True):
        x, z = before.points(fractions).T
        np.testing.assert_allclose(after.points(fractions), np.stack([2.0 - z, x - 1.0], axis=1), atol=1e-15)
        assert after.length == pytest.approx(before.length, rel=1e-12)
    np.testing.assert_array_equal(BOX.moved([0.5, 0.25]).polygon(), np.add(BOX.polygon(), [0.5, 0.25]))


def test_offset_outline_is_parallel():
    """A box and a stadium run counter-clockwise, so that their left is inside."""
    low, high = BOX.offset(0.05).polygon().min(axis=0), BOX.offset(0.05).polygon().max(axis=0)
    np.testing.assert_allclose([low, high], [[1.05, 2.05], [1.55, 2.15]], rtol=1e-12)
    inner = STADIUM.offset(0.04)
    np.testing.assert_allclose(STADIUM.distance(inner.polygon()), 0.04, rtol=1e-9)
    assert inner.length == pytest.approx(1.2 + 2.0 * math.pi * 0.06, rel=1e-12)
