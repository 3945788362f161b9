"""Triangle meshes: which triangle is nearest to a point, and whether the point lies inside, by Warp's tree of boxes."""

import warp as wp


@wp.kernel(enable_backward=False)
def find_nearest(
    first: int,
    mesh: wp.uint64,
    farthest: float,
    point: wp.array[wp.vec3],
    triangle_out: wp.array[int],
):
    """The nearest triangle within `farthest`, -1 for none."""
    i = first + wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, point[i], farthest)
    triangle_out[i] = wp.where(found.result, found.face, -1)


@wp.kernel(enable_backward=False)
def find_inside(first: int, mesh: wp.uint64, point: wp.array[wp.vec3], inside_out: wp.array[wp.uint8]):
    """Whether a point lies inside: a ray from it crosses the surface an odd number of times.

    A ray that meets an edge may count it twice or not at all: two rays are asked, along nothing that anyone would build
    along, and a third one where they do not agree.
    """
    i = first + wp.tid()
    a = wp.mesh_query_ray_count_intersections(mesh, point[i], wp.vec3(0.3571, 0.2137, 0.9093)) & 1
    b = wp.mesh_query_ray_count_intersections(mesh, point[i], wp.vec3(-0.7417, 0.5953, -0.3089)) & 1
    if a != b:
        a = wp.mesh_query_ray_count_intersections(mesh, point[i], wp.vec3(0.2293, -0.9437, 0.2389)) & 1
    inside_out[i] = wp.uint8(a)
