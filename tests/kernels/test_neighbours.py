"""Neighbour lists against a search of all pairs, and the order that particles are brought into."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from warpsph.device.launch import Launcher
from warpsph.kernels import neighbours as kernels
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.model import SKIN, Model
from warpsph.placement.place import place
from warpsph.schemes.weakly_compressible import WeaklyCompressible
from warpsph.state import State
from warpsph.step.neighbours import MOST_LONG, Neighbours

# A pair whose distance is within this of the list's radius, relatively, may be on the list or not: rounding decides.
TOLERANCE = 1e-6

SCENE = """
title: Points
dimensions: 2
spacing: 0.1
materials: {water: {density: 1000.0, sound_speed: 100.0}}
walls: [{name: wall, path: [[-1.0, -0.5], [0.5, -0.5], [1.0, 0.5]]}]
wall_model: {force: radial, set_back: 0.0}
smoothing: {kernel: wendland_c2, ratio: 1.5}
fluids: [{name: water, material: water, shape: {box: {min: [0.0, 1.0], max: [0.2, 1.2]}}}]
run: {end_time: 1.0}
"""
REACH = 2.0 * 0.15 * (1.0 + SKIN)  # of a list [m]


class Listed:
    """Lists that were built once for particles at `x` [m], shape [n, 3]."""

    def __init__(
        self, scene, device: str, x: np.ndarray, capacity: int | None = None, later: np.ndarray | None = None
    ) -> None:
        """The last of them are brought to `later` [m] only after the model was made for `x`."""
        self.x, n = x, len(x)
        placement = replace(
            place(scene),
            position=x,
            velocity=np.arange(3.0 * n).reshape(n, 3),
            fluid=np.zeros(n, np.int32),
            initial_depth=np.zeros(n),
        )
        self.model = Model(scene, placement, Launcher(device))
        if capacity:
            self.model.parameters.list_capacity = capacity
        self.state = State(self.model, WeaklyCompressible.fields)
        if later is not None:
            self.x = np.concatenate([x[: n - len(later)], later])
            self.state.position.assign(self.x)
        self.neighbours = Neighbours(self.model, self.state)
        self.grew = self.neighbours.rebuild()

    @property
    def id(self) -> np.ndarray:
        """Identity of the particle in each slot, shape [n]."""
        return self.state.id.numpy()

    def pairs(self) -> np.ndarray:
        """Whether j is on the list of i, by identity, bool [n, n]; no entry twice."""
        count, entries = self.neighbours.neighbour_count.numpy(), self.neighbours.rows()
        assert count.max() < entries.shape[1]
        found = np.zeros((len(self.x), len(self.x)), dtype=int)
        for i, id_i in enumerate(self.id):
            row = entries[i, : count[i]]
            np.add.at(found[id_i], self.id[row], 1)
        assert found.max() <= 1
        return found == 1

    def wall_pairs(self) -> np.ndarray:
        """Whether wall point k is on the list of i, by identity, bool [n, wall_count]; no entry twice."""
        first, entries = self.neighbours.wall_first.numpy(), self.neighbours.wall_list.numpy()
        found = np.zeros((len(self.x), len(self.model.wall_position)), dtype=int)
        for i, id_i in enumerate(self.id):
            np.add.at(found[id_i], entries[first[i] : first[i + 1]], 1)
        assert found.max() <= 1
        return found == 1


@pytest.fixture
def listed(make_scene, device):
    """A function that lists the neighbours of points `x` [m], shape [n, 3], at a spacing of 0.1 m."""
    return lambda x, *overrides, **fields: Listed(make_scene(SCENE, *overrides), device, np.asarray(x), **fields)


@pytest.fixture
def listed_without_walls(make_scene, device):
    """The same with nothing but the particles."""
    scene = make_scene(SCENE, "walls=[]")
    return lambda x: Listed(scene, device, np.asarray(x))


def cloud(count: int, low: tuple[float, float], high: tuple[float, float], seed: int = 0) -> np.ndarray:
    return np.insert(np.random.default_rng(seed).uniform(low, high, (count, 2)), 1, 0.0, axis=1)


def assert_lists(found: np.ndarray, x: np.ndarray, others: np.ndarray, reach: float = REACH) -> None:
    """`found` [n, k] holds exactly the pairs of `x` [n, 3] and `others` [k, 3] that are closer than `reach` [m]."""
    distance = np.linalg.norm(x.astype(np.float32).astype(float)[:, None] - others.astype(np.float32), axis=2)
    if others is x:
        np.fill_diagonal(distance, np.inf)
    clear = np.abs(distance / reach - 1.0) > TOLERANCE
    assert np.any(found)
    np.testing.assert_array_equal(found[clear], (distance < reach)[clear])


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((-1.5, -1.5), (1.5, 1.5)),
        ((-5.0, -2.0), (-4.0, 1.0)),
        ((-0.1, -6.0), (0.1, 6.0)),
        ((900.0, 40.0), (903.0, 41.0)),
    ],
    ids=["around the origin", "left of it", "upright", "far away"],
)
def test_lists_are_those_of_a_search_of_all_pairs(listed, low, high):
    x = cloud(400, low, high)
    assert_lists(listed(x).pairs(), x, x)


def test_what_is_outside_the_cells_is_listed_too(listed):
    """The cells hold the scene and some room around it; whatever has gone farther counts to the outermost ones."""
    far = [cloud(60, (x, z), (x + 1.0, z + 1.0)) for x, z in ((-90.0, 0.0), (40.0, -70.0), (0.0, 500.0), (1e6, 0.0))]
    made = listed(cloud(400, (-1.0, -1.0), (1.0, 1.0)), later=np.concatenate(far))
    assert_lists(made.pairs(), made.x, made.x)


def test_a_cloud_so_wide_that_cells_are(listed):
    x = np.concatenate([cloud(800, (-200.0, -30.0), (200.0, 30.0)), cloud(400, (-130.0, 0.0), (130.0, 0.2))])
    made = listed(x)
    assert 1.0 / made.model.grid.inverse_edge > 1.5 * REACH  # half of it where there is room
    assert_lists(made.pairs(), x, x)


@pytest.mark.parametrize("kernel", SMOOTHING)
def test_lists_reach_beyond_the_support(listed, kernel):
    made = listed(cloud(300, (-1.5, -1.5), (1.5, 1.5)), f"smoothing.kernel={kernel}")
    reach = SMOOTHING[kernel].support * 0.15 * (1.0 + SKIN)
    assert made.model.parameters.list_radius == pytest.approx(reach)
    assert made.model.skin == pytest.approx(reach - SMOOTHING[kernel].support * 0.15)
    assert_lists(made.pairs(), made.x, made.x, reach)


def test_wall_points_on_the_lists(listed):
    made = listed(cloud(300, (-1.5, -1.0), (1.5, 1.0)))
    assert_lists(made.wall_pairs(), made.x, made.model.wall_position.numpy(), made.model.wall_radius)


def test_wall_list_grows(listed):
    """It begins with room for 1024 entries."""
    made = listed(cloud(600, (-1.0, -0.7), (0.5, -0.3)))
    assert made.grew and made.neighbours.wall_first.numpy()[-1] > 1024
    assert_lists(made.wall_pairs(), made.x, made.model.wall_position.numpy(), made.model.wall_radius)
    assert not made.neighbours.rebuild()


def test_rows_grow(listed):
    x = cloud(400, (-1.5, -1.5), (1.5, 1.5))
    made = listed(x, capacity=4)
    assert made.grew and made.model.parameters.list_capacity > 4
    assert_lists(made.pairs(), x, x)
    assert not made.neighbours.rebuild()
    assert_lists(made.pairs(), x, x)


@pytest.mark.parametrize(("crowd", "longer"), [(5, 2), (30, 4)], ids=["once", "twice"])
def test_rows_grow_for_the_few_that_are_too_short(listed, crowd, longer):
    """A few particles crowd together: their rows alone are longer, again where that was not enough."""
    side = 0.15 * np.arange(28.0)  # 12 neighbours
    x, z = (line.ravel() for line in np.meshgrid(side, side))
    crowded = np.linspace(2.01, 2.03, crowd)
    x, z = np.append(x, crowded), np.append(z, 0.7 * crowded)
    x = np.column_stack([x, np.zeros(len(x)), z])
    made = listed(x, capacity=14)
    rows = made.neighbours.neighbour_list
    assert made.grew and made.model.parameters.list_capacity == 14
    assert 0 < (rows.long_row.numpy() >= 0).sum() <= len(x) // MOST_LONG
    assert rows.long_capacity == longer * 14
    assert_lists(made.pairs(), x, x)
    assert not made.neighbours.rebuild(), "what has grown is kept"
    assert_lists(made.pairs(), x, x)
    made.state.position.assign(np.linspace(0.0, 100.0, len(x))[:, None] * [1.0, 0.0, 0.0])
    assert not made.neighbours.rebuild()
    assert (rows.long_row.numpy() < 0).all(), "nobody needs a longer one now"


def test_particles_move_slots_whole(listed):
    """Ids are a permutation, and what belongs to a particle goes with its id."""
    x = cloud(500, (-3.0, -3.0), (3.0, 3.0))
    made = listed(x)
    np.testing.assert_array_equal(np.sort(made.id), np.arange(500))
    assert np.any(made.id != np.arange(500))
    np.testing.assert_array_equal(made.state.position.numpy(), x[made.id])
    np.testing.assert_array_equal(made.state.velocity.numpy(), np.arange(1500.0).reshape(500, 3)[made.id])
    np.testing.assert_array_equal(made.neighbours.state.listed_position.numpy(), x[made.id].astype(np.float32))


def test_slots_of_a_cell_lie_together(listed):
    made = listed(cloud(500, (-3.0, -3.0), (3.0, 3.0)))
    grid = made.model.grid
    axes = list(grid.axes)
    offset = made.state.listed_position.numpy()[:, axes] - np.array(grid.origin)
    cell = np.clip(np.floor(offset * grid.inverse_edge), 0, np.array(grid.inner) - 1).astype(int) + np.array(grid.reach)
    number = (cell[:, 2] * grid.count[1] + cell[:, 1]) * grid.count[0] + cell[:, 0]
    assert np.all(np.diff(number) >= 0)
    start = made.neighbours.cells.start.numpy()
    np.testing.assert_array_equal(start, np.searchsorted(number, np.arange(len(start))))


def test_sorting_what_is_sorted_changes_nothing(listed):
    made = listed(cloud(500, (-3.0, -3.0), (3.0, 3.0)))
    before, entries = made.id.copy(), made.neighbours.rows().copy()
    made.neighbours.rebuild()
    np.testing.assert_array_equal(made.id, before)
    np.testing.assert_array_equal(made.neighbours.rows(), entries)


# ------------------------------------------------------------------------------------------------ life of the lists


def strain(made: Listed, moved: np.ndarray, velocity: float = 0.0, lookahead: float = 0.0) -> float:
    """The largest strain after the particles moved by `moved` [m], shape [n, 3], listed by id."""
    state, model, n = made.state, made.model, len(made.x)
    new = state.listed_position.numpy() + moved[made.id]
    volumes = np.column_stack([new, np.ones(n)])
    state.position_volume.assign(volumes.astype(np.float32))
    state.velocity.assign(np.tile(np.float32([velocity, 0.0, 0.0]), (n, 1)))
    state.dt.fill_(1.0)
    launcher, blocks = model.launcher, state.cell_block_count
    arrays = [state.acceleration, state.listed_position, state.motion_lower, state.motion_upper]
    packed = [made.neighbours.cells.start, state.dt, state.position_volume, state.velocity]
    launcher.record_in_order(kernels.bound_motion, blocks, [model.grid, lookahead, *packed, *arrays])()
    walls = [model.skin, model.wall_skin, model.support, model.wall_block]
    bounds = [model.grid, *walls, state.motion_lower, state.motion_upper, state.strain]
    launcher.record_in_order(kernels.compare_motion, blocks, bounds)()
    return float(state.strain.numpy().max())


def test_what_moves_as_a_whole_needs_no_new_list(listed_without_walls):
    """Until it has gone so far that it might meet what is not near it now."""
    made = listed_without_walls(cloud(400, (-1.5, -1.5), (1.5, 1.5)))
    together = np.tile([3.0 * made.model.skin, 0.0, -2.0 * made.model.skin], (400, 1))
    assert 0.0 < strain(made, together) < 1.0
    assert strain(made, 20.0 * together) > 1.0


def test_strain_is_the_relative_motion_over_the_skin(listed_without_walls):
    """Two particles a list radius apart, one of which moves by a share of the skin."""
    made = listed_without_walls(np.array([[0.0, 0.0, 0.0], [REACH, 0.0, 0.0]]))
    moved = np.array([[0.7 * made.model.skin, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert strain(made, moved) == pytest.approx(0.7, rel=1e-4)


def test_strain_looks_ahead(listed_without_walls):
    """A step and a half on, but what moves together still moves together then."""
    made = listed_without_walls(np.array([[0.0, 0.0, 0.0]]))
    still, longest = np.zeros((1, 3)), made.model.longest_motion
    assert strain(made, still, velocity=0.5 * longest) == 0.0
    assert strain(made, still, velocity=0.5 * longest, lookahead=1.5) == pytest.approx(0.75, rel=1e-4)


def test_walls_stand_still(listed):
    """What moves as a whole along or towards a wall needs the wall points there in time."""
    made = listed(np.array([[0.0, 0.0, -0.2], [0.1, 0.0, -0.2]]))
    together = np.tile([0.7 * made.model.wall_skin, 0.0, 0.0], (2, 1))
    assert strain(made, together) == pytest.approx(0.7, rel=1e-4)


@pytest.mark.parametrize("seed", range(8))
def test_no_pair_is_missing_while_strain_is_below_one(listed, seed):
    """Whatever the motion: of each particle by itself, as a shear, as a whole."""
    made = listed(cloud(500, (-1.5, -1.5), (1.5, 1.5), seed))
    random, skin = np.random.default_rng(seed), made.model.skin
    moved = random.normal(size=(500, 3)) * [0.1, 0.0, 0.1] + random.normal(size=3) * [3.0, 0.0, 3.0]
    moved += made.x @ (0.2 * random.normal(size=(3, 3))) * [1.0, 0.0, 1.0]
    moved *= 0.999 * skin / (strain(made, skin * moved) * skin)
    assert strain(made, skin * moved) < 1.0
    x = made.x + skin * moved
    to_walls = np.linalg.norm(x[:, None] - made.model.wall_position.numpy(), axis=2)
    assert (to_walls < made.model.support).any()
    assert made.wall_pairs()[to_walls < made.model.support].all()
    distance = np.linalg.norm(x[:, None] - x, axis=2)
    np.fill_diagonal(distance, np.inf)
    assert made.pairs()[distance < made.model.support].all()


def test_starts_by_bisection_are_those_of_a_walk(device):
    """Empty cells at both ends and between, a cell with many: the same starts by either kernel."""
    launcher, cells = Launcher(device), 60
    cell = wp.array(np.sort(np.r_[np.random.default_rng(3).integers(5, 50, 40), [20] * 9]), dtype=int, device=device)
    walked, searched = (wp.zeros(cells + 1, dtype=int, device=device) for _ in range(2))
    launcher.record_in_order(kernels.find_starts, len(cell), [len(cell), cells, cell, walked])()
    launcher.record_in_order(kernels.search_starts, cells + 1, [len(cell), cell, searched])()
    np.testing.assert_array_equal(walked.numpy(), np.searchsorted(cell.numpy(), np.arange(cells + 1)))
    np.testing.assert_array_equal(searched.numpy(), walked.numpy())
