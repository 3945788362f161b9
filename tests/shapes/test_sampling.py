"""Points spread over outlines and meshes: evenly, on the surface, and standing for all of it."""

import numpy as np
import pytest

from warpsph.shapes.mesh import box_mesh, solid_mesh, sphere_mesh, winding_number
from warpsph.shapes.outline import Bend, Outline, box_outline, polygon_outline, reversed_outline
from warpsph.shapes.sampling import surface_of_mesh, surface_of_outline
from warpsph.shapes.section import section_of

# Double precision, sums along a few legs: relative.
TOLERANCE = 1e-12

LOW, HIGH = np.array([1.0, -2.0, 0.5]), np.array([1.1, -1.94, 0.54])
CUBOID = box_mesh(LOW, HIGH)
# A ramp of length a along x, width w along y and height c: triangle in x-z.
A, WIDTH, C = 0.3, 0.2, 0.12
WEDGE = solid_mesh(
    [[0, 0, 0], [A, 0, 0], [0, 0, C], [0, WIDTH, 0], [A, WIDTH, 0], [0, WIDTH, C]],
    [[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 3], [2, 3, 0]],
)

DISC = Outline((Bend(np.array([3.0, -2.0]), 0.25, -0.5 * np.pi, 2.0 * np.pi),), closed=True)
BOX = box_outline((1.0, 2.0), (1.6, 2.2))
BLOCK = polygon_outline([[0.0, 0.0], [0.25, 0.0], [0.325, 0.075], [0.0, 0.075]])


@pytest.mark.parametrize("outline", [BOX, DISC, BLOCK, reversed_outline(BLOCK)])
def test_points_of_an_outline(outline):
    spacing = 0.004
    surface = surface_of_outline(outline, spacing)
    plane = surface.points[:, [0, 2]]
    assert not surface.points[:, 1].any()
    assert outline.distance(plane).max() < 1e-12
    assert surface.shares.sum() == pytest.approx(outline.length, rel=TOLERANCE)
    ways = np.linalg.norm(surface.after, axis=1)
    assert ways.max() <= spacing * (1 + 1e-9) and ways.min() > 0.8 * spacing
    np.testing.assert_allclose(surface.points + surface.after, np.roll(surface.points, -1, axis=0), atol=1e-15)
    np.testing.assert_allclose(surface.points + surface.before, np.roll(surface.points, 1, axis=0), atol=1e-15)
    for leg in outline.legs:
        assert np.linalg.norm(plane - leg.points(np.zeros(1)), axis=1).min() < 1e-12
    # Outwards: the divergence theorem for the field x gives the area twice over.
    flux = np.einsum("ij,ij,i->", plane, surface.normals[:, [0, 2]], surface.shares)
    corners = 0 if isinstance(outline.legs[0], Bend) else len(outline.legs)
    assert flux == pytest.approx(
        2.0 * section_of(outline).area, abs=0.4 * corners * spacing * np.abs(plane).max() + 1e-4
    )


@pytest.mark.parametrize("mesh", [CUBOID, sphere_mesh([0.1, 0.2, 0.3], 0.03)])
def test_sampling_is_even(mesh):
    spacing = 0.005
    surface = surface_of_mesh(mesh, spacing)
    apart = np.linalg.norm(surface.points[:, None] - surface.points, axis=2)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.min(axis=1)
    assert nearest.min() > 0.4 * spacing
    assert nearest.std() < 0.15 * nearest.mean()
    assert 0.8 * spacing < nearest.mean() < 1.1 * spacing
    assert surface.shares.max() < 1.6 * spacing**2 and surface.shares.min() > 0.3 * spacing**2


def test_points_do_not_depend_on_how_fine_a_mesh_is():
    """Triangles much smaller than the spacing are joined: as many points, as even, on the sphere, and no area lost."""
    radius, spacing = 0.03, 0.01
    for mesh in (sphere_mesh([0.1, 0.2, 0.3], radius, 3), sphere_mesh([0.1, 0.2, 0.3], radius, 5)):
        surface = surface_of_mesh(mesh, spacing)
        total = np.linalg.norm(mesh.areas, axis=1).sum()
        assert surface.shares.sum() == pytest.approx(total, rel=1e-9)
        assert len(surface.points) == pytest.approx(total / (0.92 * spacing**2), abs=2)
        np.testing.assert_allclose(np.linalg.norm(surface.points - [0.1, 0.2, 0.3], axis=1), radius, rtol=0.02)
        apart = np.linalg.norm(surface.points[:, None] - surface.points, axis=2)
        np.fill_diagonal(apart, np.inf)
        assert apart.min(axis=1).std() < 0.15 * apart.min(axis=1).mean()


@pytest.mark.parametrize("mesh", [CUBOID, WEDGE])
def test_corners_and_edges_have_points_and_no_area_is_lost(mesh):
    spacing = 0.01
    surface = surface_of_mesh(mesh, spacing)
    assert surface.shares.sum() == pytest.approx(np.linalg.norm(mesh.areas, axis=1).sum(), rel=1e-9)
    gaps = np.linalg.norm(surface.points[:, None] - mesh.vertices, axis=2).min(axis=0)
    assert gaps.max() < 1e-12
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    # The lower edge along x at y = low: every point of it has a point of the surface within half a spacing.
    along = np.linspace(low[0], high[0], 200)
    edge = np.stack([along, np.full(200, low[1]), np.full(200, low[2])], axis=1)
    assert np.linalg.norm(surface.points[:, None] - edge, axis=2).min(axis=0).max() < 0.51 * spacing


@pytest.mark.parametrize("mesh", [CUBOID, sphere_mesh([0.1, 0.2, 0.3], 0.03)])
def test_points_lie_on_the_surface_and_normals_out_of_it(mesh):
    spacing = 0.005
    surface = surface_of_mesh(mesh, spacing)
    np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1.0, atol=1e-12)
    inside = winding_number(mesh, surface.points - 2e-4 * surface.normals)
    outside = winding_number(mesh, surface.points + 2e-4 * surface.normals)
    np.testing.assert_allclose(inside, 1.0, atol=1e-6)
    np.testing.assert_allclose(outside, 0.0, atol=1e-6)


def test_sampling_is_the_same_each_time():
    one, two = (surface_of_mesh(CUBOID, 0.006) for _ in range(2))
    np.testing.assert_array_equal(one.points, two.points)


def test_too_fine_a_spacing_is_refused():
    with pytest.raises(ValueError, match="too fine"):
        surface_of_mesh(CUBOID, 1e-6)
