"""Discs in pixels: as large as they should be, where they should be, one over the other."""

import math

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.pictures import paint_discs, paint_spheres

# A pixel on the rim is covered as a ray is, not as a square: so far off may an area be, and a place [px] 5 times that.
COVERAGE = 0.01

WHITE = 255


def painted(center, color, radius, lower=(0, 0), upper=(40, 30)):
    """The channels of a white picture, 40 pixels wide and 30 high, in which discs have been painted."""
    pixels = np.full((30, 40, 4), WHITE, dtype=np.uint8)
    center, color, picture = (
        wp.array(values, dtype=dtype, device="cpu", copy=False)
        for values, dtype in (
            (np.float32([center]), wp.vec2),
            (np.float32([color]), wp.vec3),
            (pixels.reshape(1, -1, 4), wp.vec4ub),
        )
    )
    inputs = [0, center.shape[1], radius, 40, wp.vec2i(*lower), wp.vec2i(*upper), center, color, picture]
    wp.launch(paint_discs, dim=1, inputs=inputs, device="cpu")
    return pixels


@pytest.mark.parametrize("radius", [1.5, 2.5, 7.3])
@pytest.mark.parametrize("center", [(20.5, 15.5), (20.0, 15.0), (19.37, 14.81)])
def test_a_disc_has_its_area_and_place(center, radius):
    pixels = painted([center], [(0.0, 0.0, 0.0)], radius)
    share = 1.0 - pixels[:, :, 0] / WHITE
    # A rim that is a pixel wide and as dark as a ramp adds its second moment to the area.
    area = math.pi * (radius**2 + 1.0 / 12.0)
    assert share.sum() == pytest.approx(area, rel=COVERAGE)
    rows, columns = np.indices(share.shape) + 0.5
    assert (share * columns).sum() / share.sum() == pytest.approx(center[0], abs=5 * COVERAGE)
    assert (share * rows).sum() / share.sum() == pytest.approx(center[1], abs=5 * COVERAGE)
    assert (pixels[:, :, 3] == WHITE).all()


def test_the_last_disc_lies_on_top():
    pixels = painted([(15.0, 15.0), (17.0, 15.0)], [(250.0, 0.0, 0.0), (0.0, 9.0, 250.0)], 4.0)
    assert tuple(pixels[15, 12, :3]) == (250, 0, 0)
    assert tuple(pixels[15, 17, :3]) == tuple(pixels[15, 14, :3]) == (0, 9, 250)


def test_nothing_is_painted_outside_the_box():
    center = [(4.0, 4.0), (0.0, 15.0), (39.0, 29.0), (-50.0, 1e9), (math.nan, 3.0), (math.inf, 3.0)]
    pixels = painted(center, [(0.0, 0.0, 0.0)] * len(center), 3.0, (4, 4), (36, 26))
    dark = (pixels[:, :, 0] < WHITE).nonzero()
    assert len(dark[0]) > 0
    assert dark[0].min() >= 4 and dark[1].min() >= 4 and dark[0].max() < 26 and dark[1].max() < 36
    assert (pixels[20:, :] == WHITE).all()


def test_spheres_are_lit_from_above_on_the_left_and_have_their_own_radius():
    pixels = np.full((30, 40, 4), WHITE, dtype=np.uint8)
    arrays = (
        (np.float32([[(10.5, 15.5), (28.5, 15.5)]]), wp.vec2),
        (np.float32([[8.0, 4.0]]), wp.float32),
        (np.float32([[(100.0, 100.0, 100.0)] * 2]), wp.vec3),
        (pixels.reshape(1, -1, 4), wp.vec4ub),
    )
    seen = [wp.array(values, dtype=dtype, device="cpu", copy=False) for values, dtype in arrays]
    inputs = [0, 2, 40, wp.vec2i(0, 0), wp.vec2i(40, 30), *seen]
    wp.launch(paint_spheres, dim=1, inputs=inputs, device="cpu")
    shade = pixels[:, :, 0].astype(int)
    covered = shade < WHITE
    assert covered[:, :20].sum() == pytest.approx(math.pi * 8.5**2, rel=0.05)
    assert covered[:, 20:].sum() == pytest.approx(math.pi * 4.5**2, rel=0.1)
    assert shade[11, 6] > shade[15, 10] > shade[20, 15] >= 49  # towards the light, at the eye, in the shade
