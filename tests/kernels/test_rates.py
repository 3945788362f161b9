"""The pair loop as a whole: its halves, its layouts and the shortcuts that it takes when a term is off."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.rates import one_of_three, one_of_two

# Sums of some thirty terms that nearly cancel, in single precision and in any order: relative to the largest value.
TOLERANCE = 1e-5

FORMULAS = {"diffusion": "fourtakas", "tensile_correction": True, "xsph": True}


def assert_same(found: list[np.ndarray], expected: list[np.ndarray]) -> None:
    for a, b in zip(found, expected, strict=True):
        assert b.any()
        np.testing.assert_allclose(a, b, rtol=0, atol=TOLERANCE * np.abs(b).max())


def test_halves_make_the_whole(mixture):
    cloud = mixture(diffusion=0.1, xsph=0.5)
    whole = cloud.rates(**FORMULAS)
    momentum, continuity = cloud.rates(continuity=False, **FORMULAS), cloud.rates(momentum=False, **FORMULAS)
    assert_same([a + b for a, b in zip(momentum, continuity, strict=True)], whole)


def test_nothing_is_lost_in_the_plane(mixture):
    cloud = mixture(diffusion=0.1, xsph=0.5)
    assert_same(cloud.rates(dimensions=2, **FORMULAS), cloud.rates(dimensions=3, **FORMULAS))


def test_one_fluid_needs_no_look_at_its_neighbours(make_cloud, lattice):
    x = lattice(9, 9) * [1.0, 1.0, 0.9]
    p = 1000.0 * np.sin(7.0 * x[:, 0] + 3.0 * x[:, 2])
    cloud = make_cloud(x, u=np.cos(5.0 * x[:, ::-1]) * [1, 0, 1], p=p, fluid=1, diffusion=0.1, xsph=0.5)
    assert_same(cloud.rates(fluid_count=1, **FORMULAS), cloud.rates(fluid_count=0, **FORMULAS))


def test_numbers_of_two_fluids_are_those_looked_up(mixture):
    cloud = mixture(diffusion=0.1, xsph=0.5)
    assert_same(cloud.rates(fluid_count=2, **FORMULAS), cloud.rates(fluid_count=0, **FORMULAS))


@wp.kernel(enable_backward=False)
def choose_all(first: int, values: wp.array[float], two_out: wp.array[float], three_out: wp.array[float]):
    i = first + wp.tid()
    two_out[i] = one_of_two(values, wp.min(i, 1))
    three_out[i] = one_of_three(values, i)


def test_each_fluid_has_its_number(device):
    values = wp.array([5.0, 6.0, 7.0], dtype=float, device=device)
    two, three = (wp.zeros(3, dtype=float, device=device) for _ in range(2))
    wp.launch(choose_all, 3, [0, values, two, three], device=device)
    assert two.numpy().tolist() == [5.0, 6.0, 6.0]
    assert three.numpy().tolist() == [5.0, 6.0, 7.0]


def test_what_is_switched_off_is_zero(mixture):
    _, dissipative, _, diffusion, smoothed = mixture(diffusion=0.1, xsph=0.5, alpha=[0.0, 0.0]).rates()
    for rate in (dissipative, diffusion, smoothed):
        assert not rate.any()


@pytest.mark.parametrize("dimensions", [2, 3])
def test_coincident_particles_do_no_harm(make_cloud, dimensions):
    """Lists leave such pairs out; were one to come about between two listings, it has no direction and no force."""
    cloud = make_cloud([[0, 0, 0], [0, 0, 0], [0.1, 0, 0]], p=500.0, u=[[1, 0, 0], [0, 0, 1], [0, 0, 0]], diffusion=0.1)
    for rate in cloud.rates(dimensions=dimensions, **FORMULAS):
        assert np.isfinite(rate).all()


def test_nan_is_not_hidden(make_cloud, lattice):
    """The loop may reorder its sums but not pretend that every number is finite: the watch must see what broke."""
    x = lattice(5, 5)
    u = np.zeros_like(x)
    u[12] = np.nan
    _, dissipative, rate, _, _ = make_cloud(x, u=u).rates()
    assert np.isnan(dissipative[12]).any() and np.isnan(rate[12])
    assert np.isnan(rate[11])


def test_what_is_packed_is_the_same_memory(make_cloud, lattice):
    cloud = make_cloud(lattice(3, 3))
    packed = cloud.launcher.packed(cloud.position_volume)
    cloud.position_volume.fill_(wp.vec4(1.0, 2.0, 3.0, 4.0))
    np.testing.assert_array_equal(packed.numpy().view(np.float32).ravel()[:8], [1, 2, 3, 4, 1, 2, 3, 4])
