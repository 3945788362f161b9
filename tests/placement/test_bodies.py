"""Bodies of a scene: what is refused, where they are put, and what they displace."""

import math

import numpy as np
import pytest

from scenes import PUSHING_WALLS, crate, pool, scene, tank
from warpsph.bodies.facets import facets
from warpsph.placement.place import place
from warpsph.placement.solids import Faceted
from warpsph.scene.source import SceneError
from warpsph.shapes.mesh import box_mesh, sphere_mesh

POND = scene(
    "A pond",
    0.02,
    [tank(1.0, 1.0, name="pond")],
    [pool(0.4, "pond")],
    """bodies:
  - {name: crate, shape: {box: {min: [0.3, 0.3], max: [0.5, 0.5]}}, density: 600.0}
  - {name: buoy, shape: {disc: {center: [0.7, 0.4], radius: 0.1}}, density: 500.0}""",
    PUSHING_WALLS,
    sound_speed=50.0,
)
CUBE = scene(
    "A cube in a box of water",
    0.05,
    [crate(1.0, 1.0, 1.0)],
    [pool(0.5)],
    """bodies:
  - {name: cube, shape: {box: {min: [0.3, 0.3, 0.3], max: [0.7, 0.7, 0.7]}}, density: 500.0}""",
    PUSHING_WALLS,
    sound_speed=50.0,
    dimensions=3,
)


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
        (
            "disc: {center: [0.7, 0.4], radius: 0.1}",
            "box: {min: [0.3, 0.3], max: [0.5, 0.5]}",
            "bodies[1].shape: overlaps body 'crate'",
        ),
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
    surface = crate.body.surface
    assert crate.contains(surface.points).all()
    of_faces = np.linalg.norm(surface.normals, axis=1) > 0.0
    np.testing.assert_allclose(crate.distance(surface.points[of_faces]), 0.95 * 0.02, rtol=1e-9)


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


def test_points_reach_into_a_right_angle(make_scene):
    """No place on a box is farther from its points than what they stand back: a row into each of the four corners."""
    scene = make_scene(POND)
    (crate, _) = place(scene).solids
    surface, back = crate.body.surface, 0.95 * 0.02
    assert np.sum(np.linalg.norm(surface.normals, axis=1) == 0.0) == 4 * math.ceil(
        (math.sqrt(2.0) - 1.0) * back / scene.wall_spacing
    )
    gaps = np.linalg.norm(crate.samples[:, None] - surface.points, axis=2).min(axis=1)
    assert gaps.max() < math.hypot(back, 0.5 * scene.wall_spacing)  # between two points of a face


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


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("min: [0.3, 0.3, 0.3]", "min: [0.3, -0.1, 0.3]", "bodies[0].shape: wall 'tank' runs through it, at x = "),
        ("min: [0.3, 0.3, 0.3], max: [0.7, 0.7, 0.7]", "min: [1.1, 0.3, 0.3], max: [1.4, 0.7, 0.7]", "bodies[0]: lies"),
        ("max: [0.7, 0.7, 0.7]", "max: [0.7, 0.36, 0.7]", "bodies[0].shape: it is too thin or too small at x = "),
        ("density: 500.0", "mass: 0.0", "bodies[0].mass: must be more than 0"),
        ("density: 500.0", "", "exactly one of density, mass"),
        ("density: 500.0", "density: 500.0, spin: 2.0", "spin: three numbers [wx, wy, wz] are needed in a 3-D scene"),
        ("density: 500.0", "density: 500.0, inertia: 2.0", "inertia: three numbers [Jx, Jy, Jz] are needed"),
        ("density: 500.0", "density: 500.0, inertia: [1.0, 2.0, 4.0]", "no body has the principal inertias 1, 2 and 4"),
        ("density: 500.0", "density: 500.0, inertia: [1.0, 2.0, -4.0]", "bodies[0].inertia[2]: must be more than 0"),
        ("density: 500.0", "density: 500.0, axis: [0.0, 0.0, 0.0]", "bodies[0].axis: a direction is needed"),
        ("density: 500.0", "density: 500.0, at: [0.1, 0.2]", "bodies[0].at: three numbers are needed"),
        ("density: 500.0", "density: 500.0, locked: [angle]", "'angle' means nothing in a 3-D scene"),
        (
            "density: 500.0",
            "density: 500.0, locked: [turn_y], spin: [0.0, 1.0, 0.0]",
            "spin: starts with 1 along 'turn_y', which is locked",
        ),
        (
            "box: {min: [0.3, 0.3, 0.3], max: [0.7, 0.7, 0.7]}",
            "disc: {center: [0.5, 0.5], radius: 0.2}",
            "bodies[0].shape.disc: means nothing in a 3-D scene; it goes with 'dimensions: 2'",
        ),
        (
            "density: 500.0}",
            "density: 500.0}\n  - {name: ball, shape: {sphere: {center: [0.8, 0.5, 0.5], radius: 0.15}}, density: 1.0}",
            "bodies[1].shape: overlaps body 'cube', at x = ",
        ),
        (
            "density: 500.0}",
            "density: 500.0}\n  - {name: ball, shape: {sphere: {center: [0.9, 0.5, 0.5], radius: 0.04}}, density: 1.0}",
            "bodies[1].shape: it is too small",
        ),
    ],
)
def test_impossible_bodies_in_space_are_refused_in_one_line(make_scene, old, new, words):
    assert old in CUBE
    with pytest.raises(SceneError) as error:
        place(make_scene(CUBE.replace(old, new)))
    assert words in tail(error)
    assert tail(error)[0].isdigit()  # the line


def test_sphere_in_space(make_scene):
    """It weighs and resists turning as a sphere, not as its mesh; its points stand back evenly."""
    shape = "sphere: {center: [0.0, 0.0, 0.0], radius: 0.2}"
    text = CUBE.replace("box: {min: [0.3, 0.3, 0.3], max: [0.7, 0.7, 0.7]}", shape)
    (sphere,) = place(make_scene(text.replace("density: 500.0", "density: 500.0, at: [0.5, 0.4, 0.6]"))).solids
    mass, middle = sphere.body.mass, np.array([0.5, 0.4, 0.6])
    assert mass.mass == pytest.approx(500.0 * 4.0 / 3.0 * math.pi * 0.2**3, rel=1e-12)
    np.testing.assert_allclose(mass.inertia, 0.4 * mass.mass * 0.2**2 * np.eye(3), rtol=1e-12, atol=1e-15)
    reach = np.linalg.norm(sphere.body.surface.points - middle, axis=1)
    np.testing.assert_allclose(reach, 0.2 - 0.95 * 0.05, rtol=2e-3)
    np.testing.assert_allclose(sphere.distance(np.array([[0.8, 0.4, 0.6], [0.5, 0.5, 0.6]])), 0.1)


def test_turned_about_an_axis_in_space(make_scene):
    """30 degrees about x, right-handed, y towards z; and by default x towards z. Moments turn along."""
    box = "shape: {box: {min: [-0.2, -0.15, 0.0], max: [0.2, 0.15, 0.3]}}, at: [0.5, 0.5, 0.6], angle: 30.0"
    text = CUBE.replace("shape: {box: {min: [0.3, 0.3, 0.3], max: [0.7, 0.7, 0.7]}}", box)
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    for axis, way in (("axis: [2.0, 0.0, 0.0], ", [0.0, -s, c]), ("", [-s, 0.0, c])):
        given = f"{axis}inertia: [1.0, 1.0, 1.5], density: 500.0"
        (solid,) = place(make_scene(text.replace("density: 500.0", given))).solids
        way = np.array(way)
        np.testing.assert_allclose(solid.body.mass.centre, [0.5, 0.5, 0.6] + 0.15 * way, atol=1e-12)
        np.testing.assert_allclose(solid.body.mass.inertia @ way, 1.5 * way, atol=1e-12)
        points = solid.body.surface.points
        np.testing.assert_allclose(solid.distance(points), 0.95 * 0.05, rtol=1e-9)
        assert solid.contains(points).all()


def test_mesh_in_space_is_what_its_file_says(make_scene, tmp_path):
    """A box from an STL file is that box: mass, inertia, contact and the places that it displaces."""
    meshio = pytest.importorskip("meshio")
    mesh = box_mesh([-0.2, -0.2, -0.2], [0.2, 0.2, 0.2])
    meshio.write(tmp_path / "cube.stl", meshio.Mesh(1000.0 * mesh.vertices, [("triangle", mesh.triangles)]))
    shape = f"mesh: {{file: {tmp_path / 'cube.stl'}, scale: 0.001}}"
    text = CUBE.replace("box: {min: [0.3, 0.3, 0.3], max: [0.7, 0.7, 0.7]}", shape)
    read = place(make_scene(text.replace("density: 500.0", "density: 500.0, at: [0.5, 0.5, 0.5]")))
    drawn = place(make_scene(CUBE))
    (one,), (other,) = read.solids, drawn.solids
    assert one.body.mass.mass == pytest.approx(other.body.mass.mass, rel=1e-6)
    np.testing.assert_allclose(one.body.mass.inertia, other.body.mass.inertia, rtol=1e-6, atol=1e-8)
    np.testing.assert_array_equal(read.position, drawn.position)
    found = facets(one.body.mesh.vertices, one.body.mesh.triangles, 0.01)
    assert (len(found.faces), len(found.edges), len(found.corners)) == (6, 12, 8)
    np.testing.assert_allclose(one.distance(one.body.surface.points), 0.95 * 0.05, rtol=1e-4)


@pytest.mark.parametrize("thick", [1.2, 2.2, 3.0, 4.4, 5.0, 8.0])
def test_dummies_of_a_thin_mesh_are_the_layers_for_which_there_is_room(thick):
    """Three layers ask for 2.5 spacings from either side; a plate that has less keeps those that it has."""
    spacing = 0.1
    plate = box_mesh([0.0, 0.0, 0.0], [1.4, 1.2, thick * spacing])
    points = Faceted(plate, np.eye(3), np.zeros(3)).dummies(spacing, 3.0 * spacing).points
    depth = np.minimum(points, [1.4, 1.2, thick * spacing] - points).min(axis=1)
    assert 0.24 * spacing < depth.min() < 0.51 * spacing
    assert set(np.round(depth / spacing - 0.5, 1)) <= {0.0, 1.0, 2.0}
    assert depth.max() == pytest.approx((min(int(0.5 * thick - 0.25), 2) + 0.5) * spacing, abs=0.01)


def test_dummies_of_a_ball_from_a_file_are_those_of_a_ball():
    """Of a radius of 2.5 spacings: two layers, and nothing to complain of in its middle."""
    one = Faceted(sphere_mesh([0.0, 0.0, 0.0], 0.25), np.eye(3), np.zeros(3)).dummies(0.1, 0.3)  # the third is folds
    radius = np.linalg.norm(one.points, axis=1)
    assert set(np.round(radius[radius > 0.05], 1)) == {0.1, 0.2}


def test_a_mesh_too_thin_for_its_first_layer_is_refused():
    plate = box_mesh([0.0, 0.0, 0.0], [1.4, 1.2, 0.09])
    with pytest.raises(ValueError, match="too thin or too small"):
        Faceted(plate, np.eye(3), np.zeros(3)).dummies(0.1, 0.3)
