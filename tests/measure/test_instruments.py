"""Probes, forces, run-up and overtopping on water whose answer is known."""

import numpy as np
import pytest

from scenes import DUMMIES, crate, pool, scene
from warpsph.scene.source import SceneError
from warpsph.simulation import Simulation

G, RHO, LEVEL = 9.81, 1000.0, 0.2
HEAD = """
title: A tank
spacing: 0.01
xsph: 0.0
materials: {water: {density: 1000.0, sound_speed: 20.0}}
"""
TANK = (
    HEAD
    + """
wall_model: {force: dummy_particles}
walls: [{name: tank, path: [[0.0, 0.3], [0.0, 0.0], [0.3, 0.0], [0.5, 0.3]]}]
fluids: [{name: water, material: water, fill: {level: 0.2, above: tank}}]
probes:
  - {name: foot, at: [0.0, 0.0]}
  - {name: wall, at: [0.0, 0.1]}
  - {name: inside, at: [0.153, 0.104]}
  - {name: air, at: [0.1, 0.28]}
forces:
  - {name: left, wall: tank, part: {min: [0.0, 0.0], max: [0.0, 0.3]}, about: [0.0, 0.0]}
  - {name: low, wall: tank, part: {min: [0.0, 0.0], max: [0.0, 0.055]}}
  - {name: all, wall: tank}
run_up: [{name: slope, wall: tank, part: {min: [0.31, 0.0], max: [0.5, 0.3]}}]
run: {end_time: 1.0}
"""
)
FALL = (
    HEAD
    + """
walls: [{name: tank, path: [[0.0, 1.0], [0.0, 0.0], [0.8, 0.0], [0.8, 1.0]]}]
gravity: 0.0
fluids: [{name: block, material: water, velocity: [0.5, 0.0], shape: {box: {min: [0.2, 0.4], max: [0.3, 0.6]}}}]
overtopping:
  - {name: upright, start: [0.35, 0.3], end: [0.35, 0.7]}
  - {name: half, start: [0.35, 0.3], end: [0.35, 0.5]}
  - {name: down, start: [0.35, 0.7], end: [0.35, 0.3]}
  - {name: beside, start: [0.35, 0.61], end: [0.35, 0.9]}
run: {end_time: 1.0}
"""
)


@pytest.fixture(scope="module")
def still(make_scene, device) -> dict[str, list[float]]:
    return dict(Simulation(make_scene(TANK), device).instruments.rows(0.0))


def test_probes_read_hydrostatics_up_to_the_wall(still):
    """A linear pressure, from half of a kernel and from a quarter of it too."""
    for name, z in (("foot", 0.0), ("wall", 0.1), ("inside", 0.104)):
        pressure, u, w = still[f"probes/{name}"]
        assert pressure == pytest.approx(RHO * G * (LEVEL - z), rel=2e-3)
        assert (u, w) == (0.0, 0.0)


def test_a_probe_in_the_air_reads_nothing(still):
    pressure, *velocity = still["probes/air"]
    assert pressure == 0.0 and np.isnan(velocity).all()


def test_force_on_a_wall_and_where_it_attacks(still):
    """0.5 rho g H^2 at a third of H; of the part below 0.055 m, a cut that no point falls on, rho g int (H - z) dz."""
    x, z, torque, at_x, at_z = still["forces/left"]
    assert x == pytest.approx(-0.5 * RHO * G * LEVEL**2, rel=2e-3) and z == 0.0
    assert at_x == 0.0 and at_z == pytest.approx(LEVEL / 3.0, rel=5e-3)
    assert torque == pytest.approx(at_z * -x, rel=1e-3)  # towards -x above the foot: counter-clockwise
    part = RHO * G * (LEVEL * 0.055 - 0.5 * 0.055**2)
    assert still["forces/low"][0] == pytest.approx(-part, rel=0.01)


def test_the_force_on_all_walls_is_the_weight(still):
    """And nothing along x, though one end wall leans: to a spacing on the slope, which the lattice steps over."""
    x, z, *_ = still["forces/all"]
    area = 0.3 * LEVEL + 0.5 * LEVEL**2 * 2.0 / 3.0
    assert z == pytest.approx(-RHO * G * area, rel=0.02)
    assert abs(x) < 0.02 * 0.5 * RHO * G * LEVEL**2


def test_run_up_of_still_water_is_its_level(still):
    x, z, along = still["run_up/slope"]
    assert z == pytest.approx(LEVEL, abs=0.011)  # a lattice leaves a gap at the slope
    assert x == pytest.approx(0.3 + z / 1.5, abs=1e-6)
    assert along == pytest.approx(0.6 + np.hypot(x - 0.3, z), abs=1e-6)


def test_a_probe_rides_on_a_body(make_scene, device):
    text = TANK.replace(
        "probes:",
        "bodies: [{name: box, shape: {box: {min: [0.1, 0.05], max: [0.2, 0.15]}}, density: 1000.0,\n"
        "  motion: {kind: constant, shift: [0.0, 0.5]}}]\n"
        "probes:\n  - {name: top, at: [0.15, 0.15], body: box}",
    )
    simulation = Simulation(make_scene(text), device)
    before = dict(simulation.instruments.rows(0.0))["probes/top"][0]
    assert before == pytest.approx(RHO * G * 0.05, rel=0.02)
    simulation.instruments._look()
    start = simulation.instruments._points.numpy()[0].copy()
    simulation.advance(0.01)
    simulation.instruments._look()
    np.testing.assert_allclose(simulation.instruments._points.numpy()[0] - start, [0.0, 0.0, 0.005], atol=1e-6)


@pytest.mark.parametrize("law", ["radial", "dummy_particles"])
def test_what_passes_a_line_is_counted_with_its_sign(make_scene, device, law):
    simulation = Simulation(make_scene(FALL, f"wall_model.force={law}"), device)
    for time in np.arange(1, 13) * 0.04:
        simulation.advance(time)
        rows = dict(simulation.instruments.rows(time))
    assert rows["overtopping/upright"][0] == pytest.approx(0.02, rel=1e-6)
    assert rows["overtopping/down"][0] == pytest.approx(-0.02, rel=1e-6)
    assert rows["overtopping/half"][0] == pytest.approx(0.01, rel=0.05)  # a row may drift over its end
    assert rows["overtopping/beside"][0] == pytest.approx(0.0, abs=0.001)


def test_what_has_passed_is_kept_by_a_checkpoint(make_scene, device, resumed, tmp_path):
    from warpsph.output.checkpoint import write_checkpoint

    simulation = Simulation(make_scene(FALL), device)
    for time in (0.1, 0.15):
        simulation.advance(time)
        simulation.instruments.rows(time)
    simulation.advance(0.17)
    write_checkpoint(tmp_path, simulation)
    other = resumed(simulation, tmp_path)
    simulation.advance(0.2)
    other.advance(0.2)
    ours, theirs = (dict(one.instruments.rows(0.2))["overtopping/upright"] for one in (simulation, other))
    assert 0.0 < ours[0] < 0.02 and ours[1] > 0.0 and ours == theirs


BOX = scene(
    "A box in space",
    0.02,
    [crate(0.3, 0.2, 0.4)],
    [pool(0.2)],
    DUMMIES,
    "smoothing: {kernel: wendland_c2, ratio: 1.5}",
    "xsph: 0.0",
    "probes: [{name: corner, at: [0.0, 0.0, 0.0]}]",
    """forces:
  - {name: left, wall: tank, part: {min: [0.0, 0.0, 0.0], max: [0.0, 0.2, 0.4]}, about: [0.0, 0.0, 0.0]}""",
    "run_up: [{name: tank, wall: tank}]",
    "overtopping: [{name: gate, start: [0.15, 0.0, 0.0], end: [0.15, 0.2, 0.4]}]",
    dimensions=3,
)


def test_in_space(make_scene, device):
    rows = dict(Simulation(make_scene(BOX), device).instruments.rows(0.0))
    assert rows["probes/corner"][0] == pytest.approx(RHO * G * LEVEL, rel=2e-3)
    fx, fy, fz, tx, ty, _, x, y, z = rows["forces/left"]
    assert fx == pytest.approx(-0.5 * RHO * G * LEVEL**2 * 0.2, rel=0.01) and x == 0.0
    assert (fy, fz, tx) == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)
    assert y == pytest.approx(0.1, rel=1e-3) and z == pytest.approx(LEVEL / 3.0, rel=0.02)
    assert ty == pytest.approx(z * fx, rel=1e-3)
    assert rows["run_up/tank"][2] == pytest.approx(LEVEL, abs=0.02)
    assert len(rows["run_up/tank"]) == 4 and rows["overtopping/gate"] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("forces[0].part={min: [2.0, 0.0], max: [3.0, 1.0]}", r"forces\[0\].part: there is nothing of wall 'tank'"),
        ("forces[0].wall=tonk", r"forces\[0\].wall: no wall named 'tonk'; did you mean 'tank'"),
        ("probes[0].body=box", r"probes\[0\].body: no body named 'box'"),
        ("probes[0].observed={file: none.csv, columns: [time, p]}", r"probes\[0\].observed: .*none.csv: no such file"),
        ("run_up[0].name=8", r"run_up\[0\].name: text is needed"),
        ("overtopping=[{name: a, start: [0.1, 0.1], end: [0.1, 0.1]}]", r"end: must not be start"),
        ("overtopping=[{name: a, start: [0.1, 0.1], end: [0.1, 0.0, 0.1]}]", r"overtopping\[0\].end: .*two numbers"),
    ],
)
def test_mistakes_are_one_line(make_scene, override, words):
    with pytest.raises(SceneError, match=words):
        Simulation(make_scene(TANK, override))
