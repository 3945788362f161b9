"""Layers of dummy particles: one lattice with the water of a tank, the strip behind every wall filled once."""

import math

import numpy as np
import pytest

from warpsph.placement.drawing import wall_surface
from warpsph.placement.dummies import place_dummies
from warpsph.scene.source import SceneError
from warpsph.shapes.points import near

DX = 0.05
FAR = np.array([[100.0, 0.0, 100.0]])  # fluid out of the way

PLANE = {
    "tank": "[{name: a, path: [[0, 1], [0, 0], [1, 0], [1, 1]]}]",
    "vee": "[{name: a, path: [[0, 1], [1, 0], [2, 1]]}]",
    "step": "[{name: a, path: [[0, 1], [0, 0.5], [0.5, 0.5], [0.5, 0], [1, 0], [1, 1]]}]",
    "ramp": "[{name: a, path: [[-1, 0.577], {at: [0, 0], radius: 0.3}, [1, 0], [1, 0.5]]}]",
    "drum": "[{name: a, disc: {center: [0, 0], radius: 0.4}}]",
    "two": "[{name: a, path: [[0, 0], [1, 0]]}, {name: b, path: [[1, 0], [1, 1]]}]",
    "cliff": "[{name: a, path: [[0, 1], [1, 1]]}, {name: b, path: [[1, 1], [1, 0], [2, 0]]}]",
}


@pytest.fixture
def place(make_scene):
    """A function of walls and sides that gives the scene, its walls and their dummies."""

    def make(walls: str, sides: list[int], dimensions: int = 2, fluid: np.ndarray = FAR):
        point = "[0, 0]" if dimensions == 2 else "[0, 0, 0]"
        scene = make_scene(f"""
title: Walls
dimensions: {dimensions}
spacing: {DX}
materials: {{water: {{density: 1000.0, sound_speed: 50.0}}}}
walls: {walls}
wall_model: {{force: dummy_particles}}
fluids: [{{name: water, material: water, shape: {{box: {{min: {point}, max: {point.replace("0", "1")}}}}}}}]
run: {{end_time: 1.0}}
""")
        surfaces = [wall_surface(scene, i) for i in range(len(scene.walls))]
        return surfaces, place_dummies(scene, surfaces, sides, fluid, 3 * DX)

    return make


def least_gap(points: np.ndarray) -> float:
    """Distance of the two nearest points, in spacings."""
    return min(float(np.delete(np.linalg.norm(points - one, axis=1), i).min()) for i, one in enumerate(points)) / DX


def test_a_tank_carries_the_lattice_of_its_water_on(place):
    _, dummies = place(PLANE["tank"], [1])
    halves = dummies.position[:, ::2] / DX - 0.5
    assert np.abs(halves - halves.round())[:, 0].max() < 1e-9
    assert dummies.volume == pytest.approx(DX**2)
    corner = {(-a - 0.5, -b - 0.5) for a in range(3) for b in range(3)} - {(-2.5, -2.5)}  # too far off to be seen
    assert corner <= {tuple(np.round(point, 9)) for point in dummies.position[:, ::2] / DX}


@pytest.mark.parametrize("name", PLANE)
def test_the_strip_behind_a_wall_is_filled_once(place, name):
    """Layers stand at 1/2, 3/2 and 5/2 of a spacing, no two points meet, and around a point of the wall, away from its
    corners and ends, the dummies fill half of what the kernel sees."""
    surfaces, dummies = place(PLANE[name], [1] * PLANE[name].count("name"))
    depth = np.min([one.distance(dummies.position) for one in surfaces], axis=0) / DX
    assert depth.min() > 0.47
    assert depth.max() < 3.6
    assert least_gap(dummies.position) > 0.6
    for surface in surfaces:
        points, _, _ = surface.outline.sample(0.1 * DX)
        ends = points[[0, -1]] if not surface.closed else np.empty((0, 2))
        for x in points[::7]:
            if len(ends) and np.linalg.norm(ends - x, axis=1).min() < 3 * DX:
                continue
            q = np.linalg.norm(dummies.position[:, ::2] - x, axis=1) / (1.5 * DX)
            t = np.maximum(1 - 0.5 * q, 0)
            share = (dummies.volume * 7 / (4 * math.pi * (1.5 * DX) ** 2) * t**4 * (1 + 2 * q)).sum()
            corners = [leg.start if hasattr(leg, "end") else x + 9 for leg in surface.outline.legs]
            if np.linalg.norm(np.array(corners) - x, axis=1).min() > 3 * DX:
                assert share == pytest.approx(0.5, abs=0.05)


def test_walls_that_meet_leave_no_hole(place):
    """Behind the corner of two walls dummies stand as behind that of one."""
    _, two = place(PLANE["two"], [1, 1])
    _, one = place("[{name: a, path: [[0, 0], [1, 0], [1, 1]]}]", [1])
    missed = ~near(one.position, two.position, 0.1 * DX)
    assert not missed.any()


def test_a_box_in_space_is_surrounded_but_for_its_open_side(place):
    box = "[{name: a, box: {min: [0, 0, 0], max: [1, 0.5, 0.5], open: [top]}}]"
    _, dummies = place(box, [1], dimensions=3)
    halves = dummies.position / DX - 0.5
    assert np.abs(halves - halves.round()).max() < 1e-9
    assert dummies.position[:, 2].max() == pytest.approx(0.5 - 0.5 * DX)
    inside = np.all((dummies.position > 0) & (dummies.position < [1, 0.5, 0.5]), axis=1)
    assert not inside.any()
    # Bottom and four sides, three layers each, and the edges and corners between them, but for what is out of reach.
    assert len(dummies.position) == pytest.approx(26 * 16 * 13 - 20 * 10 * 10, rel=0.05)


def test_an_obstacle_is_filled_from_its_faces(place):
    box = "[{name: a, box: {min: [0, 0, 0], max: [1, 0.5, 0.5]}}]"
    _, dummies = place(box, [-1], dimensions=3)
    assert len(dummies.position) == 20 * 10 * 10 - 14 * 4 * 4


def test_a_wall_without_thickness_between_two_waters_is_refused(place):
    with pytest.raises(SceneError, match=r"walls\[0\]: 'a' has fluid on both sides and no thickness; draw it as a box"):
        place("[{name: a, path: [[0, 0], [0, 1]]}]", [0])
    with pytest.raises(SceneError, match=r"walls\[0\]: 'a' is too thin: there is fluid behind it, at x = 0.07"):
        place("[{name: a, path: [[0, 1], [0, 0]]}]", [-1], fluid=np.array([[0.07, 0.0, 0.5]]))
