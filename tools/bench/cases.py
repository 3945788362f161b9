"""The cases of the benchmark."""

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from warpsph.scene.loading import load_scene
from warpsph.scene.scene import Scene

SCENES = Path(__file__).resolve().parents[2] / "scenes"

DAM_BREAK = """
title: Dam break, column 1 m x 1 m
spacing: {spacing}
materials:
  water: {{density: 1000.0, sound_speed: {sound_speed}, alpha: 0.02}}
density_diffusion: {{model: none}}
tensile_correction: false
xsph: 0.0
allow: [low_sound_speed]
smoothing: {{kernel: wendland_c2, ratio: 1.5}}
wall_model: {{force: radial, strength: 0.03}}   # the jet hits the far wall with a fifth of the speed of sound
walls:
  - {{name: tank, path: [[0.0, 1.5], [0.0, 0.0], [3.0, 0.0], [3.0, 1.5]]}}
fluids:
  - {{name: water, material: water, shape: {{box: {{min: [0.0, 0.0], max: [1.0, 1.0]}}}}}}
run: {{end_time: 2.0}}
"""


@dataclass(frozen=True)
class Case:
    """A scene to time; `pressure_scale` is its rho g H [Pa], None where that means nothing."""

    name: str
    scene: Scene
    pressure_scale: float | None


def dam_break(particles: int, overrides: Sequence[str] = ()) -> Case:
    """The dam break with about `particles` particles."""
    spacing, sound_speed = 1.0 / round(math.sqrt(particles)), 10.0 * math.sqrt(9.81)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dam_break.yaml"
        path.write_text(DAM_BREAK.format(spacing=spacing, sound_speed=sound_speed), encoding="utf-8")
        return Case("dam_break", load_scene(path, overrides), 1000.0 * 9.81 * 1.0)


def column_3d(particles: int, overrides: Sequence[str] = ()) -> Case:
    """The collapse of a cube of water, 0.5 m x 0.5 m x 0.5 m, with about `particles` particles.

    With the walls and the smoothing length that all figures of it were taken with, lists and cells.
    """
    spacing = 0.5 / round(particles ** (1.0 / 3.0))
    usual = ("wall_model.force=radial", "smoothing={kernel: wendland_c2, ratio: 1.5}", "tensile_correction=true")
    scene = load_scene(SCENES / "column_3d.yaml", [f"spacing={spacing}", *usual, *overrides])
    return Case("column_3d", scene, 1000.0 * 9.81 * 0.5)


def landslide(particles: int, overrides: Sequence[str] = ()) -> Case:
    """The landslide in the size that it ships in, whatever `particles` says."""
    return Case("landslide", load_scene(SCENES / "landslide.yaml", overrides), None)


CASES: dict[str, Callable[[int, Sequence[str]], Case]] = {f.__name__: f for f in (dam_break, column_3d, landslide)}
SIZES = {"dam_break": [40_000], "column_3d": [100_000], "landslide": [0]}
