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
