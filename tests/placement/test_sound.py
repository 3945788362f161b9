"""A speed of sound that a scene leaves out is ten times the greatest speed that its drawing tells of."""

import math

import pytest

from warpsph.placement.sound import chosen_sound, with_sound
from warpsph.scene.loading import load_scene
from warpsph.scene.source import SceneError

G, DEPTH, FLOOR = 9.81, 0.3, -0.1

TANK = f"""
title: A tank
spacing: 0.05
materials: {{water: {{density: 1000.0}}}}
walls: [{{name: tank, path: [[0.0, 0.5], [0.0, {FLOOR}], [1.0, {FLOOR}], [1.0, 0.5]]}}]
fluids: [{{name: water, material: water, fill: {{level: {FLOOR + DEPTH}, above: tank}}}}]
run: {{end_time: 0.1}}
"""


def fastest(scene):
    return with_sound(scene).materials["water"].sound_speed / 10.0


def test_it_is_that_of_a_fall_from_the_top_to_the_bed(make_scene):
    assert fastest(make_scene(TANK)) == pytest.approx(math.sqrt(2.0 * G * DEPTH), rel=0.01)
    assert "drop of 0.3 m" in chosen_sound(make_scene(TANK))["water"].why


def test_it_counts_a_start_and_a_body_that_is_moved(make_scene):
    drop = "[{name: drop, material: water, velocity: [3.0, 0.0], shape: {disc: {center: [0.5, 0.3], radius: 0.1}}}]"
    started = math.sqrt(2.0 * G * (0.4 - FLOOR) + 3.0**2)
    assert fastest(make_scene(TANK, f"fluids={drop}")) == pytest.approx(started, rel=0.01)
    ram = "{name: ram, density: 500.0, shape: {box: {min: [0.4, 0.2], max: [0.6, 0.4]}}, "
    ram += "motion: {kind: sine, shift: [0.1, 0.0], period: 0.05}}"
    scene = make_scene(TANK, f"bodies=[{ram}]")
    assert fastest(scene) == pytest.approx(0.1 * 2.0 * math.pi / 0.05, rel=0.02)


def test_a_light_fluid_is_stiff_enough_for_a_heavy_one(make_scene):
    materials = "{water: {density: 1000.0}, gas: {density: 10.0}}"
    gas = "{name: gas, material: gas, shape: {box: {min: [0.0, 0.2], max: [1.0, 0.4]}}}"
    water = "{name: water, material: water, fill: {level: 0.2, above: tank}}"
    chosen = chosen_sound(make_scene(TANK, f"materials={materials}", f"fluids=[{water}, {gas}]"))
    assert chosen["gas"].advised == pytest.approx(math.sqrt(50.0 * 1000.0 * G * 0.5 / 10.0), rel=0.01)
    assert chosen["water"].advised < chosen["gas"].advised


def test_what_is_given_stays_and_what_is_chosen_loads_back(make_scene, tmp_path):
    given = make_scene(TANK, "materials.water.sound_speed=40")
    assert with_sound(given) is given
    scene = with_sound(make_scene(TANK))
    again = tmp_path / "again.yaml"
    again.write_text(scene.resolved_yaml(), encoding="utf-8")
    assert load_scene(again) == scene


@pytest.mark.parametrize(
    ("override", "why"), [("body_force=[1.0, 0.0]", "a body force drives"), ("gravity=0", "nothing in this scene")]
)
def test_it_is_asked_for_where_nothing_tells(make_scene, override, why):
    with pytest.raises(SceneError, match=f"water.sound_speed: is needed: {why}"):
        with_sound(make_scene(TANK, override))
