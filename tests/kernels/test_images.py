"""The velocity that friction sees at a ghost."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.images import Images, velocity_beyond
from warpsph.placement.images import find_images, image_struct

# Single precision.
TOLERANCE = 1e-6

SCENE = """
title: A mirror
spacing: 0.05
materials: {water: {density: 1000.0, sound_speed: 20.0}}
images: [{name: floor, mirror: {point: [0, 0.5], normal: [0, 1], velocity_rule: RULE}}]
fluids: [{name: water, material: water, shape: {box: {min: [0, 0.5], max: [1, 1]}}}]
run: {end_time: 1.0}
"""


@wp.kernel(enable_backward=False)
def ask(first: int, images: Images, x_j: wp.array[wp.vec3], u_out: wp.array[wp.vec3]):
    i = first + wp.tid()
    u_out[i] = velocity_beyond(
        images, 0, wp.vec3(0.0, 0.0, 0.6), wp.vec3(1.0, 0.0, 0.5), x_j[i], wp.vec3(3.0, 0.0, -2.0)
    )


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("free_slip", [[3.0, 0.0, 2.0]] * 3),
        ("no_slip_opposite, velocity: [0.2, 0]", [[-2.6, 0.0, 2.0]] * 3),
        ("no_slip_wall, velocity: [0.2, 0]", [[0.2, 0.0, 0.0]] * 3),
        # d_j / d_i is 0, 0.3 and, limited to 0.5, 2.
        ("takeda, velocity: [0.2, 0]", [[0.2, 0.0, 0.0], [0.2 - 0.3 * 0.8, 0.0, -0.15], [-0.2, 0.0, -0.25]]),
    ],
)
def test_velocity_rules(make_scene, device, rule, expected):
    """Particle i is 0.1 m above the floor, the sources of the ghosts 0, 0.03 and 0.2 m."""
    scene = make_scene(SCENE.replace("RULE", rule))
    edges, found = find_images(scene, 0.2, np.array([0.0, 0.0, 0.5]), np.array([1.0, 0.0, 1.0]))
    x_j = wp.array([(0.0, 0.0, 0.5), (0.0, 0.0, 0.53), (0.0, 0.0, 0.7)], dtype=wp.vec3, device=device)
    u = wp.zeros(3, dtype=wp.vec3, device=device)
    wp.launch(ask, 3, [0, image_struct(edges, found, u.device), x_j, u], device=device)
    np.testing.assert_allclose(u.numpy(), expected, atol=TOLERANCE)
