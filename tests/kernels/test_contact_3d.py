"""Contact in space against mechanics: slopes, ramps with a width, stacks, edges across edges, balls and meshes."""

import math

import numpy as np
import pytest

from warpsph.bodies.body import Body
from warpsph.bodies.body_set import rotation
from warpsph.bodies.contact_geometry import contact_depth, contact_legs, corners_at, edges_at, facet_legs, joined
from warpsph.bodies.facets import crate_facets, facets, sheet_edges
from warpsph.shapes.crate import Crate
from warpsph.shapes.mesh import Mesh, box_mesh, solid_mass, solid_mesh, sphere_mesh, winding_number
from warpsph.shapes.outline import Line, Outline
from warpsph.shapes.sampling import surface_of_mesh
from warpsph.shapes.sheet import Sheet

# What the issue asks of contact: relative.
TOLERANCE = 0.01
G, H = 9.81, 0.0225
DEPTH = contact_depth(H)
# Overlaps up to this are not put right [m].
SLACK = 1e-4 * H
UPRIGHT = np.eye(3)
TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


@pytest.fixture
def run(touching):
    """A function of bodies, and of walls each with the side on which it is free, that lets them go."""

    def let_go(bodies, walls=(), **options):
        legs, points = [], []
        for wall, side in walls:
            if isinstance(wall, Sheet):
                legs += contact_legs(wall.outline, side, DEPTH, wall.width)
            found = sheet_edges(wall, side) if isinstance(wall, Sheet) else crate_facets(wall, side, DEPTH)
            legs += facet_legs(found, DEPTH)
            points += [corners_at(found.corners), edges_at(found.edges)]
        return touching(bodies, legs, joined(points), smoothing_length=H, dimensions=3, **options)

    return let_go


def body(mesh: Mesh, mass=2.0, friction=0.0, at_rest=None, **fields) -> Body:
    at_rest = friction if at_rest is None else at_rest
    frictions = {"static_friction": at_rest, "dynamic_friction": friction}
    return Body("body", solid_mass(mesh, mass=mass), surface_of_mesh(mesh, 0.05), mesh=mesh, **frictions, **fields)


def ball(centre, radius, mass=1.0, friction=0.0, **fields) -> Body:
    mesh = sphere_mesh(centre, radius, 2)
    own = solid_mass(mesh, mass=mass)
    own.inertia[:] = 0.4 * mass * radius**2 * np.eye(3)
    frictions = {"static_friction": friction, "dynamic_friction": friction}
    return Body(
        "ball", own, surface_of_mesh(mesh, 0.05), mesh=mesh, ball=(np.array(centre), radius), **frictions, **fields
    )


def box(low, high, turn=UPRIGHT, shift=(0.0, 0.0, 0.0), **fields) -> Body:
    mesh = box_mesh(low, high)
    return body(Mesh(mesh.vertices @ np.asarray(turn).T + shift, mesh.triangles), **fields)


def turn_about(axis, angle) -> np.ndarray:
    half = 0.5 * angle
    return rotation([*(math.sin(half) * np.asarray(axis, float) / np.linalg.norm(axis)), math.cos(half)])


FLOOR = (Crate(np.array([-5.0, -5.0, 0.0]), np.array([5.0, 5.0, 5.0]), frozenset({"top"})), 1)


def slope(angle: float, width=(-1.0, 1.0)) -> tuple[Sheet, int]:
    """Through the origin, down along x."""
    way = np.array([math.cos(angle), -math.sin(angle)])
    return Sheet(Outline((Line(-20.0 * way, 20.0 * way),), closed=False), width), 1


def overlap(run, one=1, other=2) -> float:
    """How deep any corner of one body lies in the other, or the other way round [m]."""
    deepest = 0.0
    for a, b in ((one, other), (other, one)):
        mesh, points = run.mesh(b), run.mesh(a).vertices
        inside = points[winding_number(mesh, points) > 0.5]
        normals = mesh.areas / np.linalg.norm(mesh.areas, axis=1)[:, None]
        for point in inside:
            deepest = max(deepest, np.abs(np.einsum("ij,ij->i", point - mesh.corners[:, 0], normals)).min())
    return deepest


# ---- walls ----


@pytest.mark.parametrize(
    ("at_rest", "moving", "stays"), [(0.7, 0.7, True), (0.6, 0.1, True), (0.3, 0.3, False), (0.5, 0.0, False)]
)
@pytest.mark.parametrize("heading", [0.0, 35.0])
def test_box_on_a_ramp(run, at_rest, moving, stays, heading):
    """30 degrees (tan = 0.577), the box turned on the ramp: it stays to the nanometre, or slides as it should."""
    a = math.radians(30.0)
    lie = turn_about([0, 1, 0], a) @ turn_about([0, 0, 1], math.radians(heading))
    sliding = run([box([-0.1, -0.08, 0.0], [0.1, 0.08, 0.06], lie, at_rest=at_rest, friction=moving)], [slope(a)])
    start = sliding.position()
    sliding(0.5)
    down = np.array([math.cos(a), 0.0, -math.sin(a)])
    expected = 0.0 if stays else G * (math.sin(a) - moving * math.cos(a))
    moved = sliding.position() - start
    assert sliding.velocity() @ down == pytest.approx(0.5 * expected, rel=TOLERANCE, abs=1e-9)
    assert np.linalg.norm(moved - moved @ down * down) < (1e-9 if stays else 1e-6)
    assert moved @ down == pytest.approx(0.125 * expected, rel=TOLERANCE, abs=1e-9)
    assert np.abs(sliding.spin()).max() < 1e-6


def test_friction_sees_the_way_it_slides(run):
    """On the flat, pushed along x and y at once: it slows down straight, at mu g."""
    sliding = run([box([-0.1, -0.1, 0.0], [0.1, 0.1, 0.02], friction=0.3, velocity=(0.6, 0.8, 0.0))], [FLOOR])(0.2)
    np.testing.assert_allclose(
        sliding.velocity(), np.array([0.6, 0.8, 0.0]) * (1.0 - 0.3 * G * 0.2), atol=TOLERANCE * 0.4
    )


@pytest.mark.parametrize(("friction", "share"), [(0.5, 5.0 / 7.0), (0.0, 1.0)])
def test_ball_rolls_or_slips(run, friction, share):
    """5/7 g sin where friction holds it, g sin where there is none; as a ball, not as a polyhedron."""
    a = math.radians(25.0)
    rolling = run([ball(0.05 * np.array([math.sin(a), 0.0, math.cos(a)]), 0.05, friction=friction)], [slope(a)])(0.5)
    speed = rolling.velocity() @ [math.cos(a), 0.0, -math.sin(a)]
    assert speed == pytest.approx(0.5 * share * G * math.sin(a), rel=TOLERANCE)
    assert rolling.spin()[1] == pytest.approx(speed / 0.05 if friction else 0.0, rel=TOLERANCE, abs=1e-9)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_dropped_ball_rebounds(run, restitution):
    dropped = run([ball([0.3, 0.2, 0.25], 0.05, friction=0.3, restitution=restitution)], [FLOOR])
    fall, speed = math.sqrt(2 * 0.2 / G), math.sqrt(2 * G * 0.2)
    dropped(1.02 * fall)
    expected = restitution * speed - G * 0.02 * fall * (restitution > 0)
    assert dropped.velocity()[2] == pytest.approx(expected, rel=0.01, abs=5e-3)
    assert dropped.position()[2] > 0.05 - SLACK


@pytest.mark.parametrize("shape", ["box", "tetrahedron"])
def test_tumbling_in_a_corner_of_a_tank(run, shape):
    """Thrown into a corner: it never gains energy nor leaves the tank, and comes to rest on a face."""
    mesh = box_mesh([-0.06, -0.05, -0.04], [0.06, 0.05, 0.04])
    if shape == "tetrahedron":
        mesh = solid_mesh([[0.1, 0, 0], [-0.05, 0.09, 0], [-0.05, -0.09, 0], [0, 0, 0.13]], TETRAHEDRON)
    turned = Mesh(mesh.vertices @ turn_about([1, 2, 0.5], 0.9).T + [0.25, 0.22, 0.2], mesh.triangles)
    tank = Crate(np.zeros(3), np.array([0.4, 0.4, 0.5]), frozenset({"top"}))
    thrown = run(
        [body(turned, friction=0.4, restitution=0.3, velocity=(1.5, 1.2, 0.0), spin=(5.0, -8.0, 3.0))], [(tank, 1)]
    )
    first = last = thrown.energy()
    for _ in range(200):
        thrown(0.01)
        energy = thrown.energy()
        assert energy < last + 1e-4 * first
        last = energy
        places = thrown.mesh().vertices
        assert places[:, 2].min() > -0.01 * H and np.all(np.abs(places[:, :2] - 0.2) < 0.2 + 0.01 * H)
    assert np.abs(thrown.velocity()).max() < 1e-6 and np.abs(thrown.spin()).max() < 1e-5
    assert np.sort(thrown.mesh().vertices[:, 2])[2] < SLACK


def test_box_slides_off_the_side_of_a_ramp_and_tips_over_its_border(run):
    """A ramp has a width: with its middle beyond the border a box falls off, and the border carries it until then."""
    narrow = slope(0.0, (-0.1, 0.1))
    inside = run([box([-0.1, 0.02, 0.0], [0.1, 0.16, 0.06], friction=0.5)], [narrow])(0.2)
    assert np.abs(inside.mesh().vertices[:, 2]).min() < SLACK and np.abs(inside.spin()).max() < 1e-6
    tipping = run([box([-0.1, 0.05, 0.0], [0.1, 0.19, 0.06], friction=0.5)], [narrow])
    tipping(0.3)
    assert tipping.spin()[0] < -1.0  # from z to y
    gone = run([box([-0.1, 0.11, 0.0], [0.1, 0.19, 0.06])], [narrow])(0.1)
    assert gone.velocity()[2] == pytest.approx(-0.1 * G, rel=1e-3)


def test_plate_across_the_rim_of_a_tank(run):
    """Wider than the tank, it lies on the borders of two walls, corners and edges in the air."""
    tank = Crate(np.zeros(3), np.array([0.4, 0.4, 0.3]), frozenset({"top"}))
    plate = run([box([-0.1, 0.1, 0.301], [0.5, 0.25, 0.33], friction=0.3)], [(tank, 1)])(0.5)
    np.testing.assert_allclose(np.sort(plate.mesh().vertices[:, 2])[:4], 0.3, atol=SLACK)
    assert np.abs(plate.velocity()).max() < 1e-9


def test_box_on_an_obstacle(run):
    """A crate that is free outside holds a box up, and one that comes from beside stops at its face."""
    crate = (Crate(np.array([-0.2, -0.2, 0.0]), np.array([0.2, 0.2, 0.2]), frozenset()), -1)
    above = run([box([-0.05, -0.3, 0.2], [0.05, 0.1, 0.25], friction=0.2)], [crate])(0.3)
    assert np.abs(above.mesh().vertices[:, 2].min() - 0.2) < SLACK and np.abs(above.spin()).max() < 1e-6
    coming = run([box([0.25, -0.3, 0.05], [0.35, 0.3, 0.15], velocity=(-1.0, 0.0, 0.0))], [crate], gravity=(0, 0, 0))
    coming(0.2)
    assert coming.mesh().vertices[:, 0].min() == pytest.approx(0.2, abs=SLACK)
    beside = run([box([0.25, -0.3, 0.05], [0.35, 0.3, 0.15], velocity=(0.0, 1.0, 0.0))], [crate], gravity=(0, 0, 0))
    assert beside(0.2).velocity()[1] == 1.0


# ---- bodies on bodies ----


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.03, -0.02)], ids=["flush", "shifted"])
def test_stack_stands(run, shift):
    """Three boxes, 1, 4 and 2 times the weight, with all sides flush or not; the floor carries them all."""
    boxes = [
        box(
            [-0.1, -0.1, 0.1 * i],
            [0.1, 0.1, 0.1 * (i + 1)],
            shift=(s * shift[0], s * shift[1], 0.0),
            mass=m,
            friction=0.4,
        )
        for i, (m, s) in enumerate(((10.0, 0), (40.0, 1), (20.0, -1)))
    ]
    stack = run(boxes, [FLOOR])
    start = stack.set.position.numpy().copy()
    stack(0.5)
    np.testing.assert_allclose(stack.set.position.numpy(), start, atol=1e-6)
    received = stack.set.received.numpy() / stack.step
    assert received[0, 2] == pytest.approx(-G * 70.0, rel=1e-5)


def test_box_slides_on_a_box(run):
    """The upper one, pushed, slides on at mu g, also over the border without a snag; the lower one stays."""
    lower = box([-0.2, -0.2, 0.0], [0.2, 0.2, 0.1], mass=50.0, friction=0.8)
    upper = box([-0.25, -0.1, 0.1], [-0.05, 0.1, 0.15], mass=1.0, friction=0.1, velocity=(1.0, 0.0, 0.0))
    pair = run([lower, upper], [FLOOR])
    pair(0.2)
    mu = math.sqrt(0.8 * 0.1)
    assert pair.velocity(2)[0] == pytest.approx(1.0 - mu * G * 0.2, rel=TOLERANCE)
    assert np.abs(pair.velocity(1)).max() < 1e-9 and overlap(pair) < 2 * SLACK
    assert np.abs(pair.spin(2)).max() < 1e-6


def test_corner_inside_belongs_to_the_nearer_face(run):
    """Two corners start 0.1 mm below a top and 0.2 mm from a side of what they lie on: they go up, not sideways."""
    lower = box([-0.2, -0.2, 0.0], [0.2, 0.2, 0.1], mass=50.0, friction=0.8)
    upper = box([0.0998, -0.1, 0.0999], [0.1998, 0.1, 0.15])
    pair = run([lower, upper], [FLOOR])(0.05)
    assert pair.mesh(2).vertices[:, 2].min() == pytest.approx(0.1, abs=2 * SLACK)
    assert pair.position(2)[0] == pytest.approx(0.1498, abs=1e-6)


def test_beams_cross(run):
    """One lies across the other: no corner touches anything, edges do; it neither sinks in nor turns."""
    lower = box([-0.3, -0.03, 0.0], [0.3, 0.03, 0.1], mass=5.0, friction=0.5)
    upper = box([-0.03, -0.3, 0.101], [0.03, 0.3, 0.15], mass=3.0, friction=0.5)
    pair = run([lower, upper], [FLOOR])(0.5)
    assert pair.mesh(2).vertices[:, 2].min() == pytest.approx(0.1, abs=SLACK)
    assert np.abs(pair.spin(2)).max() < 1e-6


def test_edge_falls_across_an_edge(run):
    """Two boxes on edge, at right angles: they meet in a single point of two edges, and bounce with e = 0.5."""
    half = 0.1 / math.sqrt(2.0)
    lower = box([-0.3, -0.05, -0.05], [0.3, 0.05, 0.05], turn_about([1, 0, 0], math.pi / 4), restitution=0.5, mass=1e9)
    upper = box(
        [-0.05, -0.3, -0.05],
        [0.05, 0.3, 0.05],
        turn_about([0, 1, 0], math.pi / 4),
        (0, 0, 2 * half + 0.05),
        restitution=0.5,
    )
    pair = run([lower, upper], gravity=(0.0, 0.0, 0.0))
    pair.set.velocity.assign(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]]))
    lowest = np.inf
    for _ in range(50):
        pair(0.002)
        lowest = min(lowest, pair.position(2)[2])
    assert lowest > 2 * half - SLACK
    np.testing.assert_allclose(pair.velocity(2), [0.0, 0.0, 0.5], atol=1e-6)


@pytest.mark.parametrize("other", ["face", "edge", "corner", "ball"])
def test_ball_strikes(run, other):
    """A ball on the middle of a face, an edge, a corner or a ball: e = 0.7 along the line of centres."""
    size, far = 0.1, 0.25
    turn, reach = {
        "face": (np.eye(3), size),
        "edge": (turn_about([0, 0, 1], math.pi / 4), math.sqrt(2.0) * size),
        "corner": (
            turn_about([0, 1, 0], math.atan(math.sqrt(0.5))) @ turn_about([0, 0, 1], math.pi / 4),
            math.sqrt(3.0) * size,
        ),
        "ball": (np.eye(3), size),
    }[other]
    struck = box([-size] * 3, [size] * 3, turn, restitution=0.7, mass=3.0)
    if other == "ball":
        struck = ball([0.0, 0.0, 0.0], size, mass=3.0, restitution=0.7)
    thrown = ball([far, 0.0, 0.0], 0.05, mass=1.0, restitution=0.7, velocity=(-1.0, 0.0, 0.0))
    pair = run([struck, thrown], gravity=(0.0, 0.0, 0.0))
    nearest = np.inf
    for _ in range(60):
        pair(0.005)
        nearest = min(nearest, pair.position(2)[0] - pair.position(1)[0])
    assert nearest > reach + 0.05 - SLACK
    assert pair.velocity(2)[0] - pair.velocity(1)[0] == pytest.approx(0.7, rel=1e-6)
    assert 3.0 * pair.velocity(1)[0] + pair.velocity(2)[0] == pytest.approx(-1.0, rel=1e-9)


def test_collision_keeps_momentum(run):
    """Spinning boxes fly into each other askew: linear and angular momentum stay, energy does not rise, none enters."""
    left = box([-0.1, -0.05, 0.0], [0.1, 0.05, 0.1], friction=0.5, velocity=(1.5, 0.1, 0.0), spin=(4.0, 5.0, -3.0))
    right = box([0.25, 0.0, 0.03], [0.35, 0.3, 0.33], turn_about([1, 1, 1], 0.0), mass=5.0, friction=0.5)
    pair = run([left, right], gravity=(0.0, 0.0, 0.0))
    before, energy, deepest = pair.momenta(), pair.set.kinetic_energy().sum(), 0.0
    for _ in range(100):
        pair(0.005)
        deepest = max(deepest, overlap(pair))
    assert pair.velocity(2)[0] > 0.05
    np.testing.assert_allclose(pair.momenta(), before, atol=1e-6)
    assert pair.set.kinetic_energy().sum() < energy
    assert deepest < 0.01 * H


def test_mesh_with_a_hollow_catches_a_ball(run):
    """A trough of a mesh that is not convex, its hollow a V: the ball rests on both of its slopes."""
    outline = [[-0.2, 0.0], [0.2, 0.0], [0.2, 0.2], [0.0, 0.05], [-0.2, 0.2]]
    vertices = [[x, y, z] for y in (-0.2, 0.2) for x, z in outline]
    front = [[0, 1, 3], [1, 2, 3], [0, 3, 4]]
    triangles = front + [[c + 5, b + 5, a + 5] for a, b, c in front]
    for i in range(5):
        j = (i + 1) % 5
        triangles += [[i, i + 5, j + 5], [i, j + 5, j]]
    trough = body(solid_mesh(vertices, triangles), mass=20.0, friction=0.5)
    radius, rise = 0.06, math.atan2(0.15, 0.2)
    pair = run([trough, ball([0.05, 0.02, 0.25], radius, friction=0.5)], [FLOOR])(2.0)
    assert pair.position(2)[[0, 2]] == pytest.approx([0.0, 0.05 + radius / math.cos(rise)], abs=1e-4)
    assert np.abs(pair.velocity(2)).max() < 1e-3


# ---- facets ----


def test_facets_of_a_box():
    """Two triangles are one face; 12 edges as long as the sides, 8 corners; the diagonals are no edges."""
    mesh = box_mesh([0.0, 0.0, 0.0], [0.3, 0.2, 0.1])
    found = facets(mesh.vertices, mesh.triangles, DEPTH)
    assert [len(face.corners) for face in found.faces] == [6] * 6
    assert sorted(edge.length for edge in found.edges) == pytest.approx([0.1] * 4 + [0.2] * 4 + [0.3] * 4)
    assert len(found.corners) == 8
    for face in found.faces:
        assert face.normal @ (face.corners.mean(axis=0) - mesh.vertices.mean(axis=0)) > 0.0
    for edge in found.edges:
        np.testing.assert_allclose(edge.into @ edge.way, 0.0, atol=1e-12)
        middle = edge.start + 0.5 * edge.length * edge.way
        assert np.all(edge.into @ (mesh.vertices.mean(axis=0) - middle) > 0.0)


def test_facets_of_a_tank():
    """From inside the hollow has no edges but the rim; from outside a crate has its twelve."""
    low, high = np.zeros(3), np.ones(3)
    inner = crate_facets(Crate(low, high, frozenset({"top"})), 1, DEPTH)
    assert len(inner.faces) == 5 and len(inner.edges) == 4 and len(inner.corners) == 4
    assert all(edge.start[2] == 1.0 and edge.way[2] == 0.0 for edge in inner.edges)
    for face in inner.faces:
        assert face.normal @ (0.5 - face.corners.mean(axis=0)) > 0.0
    outer = crate_facets(Crate(low, high, frozenset()), -1, DEPTH)
    assert len(outer.faces) == 6 and len(outer.edges) == 12 and len(outer.corners) == 8
