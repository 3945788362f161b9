"""What passes a gate, by hand; and the sums of probes, whose first-order fit is exact for a linear field."""

import numpy as np
import pytest
import warp as wp

from warpsph.device.blocks import blocks_of
from warpsph.device.cells import Cells, cell_grid
from warpsph.kernels.instruments import SUMS, Gates, add_passed, count_passing, find_tops, probe_kernel
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.measure.instruments import fitted


@pytest.fixture
def cloud(make_cloud, lattice):
    """A jittered patch of particles, 1.9 m square, with linear pressure and velocity."""
    x = lattice(19, 19) + np.random.default_rng(4).uniform(-0.02, 0.02, (361, 3)) * [1.0, 0.0, 1.0]
    return make_cloud(x, u=np.stack([1.0 + 2.0 * x[:, 2], 0.0 * x[:, 0], 3.0 * x[:, 0]], axis=1))


def sorted_cells(cloud):
    """Cells over a cloud, and the order of its particles by them."""
    grid = cell_grid(cloud.x.min(axis=0), cloud.x.max(axis=0), cloud.parameters.list_radius, 2, len(cloud.x))
    cells = Cells(grid, cloud.array(cloud.x, wp.vec3), cloud.launcher)
    cells.sort()
    return grid, cells, cells.order.numpy()[: len(cloud.x)]


@pytest.mark.parametrize("normal", [(0.0, 0.0, 0.0), (0.0, 0.0, -1.0)], ids=["all around", "below"])
def test_a_linear_velocity_is_read_exactly(cloud, normal):
    grid, cells, order = sorted_cells(cloud)
    points = np.array([[0.0, 0.0, 0.0], [0.31, 0.0, 0.27], [0.95, 0.0, 0.2], [0.95, 0.0, 0.95]])  # an edge, a corner
    device, reach = cloud.launcher.device, SMOOTHING["wendland_c2"].support * cloud.h
    sums = wp.zeros((len(points), SUMS), dtype=float, device=device)
    arrays = [cloud.array(points, wp.vec3), cloud.array(np.tile(normal, (len(points), 1)), wp.vec3)]
    arrays += [cloud.array(cloud.position_volume.numpy()[order], wp.vec4), cloud.array(cloud.u[order], wp.vec3)]
    arrays += [
        wp.array(cloud.rho[order], dtype=wp.float64, device=device),
        wp.array(cloud.fluid[order].astype(np.int32), dtype=int, device=device),
    ]
    cloud.launcher.record_in_order(
        probe_kernel("wendland_c2"), len(points), [grid, cloud.parameters, reach, cells.start, *arrays, sums]
    )()
    values = fitted(sums.numpy(), 2)
    np.testing.assert_allclose(values[:, 1], 1.0 + 2.0 * points[:, 2], atol=2e-3)
    np.testing.assert_allclose(values[:, 3], 3.0 * points[:, 0], atol=2e-3)


def test_the_top_over_a_place_is_that_of_the_fluid(cloud):
    """The highest particle near the line; one that has left does not count."""
    grid, cells, order = sorted_cells(cloud)
    fluid = np.zeros(len(order), dtype=np.int32)
    across, place = 0.3, cloud.array(np.array([[0.2, 0.0, 0.0], [5.0, 0.0, 0.0]]), wp.vec3)
    near = np.abs(cloud.x[order][:, 0] - 0.2) < across
    highest = np.argmax(np.where(near, cloud.x[order][:, 2], -np.inf))
    tops = wp.zeros(2, dtype=float, device=cloud.launcher.device)
    volumes = cloud.array(cloud.position_volume.numpy()[order], wp.vec4)
    for gone in (False, True):
        fluid[highest] = int(gone)
        codes = wp.array(fluid, dtype=int, device=cloud.launcher.device)
        cloud.launcher.record_in_order(
            find_tops, 2, [grid, across, across, 1, cells.start, place, volumes, codes, tops]
        )()
        left = near & (fluid == 0)
        np.testing.assert_allclose(tops.numpy(), [cloud.x[order][left, 2].max(), -np.inf], rtol=1e-6)


def test_what_passes_a_gate_by_hand(cloud):
    """Over, back, beside, along, and one that has left; blocks of a few."""
    device = cloud.launcher.device
    old = np.array([[-1.0, 0, 0.5], [1.0, 0, 0.5], [-1.0, 0, 1.5], [-1.0, 0, 0.1], [-1.0, 0, 0.5]], float)
    new = np.array([[1.0, 0, 0.6], [-1.0, 0, 0.4], [1.0, 0, 1.5], [-0.5, 0, 0.9], [1.0, 0, 0.5]], float)
    fluid = wp.array(np.array([0, 0, 0, 0, 2], np.int32), dtype=int, device=device)
    gates = Gates()
    gates.count = 1
    for name, value in {"corner": [0, 0, 0], "along": [0, 0, 1], "up": [0, 1, 0], "normal": [1, 0, 0]}.items():
        setattr(gates, name, wp.array(np.array([value], float), dtype=wp.vec3d, device=device))
    V = float(cloud.parameters.mass.numpy()[0] / cloud.parameters.rest_density.numpy()[0])
    blocks, number = blocks_of(2, device)
    passed = wp.zeros((number, 1), dtype=wp.float64, device=device)
    volume = wp.array([0.5], dtype=wp.float64, device=device)
    for count, expected in ((1, 0.5 + V), (2, 0.5 + V), (5, 0.5 + V)):
        blocks.count = count
        places = [wp.array(rows, dtype=wp.vec3d, device=device) for rows in (new, old)]
        cloud.launcher.record_in_order(
            count_passing, number, [cloud.parameters, blocks, gates, 2, *places, fluid, passed]
        )()
        assert passed.numpy().sum() == pytest.approx(V if count == 1 else 0.0, abs=1e-12)
        cloud.launcher.record_in_order(add_passed, 1, [number, passed, volume])()
        assert volume.numpy()[0] == pytest.approx(expected)
