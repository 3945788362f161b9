"""The scene file: what loads, what it means, and the exact words for every mistake."""

import re
import time
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from warpsph.placement.place import place
from warpsph.scene.loading import json_schema, load_scene
from warpsph.scene.scene import Scene
from warpsph.scene.shapes import Corner
from warpsph.scene.source import SceneError, read_yaml

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml"))
MANUAL = (Path(__file__).parents[2] / "scenes" / "README.md").read_text(encoding="utf-8")
FIELDS = ", ".join(Scene.model_fields)

TANK = """\
title: A tank
spacing: 0.1
materials:
  water: {density: 1000.0, sound_speed: 50.0}
walls:
  - name: tank
    path: [[0.0, 2.0], [0.0, 0.0], [3.0, 0.0], [3.0, 2.0]]
fluids:
  - name: pool
    material: water
    fill: {level: 1.0, above: tank}
gauges:
  - {name: middle, x: 1.5}
run: {end_time: 1.0}
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load a text as tank.yaml, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def load_text(text: str, *overrides: str) -> Scene:
        Path("tank.yaml").write_text(text, encoding="utf-8")
        return load_scene(Path("tank.yaml"), overrides)

    return load_text


def message(load, text: str, *overrides: str) -> str:
    with pytest.raises(SceneError) as caught:
        load(text, *overrides)
    return str(caught.value)


def test_defaults(load):
    scene = load(TANK)
    assert scene.gravity == 9.81
    assert scene.smoothing.kernel == "quintic_spline"
    assert scene.smoothing_length == pytest.approx(0.142)
    assert scene.wall_spacing == pytest.approx(0.1)
    assert (scene.wall_model.force, scene.xsph) == ("dummy_particles", 0.0)
    assert scene.start_time == 0.0
    assert scene.fluids[0].clearance == 0.5
    assert scene.fluids[0].hydrostatic and not scene.fluids[0].hold
    assert load(TANK + "warm_up: {duration: 0.5, damping: 80}\n").start_time == -0.5


def test_a_path_mixes_points_and_corners(load):
    path = load(TANK.replace("[0.0, 0.0]", "{at: [0.0, 0.0], radius: 0.3}")).walls[0].path
    assert path[0] == (0.0, 2.0)
    assert path[1] == Corner(at=(0.0, 0.0), radius=0.3)


@pytest.mark.parametrize(
    ("word", "number"), [("1e-3", 1e-3), ("1E2", 100.0), ("1.5e-3", 1.5e-3), (".5", 0.5), ("2.", 2.0), ("+3", 3.0)]
)
def test_every_usual_number_is_a_number(load, word, number):
    assert load(TANK.replace("0.1", word)).spacing == number


def test_words_stay_words_and_ten_is_not_eight(load):
    assert load(TANK.replace("A tank", "no")).title == "no"
    assert load(TANK.replace("A tank", "2014-01-01")).title == "2014-01-01"
    assert load(TANK.replace("1.5", "010")).gauges[0].x == 10.0


def test_an_anchor_is_its_value(load):
    text = TANK.replace("{name: middle, x: 1.5}", "{name: a, x: &place 1.5}\n  - {name: b, x: *place}")
    assert [gauge.x for gauge in load(text).gauges] == [1.5, 1.5]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        # keys
        ("spacing: 0.1", "spaceing: 0.1", "tank.yaml:2: spaceing: no such field; did you mean 'spacing'?"),
        ("density", "Density", "tank.yaml:4: materials.water.Density: no such field; did you mean 'density'?"),
        (
            "{end_time: 1.0}",
            "\n  end_time: 1.0\n  qqq: 2",
            "tank.yaml:16: run.qqq: no such field; it can be end_time, courant, time_step, integrator, max_steps, "
            "absurd",
        ),
        (
            "title: A tank",
            "title: A tank\nqqq: 1",
            "tank.yaml:2: qqq: no such field; it can be " + ", ".join(Scene.model_fields),
        ),
        ("density: 1000.0, ", "", "tank.yaml:4: materials.water.density: this field is missing"),
        ("    material: water\n", "", "tank.yaml:9: fluids[0].material: this field is missing"),
        ("run: {end_time: 1.0}", "", "tank.yaml:1: run: this field is missing"),
        (
            "spacing: 0.1",
            "spacing: 0.1\nspacing: 0.2",
            "tank.yaml:3: spacing: written twice; the first is at tank.yaml:2",
        ),
        (
            "title: A tank",
            "title: A tank\n[]: 1",
            "tank.yaml:2: []: no such field; it can be " + ", ".join(Scene.model_fields),
        ),
        (
            "{end_time: 1.0}",
            "{end_time: 1.0, '': 5}",
            "tank.yaml:14: run: no such field; it can be end_time, courant, time_step, integrator, max_steps, absurd",
        ),
        # types
        ("spacing: 0.1", "spacing: thin", "tank.yaml:2: spacing: a number is needed, not 'thin'"),
        ("spacing: 0.1", 'spacing: "0.1"', "tank.yaml:2: spacing: a number is needed, not '0.1'"),
        ("spacing: 0.1", "spacing:", "tank.yaml:2: spacing: a number is needed, not nothing"),
        ("spacing: 0.1", "spacing: true", "tank.yaml:2: spacing: a number is needed, not true"),
        ("spacing: 0.1", "spacing: [0.1]", "tank.yaml:2: spacing: a number is needed, not a list"),
        ("title: A tank", "title: 5", "tank.yaml:1: title: text is needed, not 5"),
        ("title: A tank", "title: t\nxsph: yes", "tank.yaml:2: xsph: a number is needed, not 'yes'"),
        ("{end_time: 1.0}", "5", "tank.yaml:14: run: a mapping of fields is needed, not 5"),
        (
            "{end_time: 1.0}",
            "{end_time: 1, max_steps: 1.5}",
            "tank.yaml:14: run.max_steps: a whole number is needed, not 1.5",
        ),
        (
            "    material",
            "    hold: 1\n    material",
            "tank.yaml:10: fluids[0].hold: true or false is needed, not 1",
        ),
        ("{name: middle, x: 1.5}", "middle", "tank.yaml:13: gauges[0]: a mapping of fields is needed, not 'middle'"),
        ("\n  - {name: middle, x: 1.5}", " 5", "tank.yaml:12: gauges: a list is needed, not 5"),
        (
            "\n  water: {density: 1000.0, sound_speed: 50.0}",
            " [water]",
            "tank.yaml:3: materials: a mapping is needed, not a list",
        ),
        ("[0.0, 2.0]", "[0.0]", "tank.yaml:7: walls[0].path[0]: two numbers [a, b] are needed, not 1"),
        ("[0.0, 2.0]", "0.0", "tank.yaml:7: walls[0].path[0]: two numbers [a, b] are needed, not 0.0"),
        ("[0.0, 2.0]", "[0.0, high]", "tank.yaml:7: walls[0].path[0][1]: a number is needed, not 'high'"),
        (
            "[3.0, 0.0]",
            "{at: [3.0, 0.0], radios: 1}",
            "tank.yaml:7: walls[0].path[2].radios: no such field; did you mean 'radius'?",
        ),
        # values
        ("spacing: 0.1", "spacing: -0.1", "tank.yaml:2: spacing: must be more than 0, not -0.1"),
        ("spacing: 0.1", "spacing: .inf", "tank.yaml:2: spacing: a finite number is needed, not inf"),
        ("spacing: 0.1", "spacing: .nan", "tank.yaml:2: spacing: a finite number is needed, not nan"),
        ("spacing: 0.1", "spacing: 1e999", "tank.yaml:2: spacing: a finite number is needed, not inf"),
        ("spacing: 0.1", "spacing: 0.1\nxsph: 2", "tank.yaml:3: xsph: must be at most 1, not 2"),
        ("spacing: 0.1", "spacing: 0.1\ngravity: -9.81", "tank.yaml:3: gravity: must be at least 0, not -9.81"),
        (
            "sound_speed: 50.0",
            "sound_speed: 50.0, state_equation: tate",
            "tank.yaml:4: materials.water.state_equation: 'tate' is not known here; did you mean 'tait'?",
        ),
        (
            "spacing: 0.1",
            "spacing: 0.1\nviscosity: signal",
            "tank.yaml:3: viscosity: signal is an artificial viscosity: write artificial_viscosity",
        ),
        (
            "spacing: 0.1",
            "spacing: 0.1\nviscosity_beta: 1.0",
            "tank.yaml:3: viscosity_beta: this field is called artificial_viscosity_beta now",
        ),
        ("spacing: 0.1", "spacing: 0.1\nlaminar: {}", "tank.yaml:3: laminar: this field is called viscosity now"),
        (
            "spacing: 0.1",
            "spacing: 0.1\nartificial_viscosity: 7",
            "tank.yaml:3: artificial_viscosity: 7 is not known here; it can be signal, monaghan",
        ),
        (
            "spacing: 0.1",
            "spacing: 0.1\ndimensions: 4",
            "tank.yaml:3: dimensions: 4 is not known here; it can be 2, 3",
        ),
        (
            "spacing: 0.1",
            "spacing: 0.1\nallow: [low_sound_sped]",
            "tank.yaml:3: allow[0]: 'low_sound_sped' is not known here; did you mean 'low_sound_speed'?",
        ),
        (
            "sound_speed: 50.0",
            "sound_speed: 50.0, color: blue",
            "tank.yaml:4: materials.water.color: a colour such as \"#8a6a4a\" is needed, not 'blue'",
        ),
        (
            "name: pool",
            "name: my pool",
            "tank.yaml:9: fluids[0].name: a name made of letters, digits and _ is needed, not 'my pool'",
        ),
        (
            "[[0.0, 2.0], [0.0, 0.0], [3.0, 0.0], [3.0, 2.0]]",
            "[[0, 0]]",
            "tank.yaml:7: walls[0].path: needs 2 or more entries, not 1",
        ),
        (
            "end_time: 1.0",
            "end_time: 1.0, integrator: runge_kuta",
            "tank.yaml:14: run.integrator: 'runge_kuta' is not known here; did you mean 'runge_kutta'?",
        ),
        (
            "end_time: 1.0}",
            "end_time: 1.0, integrator: predictor_corrector}\n"
            "bodies:\n  - {name: log, density: 500, shape: {disc: {center: [1, 1], radius: 0.2}}}",
            "tank.yaml:14: run.integrator: predictor_corrector does not move bodies; take verlet or runge_kutta",
        ),
        (
            "spacing: 0.1",
            "spacing: 0.1\ndensity_filter: {model: mls, every: 0}",
            "tank.yaml:3: density_filter.every: must be more than 0, not 0",
        ),
        # names that lead nowhere
        (
            "material: water",
            "material: watr",
            "tank.yaml:10: fluids[0].material: no material named 'watr'; did you mean 'water'?",
        ),
        (
            "above: tank",
            "above: tonk",
            "tank.yaml:11: fluids[0].fill.above: no wall named 'tonk'; did you mean 'tank'?",
        ),
        (
            "{name: middle, x: 1.5}",
            "{name: middle, x: 1.5}\n  - {name: Middle, x: 2}",
            "tank.yaml:14: gauges[1].name: 'Middle' is the name of gauges[0] already",
        ),
        # shapes
        (
            "fill: {level: 1.0, above: tank}",
            "hold: false",
            "tank.yaml:9: fluids[0]: exactly one of shape, fill is needed, not none",
        ),
        (
            "fill: {level: 1.0, above: tank}",
            "shape: {disc: {center: [0, 0], radius: 1}, box: {min: [0, 0], max: [1, 1]}}",
            "tank.yaml:11: fluids[0].shape: exactly one of box, polygon, disc, sphere is needed, not box and disc",
        ),
        (
            "fill: {level: 1.0, above: tank}",
            "shape: {box: {min: [1, 0], max: [0, 1]}}",
            "tank.yaml:11: fluids[0].shape.box.max: must lie to the right of min and above it",
        ),
        (
            "above: tank}",
            "above: tank, between: [2, 1]}",
            "tank.yaml:11: fluids[0].fill.between: the first must be less than the second",
        ),
        (
            "above: tank}",
            "above: tank}\n    lattice: {angle: 30}",
            "tank.yaml:12: fluids[0].lattice: goes with a shape; a fill has a lattice of its own",
        ),
        (
            "above: tank}",
            "above: tank}\n    hold: true\n    velocity: [1, 0]",
            "tank.yaml:13: fluids[0].velocity: a held fluid starts at rest",
        ),
        (
            "[3.0, 2.0]]",
            "{at: [3.0, 2.0], radius: 1}]",
            "tank.yaml:7: walls[0].path[3]: the end of an open path is no corner; write it as [x, z]",
        ),
        (
            "walls:",
            "walls:\n  - {name: dome, arc: {center: [0, 0], radius: 1, start: 180, end: 0}}",
            "tank.yaml:6: walls[0].arc.end: must be more than start, and less than a whole turn beyond it",
        ),
        (
            "walls:",
            "walls:\n  - {name: ball, closed: true, disc: {center: [0, 0], radius: 1}}",
            "tank.yaml:6: walls[0].closed: only a path can be told to close",
        ),
        (
            "spacing: 0.1",
            "spacing: 0.1\noutput: {view: {x: [0, 1], z: [1, 0]}}",
            "tank.yaml:3: output.view.z: the first must be less than the second",
        ),
        # of the other number of dimensions
        (
            "spacing: 0.1",
            "spacing: 0.1\ndimensions: 3",
            "tank.yaml:7: walls[0].width: this field is missing, in a 3-D scene\n"
            "tank.yaml:14: gauges[0].y: this field is missing, in a 3-D scene",
        ),
        (
            "[3.0, 2.0]]",
            "[3.0, 2.0]]\n    width: [0, 1]",
            "tank.yaml:8: walls[0].width: means nothing in a 2-D scene; it goes with 'dimensions: 3'",
        ),
        (
            "walls:",
            "walls:\n  - {name: lid, box: {min: [0, 0], max: [1, 1], open: [top]}}",
            "tank.yaml:6: walls[0].box.open: means nothing in a 2-D scene; it goes with 'dimensions: 3'",
        ),
        (
            "walls:",
            "walls:\n  - {name: lid, box: {min: [0, 0], max: [1, 1, 1]}}",
            "tank.yaml:6: walls[0].box.max: two numbers are needed in a 2-D scene, not 3",
        ),
        (
            "walls:",
            "walls:\n  - {name: lid, box: {min: [0], max: [1, 1]}}",
            "tank.yaml:6: walls[0].box.min: two numbers [a, b] (three in a 3-D scene) are needed, not 1",
        ),
        (
            "fill: {level: 1.0, above: tank}",
            "shape: {sphere: {center: [0, 0, 0], radius: 1}}",
            "tank.yaml:11: fluids[0].shape.sphere: means nothing in a 2-D scene; it goes with 'dimensions: 3'",
        ),
        (
            "above: tank}",
            "above: tank}\n    velocity: [1, 0, 0]",
            "tank.yaml:12: fluids[0].velocity: two numbers are needed in a 2-D scene, not 3",
        ),
        (
            "x: 1.5",
            "x: 1.5, y: 0",
            "tank.yaml:13: gauges[0].y: means nothing in a 2-D scene; it goes with 'dimensions: 3'",
        ),
        # viscosity
        (
            "50.0}",
            "50.0, dynamic_viscosity: -1}",
            "tank.yaml:4: materials.water.dynamic_viscosity: must be at least 0, not -1",
        ),
        (
            "50.0}",
            "50.0, rheology: {law: bingham, consistency: 1, yield_stress: 5}}",
            "tank.yaml:4: materials.water.rheology.viscosity_max: this field is missing: without it the "
            "viscosity of bingham has no limit at rest",
        ),
        (
            "50.0}",
            "50.0, rheology: {law: bingham, consistency: 1, viscosity_max: 5}}",
            "tank.yaml:4: materials.water.rheology.yield_stress: this field is missing: bingham needs it",
        ),
        (
            "50.0}",
            "50.0, rheology: {law: bingham, consistency: 1, yield_stress: 5, viscosity_max: 0.5}}",
            "tank.yaml:4: materials.water.rheology.viscosity_max: must be at least the consistency, 1 Pa s",
        ),
        (
            "50.0}",
            "50.0, rheology: {law: bingham, consistency: 1, yield_stress: 5, viscosity_max: 9, exponent: 2}}",
            "tank.yaml:4: materials.water.rheology.exponent: goes with power_law and herschel_bulkley, "
            "not with bingham",
        ),
        (
            "50.0}",
            "50.0, rheology: {law: power_law, consistency: 1, exponent: 2}}",
            "tank.yaml:4: materials.water.rheology.viscosity_max: this field is missing: without it the "
            "viscosity of power_law has no limit in fast flow",
        ),
        (
            "50.0}",
            "50.0, rheology: {law: newtonian, consistency: 1, regularisation: cross}}",
            "tank.yaml:4: materials.water.rheology.regularisation: goes with a yield stress, which newtonian has not",
        ),
        (
            "50.0}",
            "50.0, dynamic_viscosity: 1, rheology: {law: newtonian, consistency: 1}}",
            "tank.yaml:4: materials.water.dynamic_viscosity: the rheology has the viscosity; leave one of the two out",
        ),
        (
            "title: A tank",
            "title: A tank\nviscosity: {stages: 2}",
            "tank.yaml:2: viscosity.stages: two stages take no longer a step than one; 1, or 3 and more",
        ),
        (
            "title: A tank",
            "title: A tank\nwall_model: {force: radial}\nshifting: {model: fickian, velocity: local}",
            "tank.yaml:3: shifting.velocity: local needs a fluid with a viscosity of its own",
        ),
        (
            "title: A tank",
            "title: A tank\nviscosity: {form: cleary, weights: balanced}",
            "tank.yaml:2: viscosity.weights: balanced goes with morris and stress, not with cleary",
        ),
        # YAML
        ("[3.0, 2.0]]", "[3.0, 2.0]", "tank.yaml:8: not YAML: expected ',' or ']', but got '<scalar>'"),
        ("title: A tank", "title: !tag A tank", "tank.yaml:1: title: the tag !tag means nothing here"),
        ("title: A tank", "title: &a [*a]", "tank.yaml:1: title[0]: refers to itself"),
        (
            "run: {end_time: 1.0}",
            "run: {end_time: 1.0}\n---\ntitle: another",
            "tank.yaml:15: not YAML: but found another document",
        ),
    ],
)
def test_a_mistake_is_one_clear_line(load, old, new, words):
    assert old in TANK
    assert message(load, TANK.replace(old, new, 1)) == words


def test_one_regularisation_for_all(load):
    mud = (
        "density: 1000.0, sound_speed: 50.0, rheology: {law: bingham, consistency: 1, yield_stress: 1, viscosity_max: 9"
    )
    text = TANK.replace("materials:", f"materials:\n  mud: {{{mud}, regularisation: cross}}}}\n  clay: {{{mud}}}}}")
    words = (
        "materials.clay.rheology.regularisation: one for all materials of a scene is needed, and another one has cross"
    )
    assert message(load, text, "wall_model.force=radial") == f"tank.yaml:5: {words}"


BOX = """\
title: A box
dimensions: 3
spacing: 0.1
materials:
  water: {density: 1000.0, sound_speed: 50.0}
walls:
  - {name: tank, box: {min: [0, 0, 0], max: [3, 1, 2], open: [top]}}
  - {name: ramp, path: [[2.0, 0.0], [3.0, 1.0]], width: [0, 1]}
fluids:
  - {name: pool, material: water, fill: {level: 1.0, above: tank}}
  - {name: ball, material: water, shape: {sphere: {center: [1, 0.5, 1.5], radius: 0.2}}, velocity: [1, 0, 0]}
  - name: bar
    material: water
    shape: {disc: {center: [1, 1.5], radius: 0.1}, width: [0, 1]}
    lattice: {origin: [0, 0, 0]}
gauges:
  - {name: middle, x: 1.5, y: 0.5}
run: {end_time: 1.0}
"""


def test_a_scene_in_space(load):
    scene = load(BOX)
    assert scene.walls[0].box.max == (3.0, 1.0, 2.0) and scene.walls[0].box.open == ("top",)
    assert scene.walls[1].width == (0.0, 1.0)
    assert scene.fluids[0].velocity == (0.0, 0.0, 0.0)  # at rest, when nothing is said
    assert scene.fluids[1].velocity == (1.0, 0.0, 0.0)
    text = scene.resolved_yaml()
    assert load(text) == scene
    assert load(text).resolved_yaml() == text


def test_a_plane_scene_is_resolved_as_ever(load):
    text = load(TANK).resolved_yaml()
    assert "velocity: [0.0, 0.0]" in text
    for word in ("width", "open", "sphere", " y:"):
        assert word not in text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "min: [0, 0, 0]",
            "min: [0, 0]",
            "tank.yaml:7: walls[0].box.min: three numbers are needed in a 3-D scene, not 2",
        ),
        (
            "max: [3, 1, 2]",
            "max: [3, 0, 2]",
            "tank.yaml:7: walls[0].box.max: must lie to the right of min, behind it and above it",
        ),
        (
            "open: [top]",
            "open: [tip]",
            "tank.yaml:7: walls[0].box.open[0]: 'tip' is not known here; did you mean 'top'?",
        ),
        (
            "open: [top]",
            "open: [left, right, front, back, bottom, top]",
            "tank.yaml:7: walls[0].box.open: a box without any face is no wall",
        ),
        (
            "open: [top]}",
            "open: [top]}, width: [0, 1]",
            "tank.yaml:7: walls[0].width: a box has its width in min and max",
        ),
        (", width: [0, 1]}\nf", "}\nf", "tank.yaml:8: walls[1].width: this field is missing, in a 3-D scene"),
        ("width: [0, 1]", "width: [1, 0]", "tank.yaml:8: walls[1].width: the first must be less than the second"),
        ("[2.0, 0.0]", "[2.0, 0.0, 0.0]", "tank.yaml:8: walls[1].path[0]: two numbers [a, b] are needed, not 3"),
        (
            "center: [1, 0.5, 1.5]",
            "center: [1, 0.5]",
            "tank.yaml:11: fluids[1].shape.sphere.center: three numbers [x, y, z] are needed, not 2",
        ),
        (
            "radius: 0.2}",
            "radius: 0.2}, width: [0, 1]",
            "tank.yaml:11: fluids[1].shape.width: a sphere has no other width",
        ),
        (
            "velocity: [1, 0, 0]",
            "velocity: [1, 0]",
            "tank.yaml:11: fluids[1].velocity: three numbers are needed in a 3-D scene, not 2",
        ),
        (
            "radius: 0.1}, width: [0, 1]",
            "radius: 0.1}",
            "tank.yaml:14: fluids[2].shape.width: this field is missing, in a 3-D scene",
        ),
        (
            "origin: [0, 0, 0]",
            "origin: [0, 0]",
            "tank.yaml:15: fluids[2].lattice.origin: three numbers are needed in a 3-D scene, not 2",
        ),
        (", y: 0.5", "", "tank.yaml:17: gauges[0].y: this field is missing, in a 3-D scene"),
        (
            "dimensions: 3",
            "dimensions: 2",
            "tank.yaml:7: walls[0].box.min: two numbers are needed in a 2-D scene, not 3",
        ),
    ],
)
def test_a_mistake_in_space_is_one_clear_line(load, old, new, words):
    assert old in BOX
    assert message(load, BOX.replace(old, new, 1)).splitlines()[0] == words


def test_all_mistakes_are_told_in_the_order_of_the_document(load):
    text = TANK.replace("end_time: 1.0", "end_time: -1").replace("density: 1000.0", "density: heavy")
    text = text.replace("x: 1.5", "y: 2, colour: red").replace("material: water", "materiel: water")
    assert message(load, text, "xsph=2", "spaceing=0.1").splitlines() == [
        "tank.yaml:4: materials.water.density: a number is needed, not 'heavy'",
        "tank.yaml:10: fluids[0].materiel: no such field; did you mean 'material'?",
        "tank.yaml:13: gauges[0].x: this field is missing",
        "tank.yaml:13: gauges[0].colour: no such field; it can be name, x, y, bottom, observed",
        "tank.yaml:14: run.end_time: must be more than 0, not -1",
        "--set xsph=2: xsph: must be at most 1, not 2",
        "--set spaceing=0.1: spaceing: no such field; did you mean 'spacing'?",
    ]


def test_what_does_not_hold_together_is_told_at_once(load):
    text = TANK.replace("material: water", "material: watr").replace("above: tank", "above: tonk")
    assert [line.partition("; ")[0] for line in message(load, text).splitlines()] == [
        "tank.yaml:10: fluids[0].material: no material named 'watr'",
        "tank.yaml:11: fluids[0].fill.above: no wall named 'tonk'",
    ]


def test_more_mistakes_than_are_read_are_counted(load):
    text = TANK.replace("{name: middle, x: 1.5}", "\n  - ".join(["{x: 1}"] * 20))
    told = message(load, text).splitlines()
    assert len(told) == 13 and told[-1] == "and 8 mistakes more"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("spacing: 0.1", "spacing: 1e300", "tank.yaml:2: spacing: must be at most 10000, not 1e+300"),
        ("spacing: 0.1", "spacing: 5e-324", "tank.yaml:2: spacing: must be at least 1e-06, not 5e-324"),
        (
            "above: tank}",
            "above: tank}\n    velocity: [1e300, 0]",
            "tank.yaml:12: fluids[0].velocity[0]: must be at most 1e+08, not 1e+300",
        ),
        (
            "50.0}",
            "50.0, dynamic_viscosity: 1e300}",
            "tank.yaml:4: materials.water.dynamic_viscosity: must be at most 1e+12, not 1e+300",
        ),
        (
            "50.0}",
            "50.0, dynamic_viscosity: 1e-300}",
            "tank.yaml:4: materials.water.dynamic_viscosity: must be 0, or at least 1e-12, not 1e-300",
        ),
        (
            "end_time: 1.0}",
            "end_time: 5}\noutput: {frames_per_second: 1e6}",
            "tank.yaml:15: output.frames_per_second: makes 5.0e+06 frames until 5 s; 1,000,000 is the most",
        ),
        (
            "end_time: 1.0}",
            "end_time: 1}\noutput: {frames_per_second: 1e9}",
            "tank.yaml:15: output.frames_per_second: must be at most 1e+06, not 1000000000.0",
        ),
        ("A tank", '"\\ud800"', "tank.yaml:1: title: text without half letters is needed, not '\\ud800'"),
        ("A tank", '"a\\0b"', "tank.yaml:1: title: has the letter '\\x00', which cannot be printed"),
        ("A tank", '"a\\nb"', "tank.yaml:1: title: must be one line"),
        ("name: pool", f"name: {'p' * 65}", "tank.yaml:9: fluids[0].name: is longer than 64 letters"),
        (
            "  - {name: middle, x: 1.5}",
            "\n".join(f"  - {{name: g{i}, x: 1}}" for i in range(501)),
            "tank.yaml:12: gauges: has more than 500 entries, which is the most",
        ),
    ],
)
def test_absurd_numbers_and_words_are_refused_where_they_stand(load, old, new, words):
    assert old in TANK
    assert message(load, TANK.replace(old, new, 1)) == words


def test_refusals_are_short(load):
    long = "x" * 5000
    for text in (
        TANK.replace("A tank", f"[{long}]"),
        TANK.replace("tank}", f"{long}}}"),
        TANK.replace("sound_speed", long),
        TANK + f"{long}: 1\n",
        TANK + f"viscosity: {long}\n",
    ):
        assert len(message(load, text)) < 600
    assert len(message(load, TANK, f"spacing={long}")) < 300


@pytest.mark.parametrize(
    ("field", "words"),
    [
        ("gauges[0].observed={file: FILE, columns: [t, h]}", "gauges[0].observed.file"),
        ("wave_maker={waves: table, x: 0.0, depth: 0.4, file: FILE}", "wave_maker.file"),
        ("bodies=[{name: b, mass: 1, shape: {path: []}, motion: {kind: table, file: FILE}}]", "bodies[0].motion.file"),
    ],
)
def test_a_name_that_no_file_can_have(load, field, words):
    assert f"{words}: has the letter" in message(load, TANK, field.replace("FILE", r'"\0"'))
    assert "half letters" in message(load, TANK, field.replace("FILE", r'"\ud800"'))


def test_a_direction_next_to_nothing_is_none(load):
    mirror = "images=[{name: a, mirror: {point: [0, 0], normal: [0, 5e-324]}}]"
    assert "images[0].mirror.normal: has no direction" in message(load, TANK, mirror)
    edges = "images=[{name: a, periodic: {start: [0, 0], end: [5e-324, 0]}}]"
    assert "images[0].periodic.end: must not be start" in message(load, TANK, edges)
    line = "overtopping=[{name: a, start: [1, 0], end: [1, 1e-12]}]"
    assert "overtopping[0].end: must not be start" in message(load, TANK, line)


def test_waves_need_gravity(load):
    waves = "wave_maker={waves: regular, x: 0.0, depth: 1.0, height: 0.1, period: 1.0}"
    assert "gravity: must be more than 0 where waves are made" in message(load, TANK, waves, "gravity=0")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "tank.yaml: the file is empty"),
        ("# nothing but words\n", "tank.yaml: the file is empty"),
        ("- a\n- b\n", "tank.yaml:1: a scene is a mapping of fields, not a list"),
        ("just words", "tank.yaml:1: a scene is a mapping of fields, not 'just words'"),
        ("title: a\n\tspacing: 1\n", "tank.yaml:2: not YAML: found character '\\t' that cannot start any token"),
        ("[" * 5000, "tank.yaml: nested too deeply to be a scene"),
        ("a: 1 # " + "x" * 1_000_000, "tank.yaml: longer than 1,000,000 letters; is it a scene?"),
        (
            "a: &a [1,1,1,1,1,1,1,1,1,1]\n"
            + "".join(f"{b}: &{b} [{','.join([f'*{a}'] * 10)}]\n" for a, b in pairwise("abcdefgh")),
            "tank.yaml: more than 100,000 values; is it a scene?",
        ),
    ],
)
def test_a_file_that_is_no_scene(load, text, words):
    assert message(load, text) == words


def test_libyaml_and_pyyaml_read_the_same(monkeypatch):
    """Values, and the lines that they stand in."""
    texts = [path.read_text(encoding="utf-8") for path in SCENES]
    texts.append("a: [1, 1e-3, '2', yes, ~, |\n x\n]".replace("|\n x\n", "") + "\nb: &x {c: .inf}\nd: *x\n")
    quick = [read_yaml(text, "file") for text in texts]
    monkeypatch.delattr(yaml, "CSafeLoader", raising=False)
    slow = [read_yaml(text, "file") for text in texts]
    for (data, source), (other, other_source) in zip(quick, slow, strict=True):
        assert data == other and source.places == other_source.places


@pytest.mark.skipif(not hasattr(yaml, "CSafeLoader"), reason="needs libyaml")
def test_a_text_of_too_many_values_is_refused_in_seconds(load):
    text = "a:\n" + "".join(f"- [{i}, {i}]\n" for i in range(40_000))
    began = time.process_time()
    assert message(load, text) == "tank.yaml: more than 100,000 values; is it a scene?"
    assert time.process_time() - began < 5.0  # 1.7 s, and 9 s without libyaml


@pytest.mark.skipif(not hasattr(yaml, "CSafeLoader"), reason="needs libyaml")
@pytest.mark.parametrize(("key", "count"), [("walls", 10_000), ("fluids", 1_000), ("bodies", 9_000)])
def test_more_of_a_kind_than_there_may_be_is_refused_in_seconds(load, key, count):
    text = TANK.replace(f"\n{key}:", "\nold_ones:") + f"{key}:\n"
    text += "".join(f"- {{name: n{i}, path: [[0, 0], [1, 0]]}}\n" for i in range(count))
    began = time.process_time()
    told = message(load, text)
    assert key in told and told.count("\n") <= 13  # the first mistakes, of which this may be one
    assert time.process_time() - began < 10.0


def test_a_file_that_cannot_be_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("scenes").mkdir()
    Path("scenes/landslide.yaml").write_text(TANK)
    Path("picture.yaml").write_bytes(b"\x89PNG\xff\xfe")
    for path, words in (
        (
            "scenes/landslid.yaml",
            f"scenes/landslid.yaml: no such file; did you mean '{Path('scenes/landslide.yaml')}'?",
        ),
        ("nowhere/to.yaml", "nowhere/to.yaml: no such file"),
        ("scenes", "scenes: a folder, not a scene file"),
        ("picture.yaml", "picture.yaml: not text in UTF-8"),
    ):
        with pytest.raises(SceneError) as caught:
            load_scene(path)
        assert str(caught.value) == words


def test_overrides(load):
    scene = load(
        TANK,
        "materials.water.alpha=0.03",
        "fluids[0].hold=true",
        "smoothing.ratio=2",
        "walls[0].path[3][1]=1e1",
        "xsph = 0",
    )
    assert scene.materials["water"].alpha == 0.03
    assert scene.fluids[0].hold
    assert scene.smoothing.ratio == 2.0
    assert scene.walls[0].path[3] == (3.0, 10.0)
    assert scene.xsph == 0.0
    assert load(TANK, "fluids[0].fill={level: 0.5, above: tank}").fluids[0].fill.level == 0.5


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("spacing=-1", "--set spacing=-1: spacing: must be more than 0, not -1"),
        ("spacing=", "--set spacing=: spacing: a number is needed, not nothing"),
        ("spacing", "--set spacing: a path and a value are needed, such as fluids[0].hold=false"),
        ("=1", "--set =1: a path and a value are needed, such as fluids[0].hold=false"),
        ("spacing=[1", "--set spacing=[1: spacing: the value is not YAML"),
        ("spaceing=1", "--set spaceing=1: spaceing: no such field; did you mean 'spacing'?"),
        ("smoothing.ration=2", "--set smoothing.ration=2: smoothing.ration: no such field; did you mean 'ratio'?"),
        ("warm_up.duration=1", "--set warm_up.duration=1: warm_up.damping: this field is missing"),
        ("run={courant: 0.4}", "--set run={courant: 0.4}: run.end_time: this field is missing"),
        (
            "materials.watr.alpha=0.1",
            "--set materials.watr.alpha=0.1: materials.watr.alpha: no material named 'watr'; did you mean 'water'?",
        ),
        ("fluids[1].hold=true", "--set fluids[1].hold=true: fluids[1].hold: fluids has 1 entry, counted from 0"),
        ("spacing[0]=1", "--set spacing[0]=1: spacing[0]: spacing is not a list"),
        ("spacing.x=1", "--set spacing.x=1: spacing.x: spacing is not a mapping of fields"),
    ],
)
def test_a_mistaken_override_is_named(load, override, words):
    assert message(load, TANK, override) == words


def test_the_file_comes_before_the_overrides(load):
    text = TANK.replace("end_time: 1.0", "end_time: -1")
    assert message(load, text, "spacing=-1").splitlines() == [
        "tank.yaml:14: run.end_time: must be more than 0, not -1",
        "--set spacing=-1: spacing: must be more than 0, not -1",
    ]


def test_an_error_about_a_default_points_at_what_is_around_it(load):
    scene = load(TANK)
    assert str(scene.error("fluids[0].clearance", "too small")) == "tank.yaml:9: fluids[0].clearance: too small"
    assert str(scene.error("smoothing.ratio", "too small")) == "tank.yaml:1: smoothing.ratio: too small"


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_resolved_scene_loads_back_equal(path, load):
    scene = load_scene(path)
    text = scene.resolved_yaml()
    assert load(text) == scene
    assert load(text).resolved_yaml() == text
    assert scene.source, "every scene names its source"


def test_equal_scenes_may_come_from_different_lines(load):
    assert load(TANK) == load("# a comment\n" + TANK)
    assert load(TANK) != load(TANK, "spacing=0.05")


def test_a_scene_does_not_change(load):
    with pytest.raises(ValueError, match="frozen"):
        load(TANK).spacing = 1.0


def test_the_schema_describes_every_field():
    schema = json_schema()
    for part in (schema, *schema["$defs"].values()):
        assert part["additionalProperties"] is False
        for name, field in part["properties"].items():
            # A description that a field shares with its type is kept at the type alone.
            kind = schema["$defs"].get(field.get("$ref", "").removeprefix("#/$defs/"), {})
            assert field.get("description") or kind.get("description"), f"{part['title']}.{name}"


def test_the_manual_names_every_field():
    schema = json_schema()
    for part in (schema, *schema["$defs"].values()):
        for name in part["properties"]:
            assert re.search(rf"[`{{ ]{name}[`:]", MANUAL), f"{part['title']}.{name}"


def test_the_scenes_of_the_manual_load(load):
    plane, space, walls, images, bodies, waves, instruments = re.findall(r"```yaml\n(.*?)```", MANUAL, re.DOTALL)
    assert len(place(load(plane)).position) == 50 * 15
    assert [image.name for image in load(plane + images, "wall_model.force=radial").images] == ["bed", "along"]
    assert [solid.body.name for solid in place(load(plane + bodies)).solids] == ["crate", "paddle"]
    flume = re.sub(r"walls:\n.*\nfluids:\n.*\n", waves, plane)
    assert load(flume).bodies[-1].name == "paddle" and load(flume).damping_zones[0].name == "sponge"
    measured = plane + bodies.replace("crate", "box") + instruments.replace("flume", "tank")
    assert [load(measured).probes[1].body, load(measured).run_up[0].wall] == ["box", "tank"]
    assert len(place(load(space)).position) == 25 * 10 * 10
    flume = re.sub(r"walls:\n.*\n", walls, space).replace("above: tank", "above: flume")
    placement = place(load(flume, "spacing=0.03"))  # a third of the particles to pack
    across = placement.position[:, 1]
    assert 0.0 < across.min() < across.max() < 0.3 and not placement.warnings
