"""Rigid bodies as they are at the start: what is refused."""

import pytest

from warpsph.bodies.body import PLANE_SHIFT, PLANE_TURN, Body
from warpsph.shapes.outline import box_outline
from warpsph.shapes.sampling import surface_of_outline
from warpsph.shapes.section import plane_mass

BOX = box_outline((1.0, 2.0), (1.6, 2.2))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"velocity": (0.0, 1.0, 0.0)}, "velocity of 1 is about a locked axis, y"),
        ({"spin": (0.5, 0.0, 0.0)}, "spin of 0.5 is about a locked axis, x"),
        ({"restitution": 1.2}, "restitution of 1.2"),
        ({"static_friction": 0.2, "dynamic_friction": 0.3}, "less at rest"),
    ],
)
def test_impossible_bodies_are_refused(fields, words):
    mass, surface = plane_mass(BOX, mass=1.0), surface_of_outline(BOX, 0.1)
    with pytest.raises(ValueError, match=words):
        Body("box", mass, surface, BOX, free_shift=PLANE_SHIFT, free_turn=PLANE_TURN, **fields)
