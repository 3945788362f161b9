"""Block sums of energy, momentum and place against NumPy's, fluid by fluid."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels import energy

# Sums in double precision of masses and velocities in single.
TOLERANCE = 1e-6
GRAVITY = 9.81
BLOCK, FLUIDS = 64, 2


@pytest.fixture(params=[False, True], ids=["runs", "interleaved"])
def summed(make_cloud, make_blocks, request):
    """A cloud of two fluids with its density and work, and the sums of all its blocks, [fluid, column]."""
    random, n = np.random.default_rng(8), 200  # three whole blocks and a short one
    x = random.uniform(-2, 2, (n, 3)) * [1, 0, 1]
    fluid = (random.uniform(size=n) > 0.6).astype(np.int32)
    density = np.array([1000.0, 2530.0])[fluid] * random.uniform(0.97, 1.03, n)
    cloud = make_cloud(x, u=random.normal(size=(n, 3)), rho=density, fluid=fluid, stiffening=[1.0, 0.0])
    work = random.uniform(size=(4, 3))
    rows = 4 * FLUIDS
    sums = wp.zeros((rows, energy.COLUMN_COUNT), dtype=wp.float64, device=cloud.launcher.device)
    arrays = [
        *(cloud.array(cloud.x, wp.vec3d), cloud.array(cloud.u, wp.vec3), cloud.array(density, wp.float64)),
        *(cloud.array(work, wp.vec3d), cloud.fluids, sums),
    ]
    in_blocks = make_blocks(n, BLOCK, request.param)
    cloud.launcher.record_in_order(energy.sum_blocks, rows, [cloud.parameters, in_blocks, FLUIDS, *arrays])()
    blocks = sums.numpy().reshape(4, FLUIDS, energy.COLUMN_COUNT)
    return cloud, density, work, blocks


def test_sums_of_each_fluid(summed):
    cloud, density, _, blocks = summed
    for index in range(FLUIDS):
        mine, row = cloud.fluid == index, blocks[:, index].sum(axis=0)
        m, x, u = cloud.m[mine], cloud.x[mine], cloud.u[mine]
        s = density[mine] / (1000.0, 2530.0)[index] - 1
        # Vasco (2014) eq 56 and 57, integrated: e = integral of p / rho^2 d rho.
        tait = 20.0**2 / 7 * ((1 + s) ** 6 / 6 + 1 / (1 + s) - 7 / 6)
        linear = 30.0**2 * (np.log1p(s) - s / (1 + s))
        expected = {
            energy.MASS: m.sum(),
            energy.KINETIC: 0.5 * m @ (u * u).sum(axis=1),
            energy.POTENTIAL: GRAVITY * m @ x[:, 2],
            energy.INTERNAL: m @ (tait, linear)[index],
        }
        for column, total in expected.items():
            assert row[column] == pytest.approx(total, rel=TOLERANCE, abs=TOLERANCE * np.abs(m).sum())
        for first, vector in ((energy.MASS_X, x), (energy.MASS_U, u)):
            found = row[int(first) : int(first) + 3]
            np.testing.assert_allclose(found, m @ vector, rtol=0, atol=TOLERANCE * (m @ np.abs(vector)).max())
        assert blocks[:, index, energy.FRONT].max() == x[:, 0].max()
        fastest = np.linalg.norm(u, axis=1).max()
        assert blocks[:, index, energy.TOP_SPEED].max() == pytest.approx(fastest, rel=TOLERANCE)


def test_work_is_counted_once(summed):
    """It belongs to blocks, not to fluids, and is booked under the first."""
    _, _, work, blocks = summed
    columns = [energy.DISSIPATED, energy.WALL_WORK, energy.DAMPED]
    np.testing.assert_allclose(blocks[:, 0, columns].sum(axis=0), work.sum(axis=0), rtol=1e-12)
    assert not blocks[:, 1, columns].any()


def test_a_fluid_that_is_not_there(make_cloud, make_blocks):
    """Its sums are zero, and it has no front."""
    cloud = make_cloud([[1.0, 0.0, 2.0]])
    sums = wp.zeros((2, energy.COLUMN_COUNT), dtype=wp.float64, device=cloud.launcher.device)
    zero = cloud.array(np.zeros((1, 3)), wp.vec3d)
    density = cloud.array([1000.0], wp.float64)
    arrays = [zero, cloud.array(np.zeros((1, 3)), wp.vec3), density, zero, cloud.fluids, sums]
    cloud.launcher.record_in_order(energy.sum_blocks, 2, [cloud.parameters, make_blocks(1, BLOCK), 2, *arrays])()
    row = sums.numpy()[1]
    assert row[energy.FRONT] == -np.inf
    assert not np.delete(row, energy.FRONT).any()
