"""What a machine with a GPU is asked: that every question can be put, here where there is none."""

import json
import subprocess
import sys
from pathlib import Path

import cases
import gpu_check
import pytest

from warpsph.scene.loading import load_scene

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("variant", gpu_check.VARIANTS)
@pytest.mark.parametrize("case", ["dam_break", "column_3d"])
def test_every_variant_of_a_benchmark_is_a_scene(case, variant):
    scene = cases.CASES[case](1000, gpu_check.VARIANTS[variant]).scene
    assert (scene.wall_model.force == "dummy_particles") == (variant == "dummies")


@pytest.mark.parametrize("scene", sorted({*gpu_check.AGREEING, *gpu_check.SMALL_SCENES}))
def test_every_scene_that_is_asked_for_ships(scene):
    load_scene(gpu_check.SCENES / f"{scene}.yaml", gpu_check.AGREEING.get(scene, ()))


def test_dummies_are_compared_in_the_plane_and_in_space_and_with_a_body():
    scenes = [load_scene(gpu_check.SCENES / f"{name}.yaml") for name in gpu_check.AGREEING]
    kinds = {
        (one.dimensions, bool(one.bodies)) for one in scenes if one.walls and one.wall_model.force == "dummy_particles"
    }
    assert kinds >= {(2, False), (3, False), (2, True)}


@pytest.mark.slow
def test_all_of_it_runs_on_a_cpu(tmp_path):
    answer = tmp_path / "answer.json"
    command = [sys.executable, ROOT / "tools" / "gpu_check.py", "--device", "cpu", "--small", "--deadline", "2000"]
    done = subprocess.run([*map(str, command), "--json", str(answer)], capture_output=True, text=True, check=False)
    found = json.loads(answer.read_text(encoding="utf-8"))
    assert done.returncode == 0, done.stdout[-3000:]
    assert set(found) == set(gpu_check.SECTIONS) and all(one["ok"] for one in found.values())
