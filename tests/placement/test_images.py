"""Mirrors and periodic edges: their group, the sums over ghosts against sums over real particles, what is conserved."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import warpsph.model
from warpsph.placement.images import find_images
from warpsph.placement.place import place
from warpsph.scene.source import SceneError
from warpsph.simulation import Simulation
from warpsph.step.ghosts import Ghosts

# Relative, for sums in single precision whose order differs.
TOLERANCE = 2e-5

BLOCK = """
title: A block of water
spacing: 0.05
gravity: 0.0
materials: {water: {density: 1000.0, sound_speed: 20.0, alpha: 0.1}}
xsph: 0.0
fluids:
  - name: water
    material: water
    jitter: 0.2
    hydrostatic: false
    velocity: [2.0, 1.0]
    shape: {box: {min: [0, 0], max: [1, 0.8]}}
run: {end_time: 1.0}
wall_model: {force: radial}
smoothing: {kernel: wendland_c2, ratio: 1.5}
"""
ALONG = "{name: along, periodic: {start: [0, 0], end: [1, 0]}}"
UP = "{name: up, periodic: {start: [0, 0], end: [0, 0.8]}}"
FLOOR = "{name: floor, mirror: {point: [0, 0], normal: [0, 1]}}"
LID = "{name: lid, mirror: {point: [0, 0.8], normal: [0, -2]}}"
LEFT = "{name: left, mirror: {point: [0, 0], normal: [1, 0]}}"
RIGHT = "{name: right, mirror: {point: [1, 0], normal: [-1, 0]}}"


def slanted(degrees: float) -> str:
    """A mirror through the origin that meets the floor at an angle."""
    a = np.radians(degrees)
    return f"{{name: slanted, mirror: {{point: [0, 0], normal: [{np.sin(a)}, {-np.cos(a)}]}}}}"


def images(*parts: str) -> str:
    return f"images=[{', '.join(parts)}]"


@pytest.mark.parametrize(
    ("parts", "count"),
    [
        ([FLOOR], 1),
        ([FLOOR, LID], 2),
        ([FLOOR, LEFT], 3),
        ([FLOOR, LID, LEFT, RIGHT], 8),
        ([ALONG], 2),
        ([ALONG, UP], 8),
        ([ALONG, FLOOR], 5),
        ([ALONG, FLOOR, LID], 8),
        ([FLOOR, slanted(60.0)], 5),
        ([FLOOR, slanted(45.0)], 7),
        ([FLOOR, slanted(30.0)], 11),
    ],
)
def test_group(make_scene, parts, count):
    """A corner of 180 / n degrees has 2 n - 1 images, a box its eight neighbours; all of them are isometries."""
    box = [np.array([0.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.8])]
    _, found = find_images(make_scene(BLOCK, images(*parts)), 0.2, *box)
    assert len(found) == count
    for image in found:
        np.testing.assert_allclose(image.rotation @ image.rotation.T, np.eye(3), atol=1e-12)


def accelerations(simulation: Simulation) -> np.ndarray:
    """By pressure and by viscosity, in id order [m/s2]."""
    state = simulation.state
    simulation.step._pack()
    simulation.step.scheme.fluid.sweep()[0]()
    order = np.argsort(state.id.numpy())
    return (state.pressure_acceleration.numpy() + state.dissipative_acceleration.numpy())[order]


def compressed(simulation: Simulation) -> None:
    """Give every particle another density, the same for the same id."""
    state = simulation.state
    state.density.assign(1000.0 + 20.0 * np.sin(17.0 * state.id.numpy()))


def test_periodic_sums_are_those_of_a_tiling(make_scene, device):
    """What a particle feels among ghosts is what it feels in the middle of three by three copies of the block."""
    block = Simulation(make_scene(BLOCK, images(ALONG, UP)), device)
    compressed(block)
    here = accelerations(block)

    placement = place(block.scene)
    copies = [np.array([a, 0.0, c]) for c, a in product((0.0, 0.8, -0.8), (0.0, 1.0, -1.0))]
    n = len(copies)
    tiled = replace(
        placement,
        position=np.concatenate([placement.position + copy for copy in copies]),
        velocity=np.tile(placement.velocity, (n, 1)),
        fluid=np.tile(placement.fluid, n),
        initial_depth=np.tile(placement.initial_depth, n),
    )
    tiling = Simulation(make_scene(BLOCK), device, placement=tiled)
    ids = tiling.state.id.numpy() % len(placement.position)
    tiling.state.density.assign(1000.0 + 20.0 * np.sin(17.0 * ids))
    there = accelerations(tiling)[: len(placement.position)]
    np.testing.assert_allclose(here, there, rtol=0, atol=TOLERANCE * np.abs(there).max())


@pytest.mark.parametrize("mirror", [[RIGHT], [RIGHT, FLOOR]], ids=["mirror", "corner"])
def test_a_collapse_on_both_sides_is_one_and_a_mirror(make_scene, device, mirror):
    """A column that spreads to the left of a mirror, and one of twice the width that spreads both ways."""
    open_floor = [] if FLOOR in mirror else [FLOOR]
    falling = [
        "gravity=9.81",
        "fluids[0].jitter=0.0",
        "fluids[0].velocity=[0.0, 0.0]",
        "materials.water.sound_speed=30",
    ]
    half = Simulation(make_scene(BLOCK, images(*mirror, *open_floor), *falling), device)
    whole = Simulation(make_scene(BLOCK, images(FLOOR), *falling, "fluids[0].shape.box.max=[2.0, 0.8]"), device)
    for simulation in (half, whole):
        simulation.advance(0.1)
    a, b = half.state.snapshot(), whole.state.snapshot()
    left = b.position[:, 0] < 1.0
    assert left.sum() == len(a.position)

    def in_order(position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        return velocity[np.lexsort((np.round(position[:, 0], 3), np.round(position[:, 2], 3)))]

    np.testing.assert_allclose(
        in_order(a.position, a.velocity), in_order(b.position[left], b.velocity[left]), rtol=0, atol=2e-3
    )


def test_mass_and_momentum_go_through_periodic_edges(make_scene, device):
    """Of a jittered block that flows through both pairs of edges; every particle stays within them."""
    simulation = Simulation(make_scene(BLOCK, images(ALONG, UP)), device)
    before = simulation.state.snapshot().velocity.sum(axis=0)
    simulation.advance(0.7)
    after = simulation.state.snapshot()
    assert simulation.step.neighbours.rebuilds > 3
    np.testing.assert_allclose(after.velocity.sum(axis=0), before, rtol=0, atol=TOLERANCE * np.abs(before).max())
    assert np.all(after.position >= 0.0)
    assert np.all(after.position <= [1.0, 0.0, 0.8])


def test_a_tank_of_mirrors_rests(make_scene, device):
    """Pressure is extrapolated beyond the floor: where it is copied, the lowest row is pushed half as much."""
    still = ["gravity=9.81", "fluids[0].jitter=0.0", "fluids[0].velocity=[0.0, 0.0]", "fluids[0].hydrostatic=true"]
    simulation = Simulation(make_scene(BLOCK, images(FLOOR, LEFT, RIGHT), *still), device)
    upward = accelerations(simulation)
    x = simulation.state.snapshot().position
    deep = x[:, 2] < 0.8 - 4 * 0.05
    np.testing.assert_allclose(upward[deep, 2], upward[deep, 2].mean(), rtol=0.03)
    assert upward[deep, 2].mean() == pytest.approx(9.81, rel=0.07)  # the lattice's own error
    np.testing.assert_allclose(upward[:, 0], 0.0, atol=0.02 * 9.81)


def test_energy_of_a_fall_through_the_bottom(make_scene, device):
    """A body force drives fluid round and round: what the edges put back is work of walls, and the sum stays."""
    driven = ["body_force=[3.0, -9.0]", "density_diffusion={model: none}", "fluids[0].jitter=0.0"]
    simulation = Simulation(make_scene(BLOCK, images(ALONG, UP), *driven), device)
    start, _ = simulation.energy.measure()
    simulation.advance(0.6)
    end, _ = simulation.energy.measure()
    assert end.wall_work > 0.5 * (end.kinetic - start.kinetic)
    assert end.total == pytest.approx(start.total, rel=1e-4)


@pytest.mark.parametrize("parts", [[ALONG, UP], [FLOOR, LID, LEFT, RIGHT], [FLOOR, ALONG]])
def test_no_pair_is_missing(make_scene, device, parts):
    """Whatever lies within the support, seen directly or through an image, is on the list, whenever one looks."""
    simulation = Simulation(make_scene(BLOCK, images(*parts), "fluids[0].velocity=[2.0, -3.0]"), device)
    model, state = simulation.model, simulation.state
    _, found = find_images(simulation.scene, model.list_radius, *(np.array(c) for c in ([0.0] * 3, [1.0, 0.0, 0.8])))
    for time in np.linspace(0.01, 0.1, 7):
        simulation.advance(time)
        x = state.position_volume.numpy()[: model.particle_count, :3].astype(float)
        seen = np.concatenate([x, *(x @ image.rotation.T + image.translation for image in found)])
        apart = np.linalg.norm(x[:, None] - seen[None], axis=2)
        near = ((apart < model.support) & (apart > 0.0)).sum(axis=1)
        listed = simulation.step.neighbours
        count, entries, packed = listed.neighbour_count.numpy(), listed.rows(), state.position_volume.numpy()
        for i in range(model.particle_count):
            mine = entries[i, : count[i]]
            there = np.linalg.norm(x[i] - packed[mine, :3], axis=1)
            assert (there < model.support * (1 - 1e-6)).sum() <= near[i] <= (there < model.support * (1 + 1e-6)).sum()


def test_arrays_that_grow_on_the_way(make_scene, device, bits, monkeypatch):
    """A block comes down to a mirror, and ghosts and rows need more room: the same bits and levels as with enough."""
    make_room, runs = Ghosts._make_room, []
    falling = ["spacing=0.025", "fluids[0].shape.box={min: [0, 0.3], max: [1, 0.7]}", "fluids[0].velocity=[0, -3]"]
    gauge = "gauges=[{name: middle, x: 0.5, bottom: 0.0}]"
    for room, row in ((4096, 2.0), (64, warpsph.model.ROOM)):
        enough = lambda ghosts, wanted, room=room: make_room(ghosts, max(wanted, room))  # noqa: E731
        monkeypatch.setattr(Ghosts, "_make_room", enough)
        monkeypatch.setattr(warpsph.model, "ROOM", row)
        simulation = Simulation(make_scene(BLOCK, images(FLOOR), *falling, gauge), device)
        levels, rooms, rows = [], [], []
        for time in (0.02, 0.1, 0.12):
            simulation.advance(time)
            levels += simulation.gauges.levels()
            rooms.append(len(simulation.step.neighbours.ghosts.source))
            lists = simulation.step.neighbours.neighbour_list
            rows.append(lists.short_rows.size + lists.long_rows.size)
        grows = room == 64
        assert (rooms[0] < rooms[1] < rooms[2], rows[0] < rows[2]) == (grows, grows)
        runs.append((levels, bits(simulation)))
    assert levels[0] > levels[1] > levels[2] > 0.3
    assert runs[0] == runs[1]


def test_threads_leave_no_trace(make_scene):
    """Same bits on one thread and on two."""

    def run(threads: int) -> bytes:
        simulation = Simulation(make_scene(BLOCK, images(ALONG, FLOOR)), "cpu", threads)
        simulation.advance(0.05)
        return simulation.state.position.numpy().tobytes()

    assert run(1) == run(2)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (images(FLOOR, slanted(100.0)), "meet at 100 degrees"),
        (images(FLOOR, slanted(120.0)), "meet at 120 degrees"),
        (images(ALONG.replace("[1, 0]", "[0.2, 0]")), "at least 4 h = 0.3 m is needed"),
        (images(ALONG.replace("[1, 0]", "[1.02, 0]")), "are 20.4 spacings"),
        (images(ALONG, slanted(90.0).replace("0, 0", "-1, 0")), "the mirror 'slanted' does not run straight"),
        (images(FLOOR.replace("[0, 0]", "[0, 0.1]")), "particles lie beyond 'floor'"),
        (images(ALONG.replace("[0, 0]", "[0.5, 0]").replace("[1, 0]", "[1.5, 0]")), "particles lie beyond 'along'"),
        (images(FLOOR, FLOOR), "'floor' is the name of images[0] already"),
        (images(FLOOR.replace("[0, 1]", "[0, 0]")), "images[0].mirror.normal: has no direction"),
        (images("{name: nothing}"), "exactly one of mirror, periodic is needed"),
        (
            images(FLOOR.replace("normal", "velocity_rule: takeda, velocity: [0, 1], normal")),
            "must be along the wall; a mirror stays where it is",
        ),
        (images(FLOOR.replace("normal", "velocity: [1, 0], normal")), "means nothing to a fluid that slips"),
        (images(FLOOR.replace("[0, 1]", "[0, 1, 0]")), "two numbers are needed in a 2-D scene, not 3"),
    ],
)
def test_refusals(make_scene, override, message):
    """One line, about the field at fault."""
    with pytest.raises(SceneError) as raised:
        Simulation(make_scene(BLOCK, override))
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)
