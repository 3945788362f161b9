"""Pictures: particles as discs, painted into the pixels of a frame."""

import warp as wp


@wp.kernel(enable_backward=False)
def paint_discs(
    first: int,
    count: int,
    radius: float,
    width: int,
    lower: wp.vec2i,
    upper: wp.vec2i,
    center: wp.array2d[wp.vec2],
    color: wp.array2d[wp.vec3],
    pixels_inout: wp.array2d[wp.vec4ub],
):
    """`count` discs of one radius in each picture, one after the other: later ones lie over earlier ones.

    Of a picture `width` pixels wide the pixel in row r and column c, whose centre is at (c + 1/2, r + 1/2), is entry
    r width + c: red, green, blue, and one more byte that is left alone. A disc covers that share of a pixel on its rim
    to which it reaches past the pixel's centre, as if the pixel were a short ray. Columns and rows from `lower` up to
    `upper`, that one excluded, are painted. A centre that is not a number paints nothing.
    """
    picture = first + wp.tid()
    rim = radius + 0.5
    for i in range(count):
        at, paint = center[picture, i], color[picture, i]
        x = wp.clamp(at[0], float(lower[0]) - rim, float(upper[0]) + rim)
        y = wp.clamp(at[1], float(lower[1]) - rim, float(upper[1]) + rim)
        if x == at[0] and y == at[1]:
            for r in range(wp.max(int(wp.floor(y - rim)), lower[1]), wp.min(int(wp.ceil(y + rim)), upper[1])):
                for c in range(wp.max(int(wp.floor(x - rim)), lower[0]), wp.min(int(wp.ceil(x + rim)), upper[0])):
                    off = wp.vec2(float(c) + 0.5 - x, float(r) + 0.5 - y)
                    share = wp.clamp(rim - wp.length(off), 0.0, 1.0)
                    pixel = pixels_inout[picture, r * width + c]
                    for k in range(3):
                        under = float(pixel[k])
                        pixel[k] = wp.uint8(under + share * (paint[k] - under) + 0.5)
                    pixels_inout[picture, r * width + c] = pixel


# The way to the light, on the left, above and before the picture: along columns, along rows (downwards) and to the eye.
LIGHT = wp.constant(wp.normalize(wp.vec3(-0.45, -0.65, 0.75)))


@wp.kernel(enable_backward=False)
def paint_spheres(
    first: int,
    count: int,
    width: int,
    lower: wp.vec2i,
    upper: wp.vec2i,
    center: wp.array2d[wp.vec2],
    radius: wp.array2d[float],
    color: wp.array2d[wp.vec3],
    pixels_inout: wp.array2d[wp.vec4ub],
):
    """`count` lit spheres in each picture, as `paint_discs` does it: each disc has its radius, and is shaded.

    A pixel has the colour of the disc times 0.5 + 0.6 max(n . l, 0), at most white, where n is the normal of the sphere
    there and l the way to the light (Lambert's cosine law, with ambient light).
    """
    picture = first + wp.tid()
    for i in range(count):
        at, paint, r_disc = center[picture, i], color[picture, i], radius[picture, i]
        rim = r_disc + 0.5
        x = wp.clamp(at[0], float(lower[0]) - rim, float(upper[0]) + rim)
        y = wp.clamp(at[1], float(lower[1]) - rim, float(upper[1]) + rim)
        if x == at[0] and y == at[1]:
            for r in range(wp.max(int(wp.floor(y - rim)), lower[1]), wp.min(int(wp.ceil(y + rim)), upper[1])):
                for c in range(wp.max(int(wp.floor(x - rim)), lower[0]), wp.min(int(wp.ceil(x + rim)), upper[0])):
                    off = wp.vec2(float(c) + 0.5 - x, float(r) + 0.5 - y)
                    share = wp.clamp(rim - wp.length(off), 0.0, 1.0)
                    n = off / rim
                    n_eye = wp.sqrt(wp.max(1.0 - wp.dot(n, n), 0.0))
                    lit = 0.5 + 0.6 * wp.max(wp.dot(wp.vec3(n[0], n[1], n_eye), LIGHT), 0.0)
                    pixel = pixels_inout[picture, r * width + c]
                    for k in range(3):
                        under = float(pixel[k])
                        pixel[k] = wp.uint8(under + share * (wp.min(lit * paint[k], 255.0) - under) + 0.5)
                    pixels_inout[picture, r * width + c] = pixel
