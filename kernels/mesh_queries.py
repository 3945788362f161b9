"""Triangle meshes: which triangle is nearest to a point, and whether the point lies inside, by Warp's tree of boxes."""

import warp as wp


@wp.kernel(enable_backward=False)
def find_nearest(
    first: int,
    mesh: wp.uint64,
    farthest: float,
    point: wp.array[wp.vec3],
    triangle_out: wp.array[int],
    inside_out: wp.array[wp.uint8],
):
    """The nearest triangle within `farthest`, -1 for none; inside is where the surface winds around a point.

    The winding number is that of Barill et al. (2018): far triangles are summed as dipoles.
    """
    i = first + wp.tid()
    found = wp.mesh_query_point_sign_winding_number(mesh, point[i], farthest)
    triangle_out[i] = wp.where(found.result, found.face, -1)
    inside_out[i] = wp.uint8(wp.where(found.result and found.sign < 0.0, 1, 0))
