"""The way of a paddle, what is refused of it, and that it is the same scene when it is written out."""

import math

import numpy as np
import pytest

from warpsph.bodies.wave_maker import in_words
from warpsph.placement.place import place
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError
from warpsph.simulation import Simulation
from warpsph.theory.waves import paddle_ratio, solitary_stroke, wavenumber

FLUME = """
title: A flume
spacing: 0.02
xsph: 0.0
materials: {water: {density: 1000.0, sound_speed: 20.0}}
wall_model: {force: dummy_particles}
walls: [{name: flume, path: [[-0.6, 0.5], [-0.6, 0.0], [3.0, 0.0], [3.0, 0.5]]}]
fluids: [{name: water, material: water, fill: {level: 0.2, above: flume, between: [0.0, 3.0]}}]
wave_maker: {waves: regular, x: 0.0, depth: 0.2, height: 0.02, period: 1.0}
damping_zones: [{name: sponge, end: 3.0}]
run: {end_time: 4.0}
"""
ALONE = ["damping_zones=[]", "wave_maker.period=null"]


def table(scene: Scene):
    return place(scene).solids[-1].body.motion.table


def test_regular_waves_have_their_stroke_and_begin_at_rest(make_scene):
    rows = table(make_scene(FLUME, "wave_maker.order=1"))
    k = float(wavenumber(2.0 * math.pi, depth=0.2))
    stroke = 0.02 / float(paddle_ratio(k, depth=0.2))
    assert np.ptp(rows.shift[rows.time > 1.0, 0]) == pytest.approx(stroke, rel=5e-3)
    assert rows.shift[0, 0] == 0.0 and abs(rows.rates()[0][0, 0]) < 1e-2 * stroke
    assert rows.time[-1] >= 4.0


def test_a_flap_turns_about_its_hinge_and_leans_forward_first(make_scene, device):
    """The same way at the still level as the theory has; its face moves along x there."""
    scene = make_scene(FLUME, "wave_maker.paddle=flap", "wave_maker.hinge=-0.1")
    motion = place(scene).solids[-1].body.motion
    np.testing.assert_allclose(motion.pivot, [0.0, 0.0, -0.1])
    simulation = Simulation(scene, device)
    simulation.advance(0.2)
    (x, _, _), (_, q, _, s) = (np.array(one) for one in simulation.bodies.places()[-1])
    angle = 2.0 * math.atan2(q, s)
    expected = float(np.interp(0.2, motion.table.time, motion.table.angle))
    assert angle == pytest.approx(expected, rel=5e-3) and angle > 0.0
    assert x > -0.06 and simulation.bodies.rows()[-1][2] < 0.0  # the record counts counter-clockwise


def test_a_sea_is_its_seed(make_scene):
    rows = [
        table(make_scene(FLUME, "wave_maker.waves=irregular", f"wave_maker.seed={seed}")).shift for seed in (1, 1, 2)
    ]
    np.testing.assert_array_equal(rows[0], rows[1])
    assert np.any(rows[0] != rows[2])
    default = make_scene(FLUME, "wave_maker.waves=irregular")
    np.testing.assert_array_equal(table(default).shift, rows[0])
    assert in_words(default.wave_maker, 4.0, 9.81).endswith("seed 1")


def test_solitary_waves_in_a_row(make_scene):
    one = table(make_scene(FLUME, *ALONE, "wave_maker.waves=solitary"))
    two = table(make_scene(FLUME, *ALONE, "wave_maker.waves=solitary", "wave_maker.count=2", "wave_maker.every=5.0"))
    assert one.shift[-1, 0] == pytest.approx(solitary_stroke(0.02, depth=0.2), rel=2e-3)
    assert two.shift[-1, 0] == pytest.approx(2.0 * one.shift[-1, 0], rel=1e-6)
    assert np.all(np.diff(two.shift[:, 0]) >= -1e-12) and np.all(np.diff(two.time) > 0.0)


def test_a_measured_paddle_counts_from_its_first_row(make_scene, tmp_path):
    file = tmp_path / "paddle.csv"
    file.write_text("time [s],x [m]\n10.0,-0.1\n10.5,-0.05\n11.0,0.02\n", encoding="utf-8")
    wish = f"wave_maker={{waves: table, x: 0.0, depth: 0.2, file: {file}, begin: 0.3}}"
    scene = make_scene(FLUME, "damping_zones=[]", wish)
    motion = place(scene).solids[-1].body.motion
    np.testing.assert_allclose(motion.table.time, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(motion.table.shift[:, 0], [0.0, 0.05, 0.12], atol=1e-12)
    assert motion.begin == 0.3


def test_the_scene_is_written_without_its_paddle(make_scene):
    scene = make_scene(FLUME)
    assert scene.bodies[-1].name == "paddle" and "name: paddle" not in scene.resolved_yaml()
    assert make_scene(scene.resolved_yaml()) == scene


def test_a_flume_on_a_map_is_the_same_flume(make_scene):
    far = (
        FLUME.replace("-0.6,", "411999.4,")
        .replace("3.0,", "412003.0,")
        .replace("[0.0, 412003.0", "[412000.0, 412003.0")
    )
    far = far.replace("between: [0.0, 3.0]", "between: [412000.0, 412003.0]").replace("x: 0.0,", "x: 412000.0,")
    far = far.replace("end: 3.0", "end: 412003.0")
    near, moved = place(make_scene(FLUME)), place(make_scene(far))
    shift = moved.position[0] - near.position[0]
    np.testing.assert_allclose(moved.position - shift, near.position, atol=1e-9)
    np.testing.assert_array_equal(moved.solids[-1].body.motion.table.shift, near.solids[-1].body.motion.table.shift)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (
            ["wave_maker.height=0.2"],
            r"wave_maker.height: 0.2 m breaks in 0.2 m of water; 0.133 m is the most \(Miche\)",
        ),
        (["wave_maker.paddle=flap"], "wave_maker.hinge: this field is missing: a flap turns about it"),
        (["wave_maker.hinge=0.0"], "wave_maker.hinge: goes with a flap"),
        (["wave_maker.seed=3"], "wave_maker.seed: means nothing to regular waves"),
        (
            ["wave_maker.longest_stroke=0.01"],
            "takes a stroke of 0.0197 m, and the longest is 0.01 m; 0.0101 m is the most",
        ),
        (
            ["wave_maker.period=3.0", "wave_maker.height=0.05"],
            r"too high for waves of second order.*0.0122 m is the most",
        ),
        ([*ALONE, "wave_maker.waves=solitary", "wave_maker.height=0.17"], r"0.156 m is the most \(McCowan\)"),
        (["wave_maker.paddle=flap", "wave_maker.hinge=0.1", "wave_maker.height=0.06"], "the flap would lean by"),
        (["wave_maker.top=0.205"], "wave_maker.top: is 0.005 m above the still level"),
        (
            ["damping_zones[0].wavelengths=6"],
            r"zone is 7.27 m long, and its water reaches 2.98 m .* less than 2.46 fit",
        ),
        (["damping_zones[0].wavelengths=0.01"], r"the zone is 0.0\d* m long, less than 4 spacings"),
        (["wave_maker.depth=1e8"], "wave_maker: its paddle cannot be drawn: must be at most"),
        (["wave_maker.top=1e6"], r"wave_maker: it is 1e\+06 m wide, and the walls 3.6 m"),
        (["damping_zones[0].depth=-1"], r"damping_zones\[0\].depth: must be more than 0"),
        (
            ["walls[0].path[0]=[-0.13, 0.5]", "walls[0].path[1]=[-0.13, 0.0]", "wave_maker.height=0.06"],
            "stands 0.01 m behind",
        ),
        (["wave_maker=null"], r"damping_zones\[0\].period: this field is missing, without a wave_maker"),
    ],
)
def test_what_cannot_be_is_one_line(make_scene, overrides, words):
    with pytest.raises(SceneError, match=words):
        place(make_scene(FLUME, *overrides))


def test_a_zone_takes_what_it_books(make_scene, device):
    """Water that moves along a closed flume: the energy that is lost is that which is damped."""
    scene = make_scene(
        FLUME,
        "wave_maker=null",
        "fluids[0].velocity=[0.1, 0.0]",
        "damping_zones=[{name: a, end: 3.0, period: 1.0, depth: 0.2}]",
    )
    simulation = Simulation(scene, device)
    simulation.energy.measure()
    before = simulation.energy.measure()[0]
    simulation.advance(0.05)
    after = simulation.energy.measure()[0]
    assert after.damped > 0.01 * before.kinetic
    assert after.total == pytest.approx(before.total, abs=0.02 * after.damped)


SPACE = """
title: A flume in space
dimensions: 3
spacing: 0.05
xsph: 0.0
materials: {water: {density: 1000.0, sound_speed: 20.0}}
wall_model: {force: dummy_particles}
walls:
  - {name: flume, path: [[-0.6, 0.5], [-0.6, 0.0], [1.2, 0.0], [1.2, 0.5]], width: [0.0, 0.3]}
  - {name: glass, box: {min: [-0.6, 0.0, 0.0], max: [1.2, 0.3, 0.5], open: [left, right, bottom, top]}}
fluids: [{name: water, material: water, fill: {level: 0.2, above: flume, between: [0.0, 1.2]}}]
wave_maker: {waves: regular, x: 0.0, depth: 0.2, height: 0.03, period: 1.0, width: [0.0, 0.3], ramp: 0.0}
probes: [{name: face, at: [0.0, 0.15, 0.05], body: paddle}]
run: {end_time: 1.0}
"""


@pytest.mark.parametrize("flap", [[], ["wave_maker.paddle=flap", "wave_maker.hinge=-0.05"]], ids=["piston", "flap"])
def test_a_paddle_across_a_flume_in_space(make_scene, device, flap):
    simulation = Simulation(make_scene(SPACE, *flap), device)
    still = dict(simulation.instruments.rows(0.0))["probes/face"][0]
    assert still == pytest.approx(1000.0 * 9.81 * 0.15, rel=0.03)
    simulation.advance(0.1)
    pushed = dict(simulation.instruments.rows(0.1))["probes/face"]
    assert simulation.bodies.places()[0][0][0] > -0.15 and pushed[1] > 0.0


def test_in_space_it_needs_a_width(make_scene):
    with pytest.raises(SceneError, match=r"wave_maker\.width: this field is missing, in a 3-D scene"):
        make_scene(SPACE, "wave_maker.width=null")
