"""Gauges: which crossing of one half is the surface, and the level of water whose level is known."""

import numpy as np
import pytest

from scenes import block, crate, pool, scene, tank
from warpsph.measure.gauges import surface
from warpsph.simulation import Simulation

# Of levels, in spacings: what a lattice makes of a smooth fraction, sampled every half spacing.
TOLERANCE = 0.1
SPACING = 0.02

POOL = scene(
    "A pool",
    0.02,
    [tank(0.8, 0.6)],
    [pool(0.4, between=[0.0, 0.5])],
    """gauges:
  - {name: a, x: 0.2}
  - {name: b, x: 0.207, bottom: 0.003}
  - {name: c, x: 0.253, bottom: 0.107}
  - {name: dry, x: 0.7, bottom: 0.05}
  - {name: floor, x: 0.7}""",
    sound_speed=40.0,
)
BLOCK = scene(
    "A block of water that rises in space",
    0.02,
    [tank(0.8, 1.0)],
    [block([0.2, 0.2], [0.6, 0.4], velocity=[0.0, 0.5])],
    "gravity: 0.0",
    "gauges: [{name: a, x: 0.4}]",
    sound_speed=40.0,
)
HEIGHTS = np.arange(0.0, 2.0, 0.01)


def profile(*layers: tuple[float, float], soft: float = 0.02) -> np.ndarray:
    """The fraction at HEIGHTS of fluid in `layers` from one height to another [m], blurred over `soft` [m]."""
    fraction = np.zeros(len(HEIGHTS))
    for low, high in layers:
        fraction += 0.5 * (np.tanh((HEIGHTS - low) / soft) - np.tanh((HEIGHTS - high) / soft))
    return fraction


@pytest.mark.parametrize("level", [0.5, 0.503, 0.507, 1.2])
def test_surface_of_a_column(level):
    assert surface(HEIGHTS, profile((-1.0, level)), thick=4) == pytest.approx(level, abs=0.1 * 0.01)


def test_crossing_is_interpolated():
    """The fraction falls through one half in a straight line, between two samples."""
    fraction = np.clip(0.5 - (HEIGHTS - 0.7043) / 0.05, 0.0, 1.0)
    assert surface(HEIGHTS, fraction, thick=4) == pytest.approx(0.7043, abs=1e-12)


@pytest.mark.parametrize("above", [(1.0, 1.02), (1.505, 1.535)], ids=["a drop", "a splash"])
def test_spray_is_looked_through(above):
    """It is thinner than four samples."""
    assert surface(HEIGHTS, profile((-1.0, 0.5), above, soft=0.001), thick=4) == pytest.approx(0.5, abs=0.01)


def test_a_thick_lip_counts():
    """An overturning wave: the level is that of the lip once it is thick."""
    assert surface(HEIGHTS, profile((-1.0, 0.5), (0.8, 1.0)), thick=4) == pytest.approx(1.0, abs=0.001)


def test_a_film_on_the_bed_is_dry():
    assert surface(HEIGHTS, profile((-1.0, 0.02), soft=0.001), thick=4) == 0.0


def test_dry_is_the_bottom():
    heights = 0.3 + HEIGHTS
    assert surface(heights, np.zeros(len(heights)), thick=4) == 0.3
    assert surface(heights, np.full(len(heights), 0.4), thick=4) == 0.3  # spray all the way


def test_full_to_the_top():
    assert surface(HEIGHTS, np.ones(len(HEIGHTS)), thick=4) == HEIGHTS[-1]


@pytest.fixture(scope="module")
def levels(make_scene, device) -> dict[str, float]:
    simulation = Simulation(make_scene(POOL), device)
    return dict(zip(simulation.gauges.names, simulation.gauges.levels(), strict=True))


@pytest.mark.parametrize("name", ["a", "b", "c"])
def test_level_of_a_lattice(levels, name):
    """Half a spacing above the highest row; over a column or between two, wherever the samples happen to lie."""
    assert levels[name] == pytest.approx(0.4, abs=TOLERANCE * SPACING)


def test_dry_gauge_tells_its_bottom(levels):
    """The one that it was given, or else the lowest point of the walls as they are drawn."""
    assert levels["dry"] == pytest.approx(0.05)
    assert levels["floor"] == pytest.approx(0.0, abs=TOLERANCE * SPACING)


def test_level_follows_the_water(make_scene, device):
    """Up to the step, also between two builds of the lists: a block that rises freely with 0.5 m/s."""
    simulation = Simulation(make_scene(BLOCK), device)
    for time in np.arange(1, 41) * 1e-3:
        simulation.advance(time)
        (level,) = simulation.gauges.levels()
        assert level == pytest.approx(0.4 + 0.5 * time, abs=TOLERANCE * SPACING)
    assert simulation.step.neighbours.rebuilds < 20


def test_no_gauges(make_scene, device):
    assert Simulation(make_scene(POOL, "gauges=[]"), device).gauges.levels() == []


# The water stands higher in the back half of the tank.
BOX = scene(
    "A pool in space",
    0.02,
    [crate(0.4, 0.6, 0.6)],
    [block([0.0, 0.0, 0.0], [0.4, 0.3, 0.2], "low"), block([0.0, 0.3, 0.0], [0.4, 0.6, 0.3], "high")],
    "gauges: [{name: front, x: 0.2, y: 0.15}, {name: back, x: 0.213, y: 0.447, bottom: 0.003}]",
    sound_speed=40.0,
    dimensions=3,
)


def test_gauges_in_space_stand_at_their_y(make_scene, device):
    simulation = Simulation(make_scene(BOX), device)
    assert simulation.gauges.levels() == pytest.approx([0.2, 0.3], abs=TOLERANCE * SPACING)


HILLS = """
title: A pool between hills, under a lid
spacing: 0.02
materials: {water: {density: 1000.0, sound_speed: 40.0}}
wall_model: {force: dummy_particles}
walls:
  - {name: tank, path: [[0.0, 0.6], [0.0, 0.0], [0.6, 0.0], [1.2, 0.3], [1.2, 0.6]], closed: true}
  - {name: sill, box: {min: [0.2, 0.0], max: [0.34, 0.14]}}
fluids: [{name: water, material: water, fill: {level: 0.1, above: tank}}]
gauges: [{name: slope, x: 1.0}, {name: sill, x: 0.27}, {name: pool, x: 0.5}]
run: {end_time: 1.0}
"""


def test_a_dry_gauge_reads_the_bed_below_it(make_scene, device):
    """Not the lowest wall, and not the lid."""
    simulation = Simulation(make_scene(HILLS), device)
    assert simulation.gauges.levels() == pytest.approx([0.2, 0.14, 0.1], abs=TOLERANCE * SPACING)


@pytest.mark.parametrize("x", [0.0, 0.001, 0.004, 0.01, 0.02, 0.4])
def test_the_level_beside_a_wall(make_scene, device, x):
    """What of the kernel lies in the wall cannot be filled."""
    simulation = Simulation(
        make_scene(POOL, "fluids[0].fill={level: 0.4, above: tank}", f"gauges=[{{name: a, x: {x}}}]")
    )
    assert simulation.gauges.levels() == pytest.approx([0.4], abs=TOLERANCE * SPACING)


def test_water_is_seen_however_high_it_gets(make_scene, device):
    """The block rises from 0.4 m to more than twice that."""
    simulation = Simulation(make_scene(BLOCK, "fluids[0].velocity=[0.0, 5.0]"), device)
    simulation.advance(0.16)
    assert simulation.gauges.levels() == pytest.approx([0.4 + 5.0 * 0.16], abs=TOLERANCE * SPACING)
