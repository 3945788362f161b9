"""Triangle meshes: mass properties against closed forms, and what is refused."""

import math

import numpy as np
import pytest

from warpsph.shapes.mesh import (
    Mesh,
    ball_mass,
    box_mesh,
    contains,
    distance_to_mesh,
    is_deep,
    read_mesh,
    solid_mass,
    solid_mesh,
    sphere_mesh,
    stood_back,
    winding_number,
)

# Double precision, sums over triangles: relative.
TOLERANCE = 1e-10

LOW, HIGH = np.array([1.0, -2.0, 0.5]), np.array([1.1, -1.94, 0.54])
BOX = box_mesh(LOW, HIGH)
# A ramp of length a along x, width w along y and height c: triangle in x-z.
A, WIDTH, C = 0.3, 0.2, 0.12
WEDGE = solid_mesh(
    [[0, 0, 0], [A, 0, 0], [0, 0, C], [0, WIDTH, 0], [A, WIDTH, 0], [0, WIDTH, C]],
    [[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 3], [2, 3, 0]],
)


def test_box():
    mass = solid_mass(BOX, density=800.0)
    a, b, c = HIGH - LOW
    m = 800.0 * a * b * c
    assert mass.mass == pytest.approx(m, rel=TOLERANCE)
    np.testing.assert_allclose(mass.centre, 0.5 * (LOW + HIGH), rtol=TOLERANCE)
    expected = m / 12.0 * np.diag([b * b + c * c, c * c + a * a, a * a + b * b])
    np.testing.assert_allclose(mass.inertia, expected, rtol=0, atol=TOLERANCE * expected.max())


def test_sphere_converges_as_the_square_of_its_edges():
    """V = 4 pi r^3 / 3 and I = 2 m r^2 / 5, from below; 4 times refined to 0.7 %."""
    radius = 0.05
    errors = []
    for refinements in (2, 3, 4):
        mass = solid_mass(sphere_mesh([1.0, 2.0, 3.0], radius, refinements), density=1000.0)
        np.testing.assert_allclose(mass.centre, [1.0, 2.0, 3.0], rtol=1e-12)
        errors.append(
            [
                1.0 - mass.mass / (1000.0 * 4.0 / 3.0 * math.pi * radius**3),
                1.0 - mass.inertia[0, 0] / (0.4 * 1000.0 * 4.0 / 3.0 * math.pi * radius**5),
            ]
        )
        np.testing.assert_allclose(mass.inertia, mass.inertia[0, 0] * np.eye(3), atol=1e-6 * mass.inertia[0, 0])
    errors = np.array(errors)
    assert np.all(errors > 0.0) and np.all(errors[-1] < 7e-3)
    np.testing.assert_allclose(errors[:-1] / errors[1:], 4.0, rtol=0.1)


def test_wedge():
    """A right prism: centre at a third of its legs; m a^2 / 18, m c^2 / 18 and the product -m a c / 36 in x-z."""
    mass = solid_mass(WEDGE, mass=3.0)
    np.testing.assert_allclose(mass.centre, [A / 3, WIDTH / 2, C / 3], rtol=TOLERANCE)
    xx, yy, zz, xz = A * A / 18, WIDTH * WIDTH / 12, C * C / 18, -A * C / 36
    expected = 3.0 * np.array([[yy + zz, 0, -xz], [0, zz + xx, 0], [-xz, 0, xx + yy]])
    np.testing.assert_allclose(mass.inertia, expected, rtol=0, atol=TOLERANCE * expected.max())


def test_given_mass_properties():
    uniform = solid_mass(BOX, mass=2.0)
    off = solid_mass(BOX, mass=2.0, centre=uniform.centre + 0.01 * np.eye(3)[2])
    expected = uniform.inertia + 2.0 * 0.01**2 * np.diag([1.0, 1.0, 0.0])
    np.testing.assert_allclose(off.inertia, expected, rtol=TOLERANCE, atol=1e-15)
    given = np.diag([1.0, 2.0, 2.5])
    np.testing.assert_array_equal(solid_mass(BOX, mass=2.0, inertia=given).inertia, given)
    with pytest.raises(ValueError, match="no body has the principal inertias"):
        solid_mass(BOX, mass=2.0, inertia=np.diag([1.0, 2.0, 4.0]))
    with pytest.raises(ValueError, match="mass of 0 kg"):
        solid_mass(BOX, mass=0.0)


def test_winding_number():
    inside = np.array([[1.05, -1.97, 0.52], [1.001, -1.999, 0.501]])
    outside = np.array([[1.05, -1.97, 0.6], [0.999, -1.97, 0.52]])
    np.testing.assert_allclose(winding_number(BOX, inside), 1.0, atol=1e-9)
    np.testing.assert_allclose(winding_number(BOX, outside), 0.0, atol=1e-9)


@pytest.mark.parametrize("mesh", [BOX, WEDGE, sphere_mesh(HIGH, 0.1, 2)])
def test_inside_is_where_the_surface_winds_around(mesh):
    """On a lattice through corners and edges too, as particles stand; but for what lies in the surface itself."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    steps = np.stack(np.meshgrid(*3 * [np.linspace(-0.25, 1.25, 13)]), axis=-1).reshape(-1, 3)
    points = low + steps * (high - low)
    points = points[distance_to_mesh(mesh, points) > 1e-5]
    np.testing.assert_array_equal(contains(mesh, points), winding_number(mesh, points) > 0.5)


# ---- refusals ----


def joined(*meshes: Mesh) -> tuple[np.ndarray, np.ndarray]:
    counts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return np.concatenate([m.vertices for m in meshes]), np.concatenate(
        [m.triangles + c for m, c in zip(meshes, counts[:-1], strict=True)]
    )


@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        (BOX.vertices, BOX.triangles[1:], "the mesh is open: 3 edges have one triangle"),
        (BOX.vertices, BOX.triangles[:, ::-1], "inside out"),
        (BOX.vertices, np.concatenate([BOX.triangles[:1, ::-1], BOX.triangles[1:]]), "turned against each other"),
        (BOX.vertices * [1, 1, 0], BOX.triangles, "no volume|touches itself|line"),
        (*joined(BOX, box_mesh(LOW + 0.01, HIGH + 0.01)), "crosses itself"),
        (*joined(BOX, BOX), "touches itself"),
        (
            *joined(BOX, box_mesh(HIGH * [1, 1, 0] + LOW * [0, 0, 1], HIGH + 0.1 * np.array([1, 1, 0]))),
            "touches itself: 4",
        ),
        (BOX.vertices, BOX.triangles + 1, "names vertex 8; there are 8"),
        (BOX.vertices, np.empty((0, 3)), "no triangles"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "not finite"),
        (np.zeros((3, 3)), [[0, 1, 2]], "same place"),
    ],
)
def test_meshes_that_bound_no_solid_are_refused(vertices, triangles, words):
    with pytest.raises(ValueError, match=words) as caught:
        solid_mesh(vertices, triangles)
    assert "\n" not in str(caught.value)


def test_equal_vertices_are_merged():
    """An STL file gives each triangle three vertices of its own."""
    soup = BOX.corners.reshape(-1, 3)
    mesh = solid_mesh(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(mesh.vertices) == 8
    assert solid_mass(mesh, density=1.0).mass == pytest.approx(np.prod(HIGH - LOW), rel=TOLERANCE)


def test_two_bodies_apart_are_one_solid():
    mesh = solid_mesh(*joined(BOX, box_mesh(HIGH + 1.0, HIGH + 1.5)))
    assert solid_mass(mesh, density=1.0).mass == pytest.approx(np.prod(HIGH - LOW) + 0.125, rel=TOLERANCE)


def test_files(tmp_path):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / "box.stl"
    meshio.write(path, meshio.Mesh(1000.0 * BOX.vertices, [("triangle", BOX.triangles)]))
    mesh = read_mesh(path, scale=1e-3)
    assert solid_mass(mesh, density=1.0).mass == pytest.approx(np.prod(HIGH - LOW), rel=1e-4)  # STL is single precision
    quads = tmp_path / "cube.obj"
    corners = "\n".join(f"v {i & 1} {(i >> 1) & 1} {i >> 2}" for i in range(8))
    faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6"
    quads.write_text(f"{corners}\n{faces}\n")
    assert solid_mass(read_mesh(quads), density=1.0).mass == pytest.approx(1.0)
    path.write_text("solid nonsense")
    for bad in (path, tmp_path / "nowhere.stl"):
        with pytest.raises(ValueError, match=str(bad.name)) as caught:
            read_mesh(bad)
        assert "\n" not in str(caught.value)


# ---- standing back ----


def test_stood_back_surfaces():
    """A box shrinks on all sides, its corners included; a wedge to where its planes meet; a sphere by its radius."""
    back = stood_back(BOX, 0.005)
    np.testing.assert_allclose(
        np.sort(back.vertices, axis=0), np.sort(box_mesh(LOW + 0.005, HIGH - 0.005).vertices, axis=0)
    )
    normals = WEDGE.areas / np.linalg.norm(WEDGE.areas, axis=1)[:, None]
    moved = np.einsum("ijk,ik->ij", stood_back(WEDGE, 0.01).corners - WEDGE.corners, normals)
    np.testing.assert_allclose(moved, -0.01, rtol=1e-9)
    sphere = stood_back(sphere_mesh([1.0, 2.0, 3.0], 0.5, 3), 0.1)
    np.testing.assert_allclose(np.linalg.norm(sphere.vertices - [1.0, 2.0, 3.0], axis=1), 0.4, rtol=2e-3)


@pytest.mark.parametrize("distance", [0.021, 0.03, 0.05, 0.2])
def test_too_thin_to_stand_back(distance):
    with pytest.raises(ValueError, match="too thin or too small") as caught:
        stood_back(BOX, distance)  # 0.04 m high, 0.06 m wide
    assert "\n" not in str(caught.value)


def test_a_scan_that_folds_is_told_to_be_made_smoother():
    """Thick enough, and of triangles much finer than the distance, which are rough."""
    ball = sphere_mesh([0.0, 0.0, 0.0], 0.1)
    rough = 1.0 + 0.01 * np.random.default_rng(0).standard_normal(len(ball.vertices))
    with pytest.raises(ValueError, match=r"or it is rough there: make it smoother, of triangles about 0.04 m wide$"):
        stood_back(Mesh(rough[:, None] * ball.vertices, ball.triangles), 0.02)


def test_distance_to_mesh():
    """From above a face, beyond an edge and a corner, and from inside."""
    off = np.array([[-0.03, -0.02, 0.01], [0.03, -0.02, 0.04], [0.02, 0.03, 0.06], [-0.05, -0.03, -0.01]])
    np.testing.assert_allclose(distance_to_mesh(BOX, HIGH + off), [0.01, 0.05, 0.07, 0.01], rtol=1e-9)


def test_what_is_farther_than_asked_is_not_looked_for():
    points = HIGH + np.array([[0.0, 0.0, 0.01], [0.0, 0.0, 0.03], [-0.05, -0.03, -0.02]])
    np.testing.assert_allclose(distance_to_mesh(BOX, points, 0.021), [0.01, np.inf, 0.02], rtol=1e-6)
    np.testing.assert_array_equal(is_deep(BOX, points, 0.019), [False, False, True])
    np.testing.assert_array_equal(is_deep(BOX, points, 0.021), [False, False, False])


def test_ball():
    mass = ball_mass([1.0, 2.0, 3.0], 0.5, mass=3.0, centre=[1.0, 2.0, 2.9])
    expected = 0.4 * 3.0 * 0.25 * np.eye(3) + 3.0 * 0.01 * np.diag([1.0, 1.0, 0.0])
    np.testing.assert_allclose(mass.inertia, expected, rtol=TOLERANCE, atol=1e-15)
