"""Tests of the origin of a scene: what is drawn on a map is the same scene as at zero, and is told on the map."""

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from warpsph.output.records import read_record
from warpsph.output.surface import SURFACE_SCOPE, make_surface
from warpsph.placement.origin import PLACES, find_origin, localised
from warpsph.placement.place import place
from warpsph.run import Run
from warpsph.scene.fields import Part
from warpsph.scene.loading import load_scene
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError
from warpsph.simulation import Simulation

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml"))
EAST, NORTH, UP = 412345, 5123456, 2345
# Fields in metres that are no places.
LENGTHS = {"radius", "spacing", "scale", "wavelength", "shift", "shape", "fill", "lattice", "box", "disc", "sphere"}
LENGTHS |= {"arc", "view", "mesh", "file", "part", "depth", "thickness", "height", "longest_stroke", "focus"}


def plane(x: int, z: int) -> Scene:
    """A pool with a slope, a float, a paddle, a mirror and gauges, moved by `x` and `z` [m]."""
    data = {
        "title": "a pool",
        "spacing": 0.02,
        "materials": {"water": {"density": 1000.0, "sound_speed": 30.0}},
        "walls": [
            {
                "name": "pool",
                "path": [
                    [x - 0.3, z + 0.4],
                    {"at": [x + 0.1, z + 0.0], "radius": 0.05},
                    [x + 1.0, z + 0.0],
                    [x + 1.0, z + 0.4],
                ],
            },
            {"name": "post", "disc": {"center": [x + 0.8, z + 0.1], "radius": 0.04}},
        ],
        "fluids": [
            {"name": "water", "material": "water", "fill": {"level": z + 0.2, "above": "pool"}},
            {
                "name": "drop",
                "material": "water",
                "shape": {"polygon": [[x + 0.6, z + 0.25], [x + 0.7, z + 0.25], [x + 0.65, z + 0.35]]},
                "lattice": {"origin": [x + 0.6, z + 0.25]},
            },
        ],
        "bodies": [
            {
                "name": "float",
                "shape": {"box": {"min": [x + 0.3, z + 0.15], "max": [x + 0.45, z + 0.3]}},
                "centre": [x + 0.37, z + 0.2],
                "density": 500.0,
            },
            {
                "name": "vane",
                "shape": {"box": {"min": [0.0, 0.0], "max": [0.08, 0.08]}},
                "at": [x + 0.5, z + 0.3],
                "angle": 10.0,
                "density": 500.0,
                "motion": {"kind": "sine", "turn": 10.0, "period": 1.0, "pivot": [x + 0.5, z + 0.3]},
            },
        ],
        "gauges": [{"name": "middle", "x": x + 0.2, "bottom": z + 0.05}],
        "run": {"end_time": 0.02},
        "output": {"view": {"x": [x - 0.4, x + 1.1], "z": [z - 0.1, z + 0.5]}, "checkpoint_every": 0.01},
    }
    return Scene.model_validate(_typed(data))


def space(x: int, y: int, z: int) -> Scene:
    """A box of water in space with periodic edges, moved by `x`, `y` and `z` [m]."""
    data = {
        "title": "a channel",
        "dimensions": 3,
        "spacing": 0.05,
        "materials": {"water": {"density": 1000.0, "sound_speed": 30.0}},
        "walls": [
            {"name": "bed", "path": [[x + 0.0, z + 0.0], [x + 0.8, z + 0.0]], "width": [y + 0.0, y + 0.4]},
            {
                "name": "sides",
                "box": {
                    "min": [x + 0.0, y + 0.0, z + 0.0],
                    "max": [x + 0.8, y + 0.4, z + 0.5],
                    "open": ["left", "right", "bottom", "top"],
                },
            },
        ],
        "wall_model": {"force": "radial"},
        "images": [
            {
                "name": "along",
                "periodic": {"start": [x + 0.0, y + 0.2, z + 0.0], "end": [x + 0.8, y + 0.2, z + 0.0]},
            }
        ],
        "fluids": [
            {
                "name": "water",
                "material": "water",
                "shape": {"box": {"min": [x + 0.0, y + 0.0, z + 0.0], "max": [x + 0.8, y + 0.4, z + 0.2]}},
                "velocity": [0.1, 0.0, 0.0],
                "shear_wave": {"speed": 0.1, "wavelength": 0.4},
            },
            {
                "name": "ball",
                "material": "water",
                "shape": {"sphere": {"center": [x + 0.4, y + 0.2, z + 0.4], "radius": 0.08}},
            },
        ],
        "gauges": [{"name": "middle", "x": x + 0.4, "y": y + 0.2}],
        "run": {"end_time": 0.02},
    }
    return Scene.model_validate(_typed(data))


def flume(x: int, z: int) -> Scene:
    """A flume with a wave maker, a damping zone and an instrument of each kind, moved by `x` and `z` [m]."""
    data = {
        "title": "a flume",
        "spacing": 0.05,
        "materials": {"water": {"density": 1000.0, "sound_speed": 20.0}},
        "walls": [
            {"name": "bed", "path": [[x - 0.4, z + 0.6], [x - 0.4, z], [x + 1.6, z], [x + 2.0, z + 0.4]]},
        ],
        "fluids": [
            {
                "name": "water",
                "material": "water",
                "fill": {"level": z + 0.3, "above": "bed", "between": [x + 0.0, x + 1.9]},
            }
        ],
        "wave_maker": {
            "paddle": "flap",
            "waves": "regular",
            "x": x + 0.0,
            "bed": z + 0.0,
            "top": z + 0.55,
            "hinge": z + 0.05,
            "depth": 0.3,
            "height": 0.04,
            "period": 1.2,
        },
        "damping_zones": [{"name": "sponge", "end": x + 1.8, "wavelengths": 0.4}],
        "gauges": [{"name": "near", "x": x + 0.9}],
        "probes": [
            {"name": "still", "at": [x + 0.6, z + 0.1]},
            {"name": "riding", "at": [x + 0.0, z + 0.2], "body": "paddle"},
        ],
        "forces": [
            {
                "name": "beach",
                "wall": "bed",
                "part": {"min": [x + 1.5, z - 0.1], "max": [x + 2.1, z + 0.5]},
                "about": [x + 1.6, z + 0.0],
            }
        ],
        "run_up": [{"name": "highest", "wall": "bed", "part": {"min": [x + 1.3, z - 0.1], "max": [x + 2.1, z + 0.5]}}],
        "overtopping": [{"name": "through", "start": [x + 0.8, z + 0.0], "end": [x + 0.8, z + 0.5]}],
        "run": {"end_time": 0.04},
        "output": {"pictures": False, "usd": False, "samples_per_second": 100},
    }
    return Scene.model_validate(_typed(data))


def tank(x: int, y: int, z: int) -> Scene:
    """A tank in space with a piston and an instrument of each kind, moved by `x`, `y` and `z` [m]."""
    data = {
        "title": "a tank",
        "dimensions": 3,
        "spacing": 0.1,
        "materials": {"water": {"density": 1000.0, "sound_speed": 20.0}},
        "walls": [
            {
                "name": "tank",
                "box": {"min": [x - 0.4, y + 0.0, z + 0.0], "max": [x + 1.2, y + 0.4, z + 0.6], "open": ["top"]},
            }
        ],
        "fluids": [
            {
                "name": "water",
                "material": "water",
                "shape": {"box": {"min": [x + 0.0, y + 0.0, z + 0.0], "max": [x + 1.2, y + 0.4, z + 0.3]}},
            }
        ],
        "wave_maker": {
            "waves": "regular",
            "x": x + 0.0,
            "bed": z + 0.0,
            "width": [y + 0.0, y + 0.4],
            "thickness": 0.2,
            "depth": 0.3,
            "height": 0.04,
            "period": 1.2,
        },
        "damping_zones": [{"name": "sponge", "end": x + 1.2, "wavelengths": 0.25}],
        "gauges": [{"name": "near", "x": x + 0.6, "y": y + 0.2}],
        "probes": [{"name": "still", "at": [x + 0.6, y + 0.2, z + 0.1]}],
        "forces": [
            {
                "name": "end",
                "wall": "tank",
                "part": {"min": [x + 1.1, y - 0.1, z - 0.1], "max": [x + 1.3, y + 0.5, z + 0.7]},
                "about": [x + 1.2, y + 0.2, z + 0.0],
            }
        ],
        "overtopping": [{"name": "through", "start": [x + 0.6, y + 0.0, z + 0.0], "end": [x + 0.6, y + 0.4, z + 0.6]}],
        "run": {"end_time": 0.02},
        "output": {"pictures": False, "usd": False, "samples_per_second": 100},
    }
    return Scene.model_validate(_typed(data))


def _typed(value):
    """Sums as a user would type them: 412345.7 and not 412345.70000000001."""
    if isinstance(value, dict):
        return {key: _typed(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_typed(one) for one in value]
    return round(value, 6) if isinstance(value, float) else value


def after_some_steps(scene: Scene, device) -> dict[str, np.ndarray]:
    simulation = Simulation(scene, device)
    simulation.step.aim_at(1.0)
    simulation.step.run(12)
    arrays = {name: array.numpy() for name, array in simulation.kept().items()}
    return arrays | {"levels": np.array(simulation.gauges.levels())}


@pytest.mark.parametrize(
    ("here", "there", "by"),
    [
        (plane(0, 0), plane(EAST, UP), {"x": EAST, "y": 0, "z": UP}),
        (space(0, 0, 0), space(EAST, NORTH, UP), {"x": EAST, "y": NORTH, "z": UP}),
    ],
    ids=["plane", "space"],
)
def test_a_scene_on_a_map_gives_the_bits_of_one_at_zero(here, there, by, device):
    assert localised(here) is here and find_origin(there) == by
    if here.dimensions == 3:  # a whole number of waves lies between
        assert pytest.approx(0.5) == (UP / 0.4) % 1.0
        wave = {"shear_wave": None}
        here, there = (
            one.model_copy(update={"fluids": (one.fluids[0].model_copy(update=wave), one.fluids[1])})
            for one in (here, there)
        )
    expected, found = after_some_steps(here, device), after_some_steps(there, device)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


def test_a_wave_stands_where_it_is_on_the_map():
    """Half a wave lies between, so that it turns."""
    water = 16 * 8 * 4
    here, there = (place(scene).velocity[:water, 0] for scene in (space(0, 0, 0), space(EAST, NORTH, UP)))
    np.testing.assert_allclose(there - 0.1, 0.1 - here, atol=1e-9)
    assert np.ptp(here) > 0.05


def test_moved_from_one_far_place_to_another(device):
    one, other = (after_some_steps(plane(x, z), device) for x, z in ((-7000, 3000), (EAST, 9000)))
    for name, values in one.items():
        np.testing.assert_array_equal(other[name], values, err_msg=name)


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_scenes_near_zero_stay_there(path):
    scene = load_scene(path)
    assert localised(scene) is scene


def test_what_is_given_as_a_place_is_moved():
    """Every field in metres is a place, or is known as a length."""
    seen, todo = set(), [Part]
    while todo:
        kind = todo.pop()
        todo += kind.__subclasses__()
        for name, field in kind.model_fields.items():
            in_metres = "[m]" in (field.description or "") or "[m, degrees]" in (field.description or "")
            places = next((PLACES[one] for one in kind.__mro__ if one in PLACES), {})
            if in_metres and name not in places and name not in LENGTHS:
                seen.add(f"{kind.__name__}.{name}")
    assert seen == set()


def test_outputs_are_on_the_map(tmp_path, device):
    runs = {}
    for name, scene in {"here": plane(0, 0), "there": plane(EAST, UP)}.items():
        runs[name] = Run(scene, tmp_path / name, device=device)
        runs[name].execute()
    shifts = {"x [m]": EAST, "z [m]": UP, "front [m]": EAST, "level [m]": UP}
    for record in ("gauges/middle", "fluids/water", "fluids/drop", "bodies/float", "bodies/vane", "energy"):
        here, there = (read_record(tmp_path / name / f"{record}.csv") for name in runs)
        for column, values in here.items():
            shift = shifts.get(column, 0.0)
            np.testing.assert_allclose(there[column] - shift, values, rtol=0, atol=1e-6 if shift else 0.0)
    facts = [json.loads((tmp_path / name / "run.json").read_text()) for name in runs]
    assert "origin [m]" not in facts[0] and facts[1]["origin [m]"] == [EAST, 0.0, UP]
    assert facts[1]["gauges"]["middle"]["x [m]"] == EAST + 0.2
    assert facts[1]["particles behind walls"] == facts[0]["particles behind walls"] == 0

    # The bits of the points are those at zero, and the world stands where the map has it.
    stages = [Usd.Stage.Open(str(tmp_path / name / "usd" / "scene.usda")) for name in runs]
    prims = [stage.GetPrimAtPath("/World/Fluid/water") for stage in stages]
    points = [UsdGeom.Points(prim).GetPointsAttr().Get(0) for prim in prims]
    assert points[0] == points[1]
    to_world = [UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0) for prim in prims]
    assert to_world[0].ExtractTranslation() == Gf.Vec3d(0.0)
    assert to_world[1].ExtractTranslation() == Gf.Vec3d(EAST, 0.0, UP)
    body = UsdGeom.Xformable(stages[1].GetPrimAtPath("/World/Bodies/float"))
    place_of = body.ComputeLocalToWorldTransform(0).ExtractTranslation()
    assert place_of == Gf.Vec3d(EAST + 0.37, 0.0, UP + 0.2)
    frame = Usd.Stage.Open(str(tmp_path / "there" / "usd" / "frames" / "fluid.00000.usdc"))
    alone = UsdGeom.Xformable(frame.GetPrimAtPath("/World/Fluid/water")).ComputeLocalToWorldTransform(0)
    assert alone.ExtractTranslation() == Gf.Vec3d(EAST, 0.0, UP)
    axes = runs["there"]._outputs._writers[0]._drawer._figure.axes[0]
    assert axes.get_xlim() == pytest.approx((EAST - 0.4, EAST + 1.1), abs=1e-9)
    assert axes.get_ylim() == pytest.approx((UP - 0.1, UP + 0.5), abs=1e-9)


@pytest.mark.parametrize(
    ("here", "there"),
    [(flume(0, 0), flume(EAST, UP)), (tank(0, 0, 0), tank(EAST, NORTH, UP))],
    ids=["flume", "tank"],
)
def test_waves_and_instruments_are_on_the_map(tmp_path, device, here, there):
    """A paddle, a damping zone, probes, forces, run-up, what passes a line: each with the numbers that it has at
    zero, places with the map's added."""
    by = find_origin(there)
    shift = {f"{axis} [m]": by[axis] for axis in "xyz"} | {"level [m]": by["z"], "front [m]": by["x"]}
    runs = [Run(scene, tmp_path / name, device=device) for name, scene in (("here", here), ("there", there))]
    for run in runs:
        run.execute()
    names = {str(path.relative_to(tmp_path / "here")) for path in (tmp_path / "here").rglob("*.csv")}
    assert {name.split("/")[0] for name in names} >= {"gauges", "probes", "forces", "overtopping", "bodies"}
    for name in names:
        expected, found = (read_record(tmp_path / folder / name) for folder in ("here", "there"))
        for column, values in expected.items():
            away = shift.get(column, 0.0)
            np.testing.assert_allclose(
                found[column] - away, values, rtol=0, atol=1e-6 if away else 0.0, err_msg=f"{name}: {column}"
            )
    kept = [{name: array.numpy() for name, array in run.simulation.kept().items()} for run in runs]
    for name, values in kept[0].items():
        np.testing.assert_array_equal(kept[1][name], values, err_msg=name)


def test_a_surface_is_on_the_map(tmp_path, device):
    """The bits of its points are those at zero, in the world that stands on the map."""
    pytest.importorskip("pysplashsurf")
    found = []
    for name, scene in {"here": plane(0, 0), "there": plane(EAST, UP)}.items():
        output = scene.output.model_copy(update={"pictures": False, "frames_per_second": 50.0})
        Run(scene.model_copy(update={"output": output}), tmp_path / name, device=device).execute()
        made = list(make_surface(tmp_path / name / "usd"))
        assert made and all(one.is_closed for one in made)
        stage = Usd.Stage.Open(str(tmp_path / name / "usd" / "surface.usda"))
        prim = UsdGeom.Mesh(stage.GetPrimAtPath(f"{SURFACE_SCOPE}/water"))
        found.append(np.array(prim.GetPointsAttr().Get(1)))
    np.testing.assert_array_equal(found[1], found[0])
    away = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(1).ExtractTranslation()
    assert away == Gf.Vec3d(EAST, 0.0, UP)


def test_a_run_on_a_map_goes_on(tmp_path, device):
    whole = Run(plane(EAST, UP), tmp_path / "whole", device=device)
    whole.execute()
    part = plane(EAST, UP)
    part = part.model_copy(update={"run": part.run.model_copy(update={"end_time": 0.01})})
    Run(part, tmp_path / "part", device=device).execute()
    again = load_scene(tmp_path / "part" / "scene.yaml", ["run.end_time=0.02"])
    assert again.walls == plane(EAST, UP).walls
    resumed = Run(again, tmp_path / "part", device=device, resume=True)
    resumed.execute()
    for name, array in whole.simulation.kept().items():
        np.testing.assert_array_equal(resumed.simulation.kept()[name].numpy(), array.numpy(), err_msg=name)


def test_words_are_on_the_map():
    scene = plane(EAST, UP)
    across = ((EAST + 0.7, UP + 0.0), (EAST + 0.9, UP + 0.0), (EAST + 0.8, UP + 0.3))
    shape = scene.fluids[1].shape.model_copy(update={"polygon": across})
    buried = scene.fluids[1].model_copy(update={"shape": shape})
    with pytest.raises(SceneError, match=r"runs through it, at x = 412345\.\d+ m, z = 2345\.\d+ m"):
        place(scene.model_copy(update={"fluids": (scene.fluids[0], buried)}))
