"""Inputs that went wrong once, tests/cases/README.md: each row right, for the sake of its kind."""

import json
import logging
import re
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from warpsph.bodies.motion import read_table
from warpsph.cli import INPUT, OK, SCENES, main
from warpsph.output.records import read_record
from warpsph.placement.place import place
from warpsph.scene.loading import load_scene
from warpsph.scene.source import SceneError
from warpsph.shapes.mesh import read_mesh, solid_mass

CASES = Path(__file__).parent / "cases"
PADDLE = [
    "walls[0].path=[[-1.0, 0.6], [-1.0, 0.0], [3.0, 0.0], [3.0, 0.6]]",
    "spacing=0.04",
    "fluids[0].fill.level=0.32",
]


def test_each_row_is_held_by_tests_that_there_are():
    held = [line.split("|")[-2] for line in (CASES / "README.md").read_text().splitlines() if line.startswith("| ")]
    names = [name for cell in held for name in re.findall(r"`([\w/]*(?:\.py)?(?:::)?\w*)`", cell) if "test" in name]
    assert len(names) > 40
    for name in names:
        file, _, function = name.rpartition("::")
        path, function = (name, "") if name.endswith(".py") else (file or "test_cases.py", function)
        assert f"def {function}" in (CASES.parent / path).read_text(encoding="utf-8"), name


def paddle(file: str):
    return load_scene(CASES / "paddle_csv" / "paddle.yaml", [*PADDLE, f"bodies[0].motion.file={file}"])


def error_of(scene) -> str:
    with pytest.raises(SceneError) as caught:
        place(scene)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 600
    return str(caught.value)


def test_a_splash_leaves_and_the_run_goes_on(tmp_path):
    splash = ["scene", str(CASES / "overflow" / "splash.yaml"), "--out", str(tmp_path / "run"), "--threads", "1"]
    assert main([*splash, "--set", "output.pictures=false", "--until", "0.2"]) == OK
    facts = json.loads((tmp_path / "run" / "run.json").read_text())
    assert facts["outcome"] == "done" and facts["left"]["particles"] > 0
    assert facts["conservation"]["mass / mass placed"] == pytest.approx(1.0, abs=1e-6)


def test_a_paddle_that_rests_rests():
    table = read_table(CASES / "paddle_csv" / "wait_then_push.csv")
    assert (table.shift.min(), table.shift.max()) == (0.0, pytest.approx(0.1))
    rates, steps = table.rates()[0][:, 0], np.diff(table.shift[:, 0]) / np.diff(table.time)
    for k, step in enumerate(steps):  # Fritsch & Carlson (1980): monotone if both rates are within 0 and 3 slopes
        assert all(0.0 <= rate * np.sign(step) <= 3.0 * abs(step) for rate in rates[k : k + 2])


def test_a_table_that_begins_elsewhere_is_counted_from_its_first_row():
    placement = place(paddle("offset.csv"))
    assert placement.solids[0].body.motion.table.shift[0, 0] == 0.0
    assert any("its first row has x = 0.5 m, from which it is counted" in warning for warning in placement.warnings)


def test_a_jump_is_refused_with_its_row():
    told = error_of(paddle("jump.csv"))
    assert "bodies[0].motion.file" in told and "jump.csv:4: gets to this row with 500 m/s, faster than sound" in told


@pytest.mark.parametrize("file", ["semicolon.csv", "excel_de.csv"])
def test_a_german_spreadsheet_is_read(file):
    table = read_table(CASES / "paddle_csv" / file)
    assert table.time[1] == pytest.approx(0.05) and table.shift[1, 0] == pytest.approx(0.00618)
    place(paddle(file))


def test_millimetres_are_told_at_once():
    began = time.process_time()
    scene = load_scene(CASES / "stl" / "box.yaml", ["bodies[0].shape.mesh={file: cube_mm.stl}"])
    assert "it is 200 m wide, and the walls 0.6 m; millimetres? scale: 0.001" in error_of(scene)
    assert time.process_time() - began < 10.0


def test_a_mesh_far_away_is_told():
    scene = load_scene(CASES / "stl" / "box.yaml", ["bodies[0].at=[5000, 0.3, 0.4]"])
    assert "m from the walls, around x = 5000 m" in error_of(scene)


@pytest.mark.parametrize(("file", "welded"), [("cube_mm_ascii.stl", False), ("cube_jitter.stl", True)])
def test_what_cad_writes_is_read_without_noise(file, welded, caplog, monkeypatch):
    monkeypatch.setattr(logging.getLogger("warpsph"), "propagate", True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = read_mesh(CASES / "stl" / file)
    assert (len(mesh.vertices), len(mesh.triangles)) == (8, 12)
    assert solid_mass(mesh, density=1.0).mass == pytest.approx(np.prod(np.ptp(mesh.vertices, axis=0)), rel=1e-4)
    assert ("are welded to them" in caplog.text) == welded


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda data: data[:400], "is cut: it tells of 12 triangles, and 6 are there"),
        (lambda data: bytes(range(256)) * 4, "not a mesh that can be read"),
        (lambda data: b"", "not a mesh that can be read|there are no triangles"),
    ],
)
def test_a_mesh_that_was_cut_or_damaged_is_told(spoil, words, tmp_path):
    (tmp_path / "cube.stl").write_bytes(spoil((CASES / "stl" / "cube_mm.stl").read_bytes()))
    with pytest.raises(ValueError, match=words) as caught:
        read_mesh(tmp_path / "cube.stl")
    assert "module" not in str(caught.value)


def test_a_mesh_that_takes_seconds_is_spoken_of(monkeypatch, capsys):
    monkeypatch.setattr("warpsph.shapes.mesh.MANY", 11)
    file = CASES / "stl" / "cube_mm.stl"
    box = ["check", str(CASES / "stl" / "box.yaml"), "--set", f"bodies[0].shape.mesh={{file: {file}, scale: 0.002}}"]
    assert main([*box, "--set", "bodies[0].at=[9e3, 0, 0]"]) == INPUT
    assert capsys.readouterr().err.startswith(f"{file}: looking whether its 12 triangles bound a solid\n")


def test_a_ball_of_triangles_is_placed_in_a_moment():
    ball = load_scene(CASES / "stl" / "ball.yaml", ["wall_model={}"])
    place(ball)  # compiles what it takes, which is not timed
    began = time.process_time()
    placement = place(ball)
    assert placement.solids[0].body.mass.mass == pytest.approx(500.0 * 4.0 / 3.0 * np.pi * 0.1**3, rel=0.05)
    assert time.process_time() - began < 10.0


@pytest.mark.slow
def test_a_hundred_thousand_triangles_are_placed_in_seconds(tmp_path):
    ball = trimesh.creation.uv_sphere(radius=100.0, count=[80, 320])
    ball.export(tmp_path / "fine.stl")
    scene = load_scene(CASES / "stl" / "ball.yaml", ["wall_model={}", f"bodies[0].shape.mesh.file={tmp_path}/fine.stl"])
    place(load_scene(CASES / "stl" / "ball.yaml", ["wall_model={}"]))  # compiles what it takes, which is not timed
    began = time.process_time()
    placement = place(scene)
    assert time.process_time() - began < 20.0  # 6 s; of the whole of `check` 17
    assert placement.solids[0].body.mass.mass == pytest.approx(500.0 * 4.0 / 3.0 * np.pi * 0.1**3, rel=1e-3)
    radius = np.linalg.norm(placement.solids[0].body.surface.points - [0.3, 0.3, 0.4], axis=1)
    assert radius.max() == pytest.approx(0.08, rel=0.01)


def test_air_that_cannot_carry_water_is_refused_with_what_can():
    air = CASES / "two_fluids" / "air_above.yaml"
    told = error_of(load_scene(air))
    assert "materials.oil.sound_speed: 25 m/s is too low to carry 0.195 m of 'water'" in told
    least = float(told.split("at least ")[1].split()[0])
    placement = place(load_scene(air, [f"materials.oil.sound_speed={least}"]))
    assert any("is low to carry" in warning for warning in placement.warnings)


@pytest.mark.parametrize(("c", "words"), [(20, "too low for a drop"), (23, "low for a drop"), (31, "low for a drop")])
def test_sound_that_an_impact_outruns_is_told(c, words):
    scene = load_scene(CASES / "impact" / "impact.yaml", [f"materials.water.sound_speed={c}", "spacing=0.04"])
    told = error_of(scene) if c == 20 else " ".join(place(scene).warnings)
    assert words in told and "advised" in told


def test_an_impact_stays_within_its_walls(tmp_path):
    """With so low a speed of sound the jet once went through the corner at every spacing."""
    impact = ["scene", str(CASES / "impact" / "impact.yaml"), "--out", str(tmp_path / "run"), "--threads", "1"]
    assert main([*impact, "--set", "materials.water.sound_speed=23", "--set", "spacing=0.05", "--until", "1"]) == OK
    facts = json.loads((tmp_path / "run" / "run.json").read_text())
    assert facts["outcome"] == "done" and facts["particles behind walls"] == 0


@pytest.mark.parametrize("name", ["dam_break", "still_water", "viscous_dam_break"])
def test_gravity_that_sound_cannot_carry_is_refused(name):
    told = error_of(load_scene(SCENES / f"{name}.yaml", ["gravity=100"]))
    assert "is too low for a drop" in told
    least = told.split("at least ")[1].split()[0]
    material = told.split("materials.")[1].split(".")[0]
    place(load_scene(SCENES / f"{name}.yaml", ["gravity=100", f"materials.{material}.sound_speed={least}"]))


def test_a_shallow_layer_rests_from_the_start(tmp_path):
    wet = ["scene", str(CASES / "wet_bed" / "wet.yaml"), "--out", str(tmp_path / "run"), "--threads", "1"]
    assert main([*wet, "--set", "output.pictures=false", "--until", "0.2"]) == OK
    record = read_record(tmp_path / "run" / "fluids" / "wet.csv")
    assert record["top speed [m/s]"].max() < 1e-2 * np.sqrt(9.81 * 0.05)
    assert read_record(tmp_path / "run" / "gauges" / "g.csv")["level [m]"] == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "drawn"),
    [
        ("vee", [[-0.096, 0.4], [0.0, 0.0], [0.096, 0.4]]),
        ("reservoir", [[-0.25, 0.5], [0, 0], [0.6, 0], [0.5, 0.2], [0.8, 0.25], [1.2, 0.1], [1.2 + 0.8 * 4 / 7, 0.5]]),
    ],
)
def test_a_fill_between_slopes_has_the_mass_of_the_drawing(name, drawn):
    placement = place(load_scene(CASES / "corners" / f"{name}.yaml"))
    x, z = np.array(drawn).T
    area = 0.5 * abs(x @ np.roll(z, 1) - z @ np.roll(x, 1))
    assert placement.volume[0] * len(placement.position) == pytest.approx(area, rel=1e-3)


def test_a_gauge_sees_as_high_as_water_runs_up(tmp_path, capsys):
    """It once stuck at 0.51 m, 1.5 times the highest particle of the start and 4 spacings."""
    bore = ["scene", str(CASES / "runup_gauge" / "wall.yaml"), "--out", str(tmp_path / "run"), "--threads", "1"]
    off = ["--set", "output.usd=false", "--set", "output.pictures=false"]
    assert main([*bore, *off, "--set", "spacing=0.04"]) == OK
    (told,) = [line for line in capsys.readouterr().out.splitlines() if "gauge wall" in line]
    assert "still rising" in told
    assert read_record(tmp_path / "run" / "gauges" / "wall.csv")["level [m]"].max() > 0.8
