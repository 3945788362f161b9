"""The speed of sound of materials: chosen where a scene leaves it out, and held against what the scene can reach."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpsph.placement.bodies import Solid, place_bodies, top_speed
from warpsph.placement.drawing import solid, wall_surface
from warpsph.scene.scene import Scene
from warpsph.shapes.volumes import Frame

# A dam break of 1 m onto a reactive wall went through its corner at 7.03 times that speed in one of three spacings, and
# at 7.15 times and more in none of nineteen runs.
SOUND_OVER_SPEED = 7.15
# Stiffness rho c^2 of a light fluid over the weight of the heavy one beside it: less than the first is squeezed out of
# all proportion, less than the second by more than 2 %.
LEAST_STIFFNESS, ADVISED_STIFFNESS = 5.0, 50.0
# Density strays by about the square of the Mach number: 4 % at a fifth of the speed of sound, 1 % at a tenth.
REFUSED, ADVISED = 5.0, 10.0  # times the greatest speed
UPRIGHT = Frame(np.zeros(3), 0.0, 1.0)  # the axes themselves


@dataclass(frozen=True)
class Need:
    """Reasons for a speed of sound [m/s]: the least that is let pass, the least without a doubt, the advised one."""

    least: float
    enough: float
    advised: float
    why: str


def with_sound(scene: Scene, chosen: Mapping[str, Need] | None = None) -> Scene:
    """The scene with a speed of sound for each of its materials: as the scene has it, or else the advised one.

    `chosen` is what `chosen_sound` tells, where that has been asked. Raises SceneError as it does.
    """
    chosen = chosen_sound(scene) if chosen is None else chosen
    if not chosen:
        return scene
    speeds = {name: {"sound_speed": need.advised} for name, need in chosen.items()}
    materials = {name: one.model_copy(update=speeds.get(name)) for name, one in scene.materials.items()}
    return scene.model_copy(update={"materials": materials})


def chosen_sound(scene: Scene) -> dict[str, Need]:
    """What decides the speed of sound of each material for which the scene has none.

    Raises SceneError where nothing tells how fast the fluid will be: a scene that is driven by a body force, or in
    which nothing falls or moves.
    """
    absent = [name for name, material in scene.materials.items() if math.isnan(material.sound_speed)]
    if not absent:
        return {}
    walls = [wall_surface(scene, i).sample(scene.wall_spacing)[0] for i in range(len(scene.walls))]
    solids = place_bodies(scene, walls)
    shapes = [solid(scene, fluid.shape).bounds(UPRIGHT) for fluid in scene.fluids if fluid.shape]
    ground = min(float(wall[:, 2].min()) for wall in walls) if walls else min(float(low[2]) for low, _ in shapes)
    tops = [float(high[2]) for _, high in shapes] + [fluid.fill.level for fluid in scene.fluids if fluid.fill]
    tops += [float(one.samples[:, 2].max()) for one in solids if one.body.motion is None]
    needs = needs_of(scene, max(max(tops) - ground, 0.0), solids)
    chosen = {}
    for name in absent:
        asked = needs.get(name) or [need for one in needs.values() for need in one]  # of a material without a fluid
        if not asked or scene.body_force:
            why = "a body force drives this scene" if scene.body_force else "nothing in this scene falls or moves"
            words = f"is needed: {why}; ten times the greatest speed that comes of it will do"
            raise scene.error(f"materials.{name}.sound_speed", words)
        chosen[name] = max(asked, key=lambda need: need.advised)
    return chosen


def slow_sound(scene: Scene, drop: float, solids: Sequence[Solid]) -> list[str]:
    """Warnings about every material whose speed of sound is low for a fall through `drop` [m], or a body that is moved.

    Raises SceneError below what can be run, unless the scene allows "low_sound_speed".
    """
    warnings = []
    for name, needs in needs_of(scene, drop, solids).items():
        c, path = scene.materials[name].sound_speed, f"materials.{name}.sound_speed"
        for need in needs:
            if c >= need.enough:
                continue
            is_refused = c < need.least
            words = f"low {need.why}; at least {round_up(need.least):g} m/s is needed (and {need.advised:g} advised)"
            error = scene.error(path, f"{c:g} m/s is {'too ' if is_refused else ''}{words}")
            if is_refused and "low_sound_speed" not in scene.allow:
                raise error
            warnings.append(str(error))
    return warnings


def needs_of(scene: Scene, drop: float, solids: Sequence[Solid]) -> dict[str, list[Need]]:
    """What asks for a speed of sound of each material that is used: a fall through `drop` [m], bodies, heavy fluids."""
    moved = max((top_speed(solid)[0] for solid in solids), default=0.0)
    used = {fluid.material: scene.materials[fluid.material] for fluid in scene.fluids}
    heaviest = max(used, key=lambda name: used[name].density)
    needs: dict[str, list[Need]] = {}
    for name, material in used.items():
        starts = [math.hypot(*fluid.velocity) for fluid in scene.fluids if fluid.material == name]
        starts += [math.hypot(*body.velocity) for body in scene.bodies if body.velocity]
        fall = math.sqrt(2.0 * scene.gravity * drop + max(starts) ** 2)
        needs[name], speed = [], max(fall, moved)
        if speed:
            why = f"for a body that is moved at {moved:.3g} m/s"
            if fall >= moved:
                begun = f" begun at {max(starts):.3g} m/s" if max(starts) else ""
                why = f"for a drop of {drop:.3g} m{begun}"
            advised = ADVISED / REFUSED * round_up(REFUSED * speed)
            needs[name].append(Need(REFUSED * speed, SOUND_OVER_SPEED * speed, advised, why))
        # A light fluid is pressed by what a heavy one weighs, and is as stiff as its own density makes it.
        weight = used[heaviest].density * scene.gravity * drop
        if material.density < used[heaviest].density and weight:
            least, enough = (math.sqrt(f * weight / material.density) for f in (LEAST_STIFFNESS, ADVISED_STIFFNESS))
            why = f"to carry {drop:.3g} m of '{heaviest}', {used[heaviest].density:g} kg/m3, beside "
            why += f"{material.density:g} kg/m3"
            needs[name].append(Need(least, enough, round_up(enough), why))
    return needs


def round_up(value: float) -> float:
    """The next number of three digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return round(math.ceil(value / unit - 1e-9) * unit, 12)
