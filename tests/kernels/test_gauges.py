"""The volume fraction that gauges look for: full inside, half on the surface, nothing far away."""

import numpy as np
import pytest
import warp as wp

from warpsph.device.cells import Cells, cell_grid
from warpsph.kernels.gauges import volume_fraction_kernel
from warpsph.kernels.smoothing import SMOOTHING

# What a lattice at h = 1.5 dx makes of the integral of W; single precision is far below.
LATTICE = 0.006

pytestmark = pytest.mark.parametrize("smoothing", SMOOTHING)


@pytest.fixture
def fraction_at(make_cloud):
    """A function that gives the volume fraction at `points` [m], shape [k, 3], among particles at `x`, shape [n, 3]."""

    def measure(smoothing: str, x: np.ndarray, points: np.ndarray) -> np.ndarray:
        cloud = make_cloud(x, smoothing=smoothing)
        position = cloud.array(cloud.x, wp.vec3)
        grid = cell_grid(cloud.x.min(axis=0), cloud.x.max(axis=0), cloud.parameters.list_radius, 2, len(cloud.x))
        cells = Cells(grid, position, cloud.launcher)
        cells.sort()
        order = cells.order.numpy()[: len(cloud.x)]
        volumes = cloud.array(cloud.position_volume.numpy()[order], wp.vec4)
        points = cloud.array(points, wp.vec3)
        fraction = wp.zeros(len(points), dtype=float, device=cloud.launcher.device)
        reach = SMOOTHING[smoothing].support * cloud.h
        arguments = [grid, cloud.parameters, reach, cells.start, points, volumes, fraction]
        cloud.launcher.record_in_order(volume_fraction_kernel(smoothing), len(points), arguments)()
        return fraction.numpy()

    return measure


def test_full_inside_half_on_the_surface(fraction_at, lattice, smoothing):
    """Rows at half a spacing from the surface, which is 0.95 m above the middle."""
    x = lattice(19, 19)
    inside = [[a, 0.0, b] for a in (0.0, 0.05, 0.02) for b in (0.0, 0.05, 0.03)]
    np.testing.assert_allclose(fraction_at(smoothing, x, inside), 1.0, rtol=0, atol=LATTICE)
    surface = [[a, 0.0, 0.95] for a in (0.0, 0.02, 0.05)]
    np.testing.assert_allclose(fraction_at(smoothing, x, surface), 0.5, rtol=0, atol=LATTICE)


def test_falls_through_the_surface(fraction_at, lattice, smoothing):
    heights = np.linspace(0.5, 1.6, 40)
    fraction = fraction_at(smoothing, lattice(19, 19), np.insert(np.zeros((40, 2)), 2, heights, axis=1))
    assert np.all(np.diff(fraction) < LATTICE)
    assert fraction[-1] == 0.0


def test_is_the_sum_over_all_particles(fraction_at, make_cloud, lattice, smoothing):
    """Against NumPy's sum: a particle at each point, with a volume too small to count, gives its W."""
    x = lattice(9, 9) * [1.07, 1, 0.95]
    points = np.random.default_rng(9).uniform(-0.8, 0.8, (60, 3)) * [1, 0, 1]
    both = make_cloud(np.concatenate([x, points]), smoothing=smoothing)
    expected = both.W[len(x) :, : len(x)] @ both.V[: len(x)]
    np.testing.assert_allclose(fraction_at(smoothing, x, points), expected, rtol=0, atol=1e-5)
