"""Bodies of a scene: what is refused, where they are put, and what they displace."""

import math

import numpy as np
import pytest

from warpsph.geometry import place
from warpsph.scene import SceneError

POND = """\
title: A pond
spacing: 0.02
materials: {water: {density: 1000.0, sound_speed: 50.0}}
walls:
  - {name: pond, path: [[0.0, 1.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]}
fluids:
  - {name: water, material: water, fill: {level: 0.4, above: pond}}
bodies:
  - {name: crate, shape: {box: {min: [0.3, 0.3], max: [0.5, 0.5]}}, density: 600.0}
  - {name: buoy, shape: {disc: {center: [0.7, 0.4], radius: 0.1}}, density: 500.0}
run: {end_time: 1.0}
"""
CUBE = """\
title: A cube in a box of water
dimensions: 3
spacing: 0.05
materials: {water: {density: 1000.0, sound_speed: 50.0}}
walls:
  - {name: tank, box: {min: [0.0, 0.0, 0.0], max: [1.0, 1.0, 1.0], open: [top]}}
fluids:
  - {name: water, material: water, fill: {level: 0.5, above: tank}}
bodies:
  - {name: cube, shape: {box: {min: [0.3, 0.3, 0.3], max: [0.7, 0.7, 0.7]}}, density: 500.0}
run: {end_time: 1.0}
"""


def tail(error: pytest.ExceptionInfo) -> str:
    """The one line of an error without the name of the file."""
    text = str(error.value)
    assert "\n" not in text
    return text.partition("scene.yaml:")[2] or text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("min: [0.3, 0.3]", "min: [-0.1, 0.3]", "bodies[0].shape: wall 'pond' runs through it"),
        ("center: [0.7, 0.4]", "center: [1.3, 0.4]", "bodies[1]: lies behind wall 'pond'"),
        ("center: [0.7, 0.4]", "center: [0.55, 0.4]", "bodies[1].shape: overlaps body 'crate'"),
        ("max: [0.5, 0.5]", "max: [0.31, 0.5]", "too thin or too small"),
        ("density: 600.0", "mass: 0.0", "bodies[0].mass: must be more than 0"),
        ("density: 600.0", "mass: 1.0, density: 1.0", "exactly one of density, mass"),
        ("density: 600.0", "", "exactly one of density, mass"),
        ("name: buoy", "name: Crate", "bodies[1].name: 'Crate' is the name of bodies[0] already"),
        ("density: 600.0", "density: 600.0, locked: [z], velocity: [0.0, -1.0]", "velocity: starts with -1 along 'z'"),
        ("density: 600.0", "density: 600.0, locked: [angle], spin: 2.0", "spin: starts with 2 along 'angle'"),
        ("density: 600.0", "density: 600.0, locked: [turn_x]", "'turn_x' means nothing in a 2-D scene"),
        ("density: 600.0", "density: 600.0, motion: {kind: sine, shift: [0.1, 0.0]}", "motion.period: this field is"),
        ("density: 600.0", "density: 600.0, motion: {kind: table}", "motion.file: this field is missing"),
        ("density: 600.0", "density: 600.0, motion: {kind: constant}", "a shift or a turn is needed"),
        (
            "density: 600.0",
            "density: 600.0, velocity: [1.0, 0.0], motion: {kind: constant, shift: [1.0, 0.0]}",
            "velocity: contradicts its prescribed motion",
        ),
        (
            "density: 600.0",
            "density: 600.0, contact: {static_friction: 0.1, dynamic_friction: 0.2}",
            "contact.dynamic_friction: must be at most static_friction",
        ),
        ("box: {min: [0.3, 0.3], max: [0.5, 0.5]}", "sphere: {center: [0.0, 0.0, 0.0], radius: 0.1}", "in a 2-D scene"),
        (
            "box: {min: [0.3, 0.3], max: [0.5, 0.5]}",
            "polygon: [[0.2, 0.2], [0.4, 0.4], [0.4, 0.2], [0.2, 0.4]]",
            "bodies[0].shape: its outline crosses or touches itself",
        ),
        ("fill: {level: 0.4, above: pond}", "shape: {box: {min: [0.2, 0.1], max: [0.6, 0.4]}}", "body 'crate' lies in"),
    ],
)
def test_impossible_bodies_are_refused_in_one_line(make_scene, old, new, words):
    assert old in POND
    with pytest.raises(SceneError) as error:
        place(make_scene(POND.replace(old, new)))
    assert words in tail(error)
    assert tail(error)[0].isdigit()  # the line


def test_table_whose_time_goes_back_is_refused(make_scene, tmp_path):
    table = tmp_path / "way.csv"
    table.write_text("time [s],x [m]\n0,0\n1,0.1\n0.5,0.2\n")
    motion = f"density: 600.0, motion: {{kind: table, file: {table}}}"
    with pytest.raises(SceneError) as error:
        place(make_scene(POND.replace("density: 600.0", motion)))
    assert f"bodies[0].motion.file: {table}:4: time goes back, from 1 s to 0.5 s" in tail(error)


@pytest.mark.parametrize(
    ("faces", "words"),
    [
        ("3 0 1 2\n3 0 2 3\n", "open|edge|hole"),
        ("3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n", None),
        ("3 0 1 2\n3 0 3 1\n3 1 3 2\n3 2 3 0\n", "inside out"),
    ],
    ids=["open", "whole", "inside out"],
)
def test_mesh_that_is_no_solid_is_refused(make_scene, tmp_path, faces, words):
    pytest.importorskip("meshio")
    corners = ["0.2 0.2 0.2", "0.8 0.2 0.2", "0.2 0.8 0.2", "0.2 0.2 0.8"]
    header = f"OFF\n4 {faces.count(chr(10))} 0\n"
    (tmp_path / "hull.off").write_text(header + "\n".join(corners) + "\n" + faces)
    mesh = f"mesh: {{file: {tmp_path / 'hull.off'}}}"
    scene = make_scene(CUBE.replace("box: {min: [0.3, 0.3, 0.3], max: [0.7, 0.7, 0.7]}", mesh))
    if words is None:
        (solid,) = place(scene).solids
        assert solid.body.mass.mass == pytest.approx(500.0 * 0.6**3 / 6.0)
        return
    with pytest.raises(SceneError, match=words) as error:
        place(scene)
    assert "bodies[0].shape: " in tail(error)


def test_fill_is_displaced(make_scene):
    """No particle within half a spacing of a body, and none missing beyond a spacing and a half of it."""
    scene = make_scene(POND)
    without = place(make_scene(POND.partition("bodies:")[0] + "run: {end_time: 1.0}\n")).position
    placement = place(scene)
    crate, buoy = placement.solids
    gaps = np.minimum(*(np.where(s.contains(without), 0.0, s.distance(without)) for s in (crate, buoy)))
    kept = {tuple(x) for x in placement.position.round(9)}
    is_kept = np.array([tuple(x) in kept for x in without.round(9)])
    assert not is_kept[gaps < 0.0099].any() and is_kept[gaps > 0.0101].all()


def test_place_angle_mass_and_points(make_scene):
    turned = "shape: {box: {min: [-0.1, 0.0], max: [0.1, 0.1]}}, at: [0.4, 0.5], angle: 30.0"
    (crate, _) = place(make_scene(POND.replace("shape: {box: {min: [0.3, 0.3], max: [0.5, 0.5]}}", turned))).solids
    mass = crate.body.mass
    assert mass.mass == pytest.approx(600.0 * 0.02)
    off = 0.05 * np.array([-math.sin(math.radians(30.0)), 0.0, math.cos(math.radians(30.0))])
    np.testing.assert_allclose(mass.centre - off, [0.4, 0.0, 0.5], atol=1e-12)
    # The points that push stand back from what is drawn.
    assert crate.contains(crate.body.surface.points).all()
    np.testing.assert_allclose(crate.distance(crate.body.surface.points), 0.95 * 0.02, rtol=1e-9)


def test_points_reach_into_a_sharp_corner(make_scene):
    """Nothing of a tip of 30 degrees is farther from the points than what they stand back, but for its very end."""
    tip = "shape: {polygon: [[0.3, 0.3], [0.65, 0.3], [0.3, 0.502073]]}"
    (wedge, _) = place(make_scene(POND.replace("shape: {box: {min: [0.3, 0.3], max: [0.5, 0.5]}}", tip))).solids
    points, back = wedge.body.surface.points, 0.95 * 0.02
    assert wedge.contains(points).all()
    assert len(points) == len(wedge.body.surface.before) == len(wedge.body.surface.after)
    assert np.linalg.norm(points - [0.65, 0.0, 0.3], axis=1).min() == pytest.approx(back)
    faces = wedge.samples[np.linalg.norm(wedge.samples - [0.65, 0.0, 0.3], axis=1) > back]
    gaps = np.linalg.norm(faces[:, None] - points, axis=2).min(axis=1)
    assert gaps.max() < 1.5 * back


def test_body_may_lie_on_a_wall(make_scene):
    """A block that is drawn on its ramp to five digits is not in it."""
    ramp = POND.replace("[0.0, 1.0], [0.0, 0.0]", "[-1.0, 0.57735], [0.0, 0.0]")
    block = "shape: {box: {min: [-0.2, 0.0], max: [0.0, 0.1]}}, at: [-0.7, 0.40415], angle: -30.0"
    assert len(place(make_scene(ramp.replace("shape: {box: {min: [0.3, 0.3], max: [0.5, 0.5]}}", block))).solids) == 2


def test_cube_in_space(make_scene):
    (cube,) = place(make_scene(CUBE)).solids
    assert cube.body.mass.mass == pytest.approx(500.0 * 0.4**3)
    placement = place(make_scene(CUBE))
    assert len(placement.position) == 20 * 20 * 10 - 8 * 8 * 4  # 0.3 to 0.7 and to the level of 0.5
    assert not cube.contains(placement.position).any()
