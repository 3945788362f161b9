"""The checker of USD caches: what a renderer, or someone who measures in the cache, relies on and USD does not hold.

USD's own validators look at the stage; they miss arrays of different lengths, jumbled particles and velocities that do
not belong to the motion. `check_cache` asks for both.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdValidation

from warpsph.output.surface import enclosed_volume, is_watertight, particle_volume
from warpsph.output.usd import CLIP_SET, CLIPPED_ATTRIBUTES, CLIPPED_PRIMVARS, FIELDS, RHEOLOGY_PRIMVARS
from warpsph.output.usd_files import BODY_SCOPE, CAMERA, FLUID_SCOPE, LIGHT_SCOPE, SURFACE_SCOPE

# How far the volume that a surface encloses may be off the volume of its particles.
VOLUME_ERROR = 0.03

Arrays = dict[str, np.ndarray]


def check_cache(folder: Path) -> list[str]:
    """Look for whatever is wrong with the USD cache of a run.

    Args:
        folder: The cache's folder, which holds scene.usda.

    Returns:
        One line per problem; empty when the cache is sound.
    """
    root = Path(folder) / "scene.usda"
    try:
        stage = Usd.Stage.Open(str(root))
    except Tf.ErrorException as error:
        return [f"{root}: does not open: {_reason(error)}"]
    problems = [*_stage_problems(stage), *_clip_problems(stage)]
    if problems:
        return problems
    fluids = [prim for prim in stage.Traverse() if prim.GetPath().HasPrefix(FLUID_SCOPE) and prim.IsA(UsdGeom.Points)]
    if not fluids:
        return [f"{root}: holds no fluid below {FLUID_SCOPE}"]
    for prim in fluids:
        problems += _fluid_problems(stage, prim)
    problems += _look_problems(stage, fluids)
    problems += _surface_problems(Path(folder))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    problems += [
        error.GetErrorAsString()
        for error in UsdValidation.ValidationContext(validators).Validate(stage)
        if error.GetType() == UsdValidation.ValidationErrorType.Error
    ]
    return problems


def _stage_problems(stage: Usd.Stage) -> Iterator[str]:
    """Units, axes and times, which a reader would otherwise guess."""
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage) or UsdGeom.GetStageMetersPerUnit(stage) != 1.0:
        yield "scene.usda: metersPerUnit is not 1"
    if not stage.HasAuthoredMetadata("upAxis") or UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.z:
        yield "scene.usda: upAxis is not Z"
    if stage.GetDefaultPrim().GetPath() != Sdf.Path("/World"):
        yield "scene.usda: defaultPrim is not /World"
    if not stage.HasAuthoredTimeCodeRange() or stage.GetStartTimeCode() > stage.GetEndTimeCode():
        yield "scene.usda: startTimeCode and endTimeCode do not span a range"
    if not stage.HasAuthoredMetadata("timeCodesPerSecond"):
        yield "scene.usda: timeCodesPerSecond is not set"


def _look_problems(stage: Usd.Stage, fluids: list[Usd.Prim]) -> Iterator[str]:
    """What an artist finds when it opens: a camera, a light, names of bodies, and a material on every surface."""
    camera = stage.GetPrimAtPath(CAMERA)
    if not camera or not camera.IsA(UsdGeom.Camera):
        yield f"scene.usda: has no camera at {CAMERA}"
    lights = [prim for prim in stage.Traverse() if prim.GetPath().HasPrefix(LIGHT_SCOPE)]
    if not any(prim.HasAPI(UsdLux.LightAPI) for prim in lights):
        yield f"scene.usda: has no light below {LIGHT_SCOPE}"
    meshes = [
        prim for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate) if prim.IsA(UsdGeom.Mesh)
    ]
    for prim in [*fluids, *meshes]:
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material:
            yield f"{prim.GetPath()}: has no material"
        if prim.GetPath().HasPrefix(BODY_SCOPE) and prim.GetName() != prim.GetParent().GetName():
            yield f"{prim.GetPath()}: is not named as its body"


def _surface_problems(folder: Path) -> Iterator[str]:
    """Of the surface, where one has been made: a closed mesh that encloses its particles in every frame."""
    root = folder / "surface.usda"
    if not root.exists():
        return
    stage = Usd.Stage.Open(str(root))
    for prim in stage.GetPrimAtPath(SURFACE_SCOPE).GetChildren():
        mesh = UsdGeom.Mesh(prim)
        particles = UsdGeom.Points(stage.GetPrimAtPath(f"{FLUID_SCOPE}/{prim.GetName()}"))
        spacing = float(particles.GetWidthsAttr().Get()[0])
        for frame in _frames(stage):
            values = (mesh.GetPointsAttr().Get(frame), mesh.GetFaceVertexIndicesAttr().Get(frame))
            if not particles.GetPointsAttr().Get(frame):
                continue  # a fluid that has left has no surface
            if None in values:
                yield f"{prim.GetPath()}, frame {frame}: the surface is missing"
                continue
            vertices, triangles = np.array(values[0]), np.array(values[1]).reshape(-1, 3)
            if not is_watertight(triangles):
                yield f"{prim.GetPath()}, frame {frame}: the surface is not watertight"
                continue
            volume = particle_volume(np.array(particles.GetPointsAttr().Get(frame)), spacing)
            share = enclosed_volume(vertices, triangles) / volume if volume else 1.0 + len(vertices)
            if abs(share - 1.0) > VOLUME_ERROR:
                yield f"{prim.GetPath()}, frame {frame}: the surface encloses {share:.3f} of the particles' volume"


def _clip_problems(stage: Usd.Stage) -> Iterator[str]:
    """One clip per time code, each of them there."""
    clips = Usd.ClipsAPI(stage.GetPrimAtPath("/World"))
    assets = clips.GetClipAssetPaths(CLIP_SET) or []
    if len(assets) != len(_frames(stage)):
        yield f"scene.usda: names {len(assets)} frames for {len(_frames(stage))} time codes"
    for asset in assets:
        if not asset.resolvedPath:
            yield f"{asset.path}: missing"
            continue
        try:
            Sdf.Layer.FindOrOpen(asset.resolvedPath)
        except Tf.ErrorException as error:
            yield f"{asset.path}: does not open: {_reason(error)}"


def _frames(stage: Usd.Stage) -> range:
    return range(round(stage.GetStartTimeCode()), round(stage.GetEndTimeCode()) + 1)


def _reason(error: Tf.ErrorException) -> str:
    """What USD says went wrong, without the places in its own source."""
    return "; ".join(" ".join(part.commentary.split()) for part in error.args)


def _fluid_problems(stage: Usd.Stage, prim: Usd.Prim) -> Iterator[str]:
    """Each frame by itself, then against the one before it."""
    name = prim.GetPath()
    widths = UsdGeom.Points(prim).GetWidthsAttr().Get()
    if not widths or len(widths) != 1 or not widths[0] > 0.0:
        yield f"{name}: widths is not one positive number"
        return
    diameter = widths[0]
    periods = np.array(list(stage.GetRootLayer().customLayerData.get("periods", {}).values())).reshape(-1, 3)
    before: Arrays | None = None
    for frame in _frames(stage):
        arrays, problems = _read_frame(prim, frame)
        problems = problems or list(_frame_problems(arrays, diameter))
        after = None if problems else arrays
        if before is not None and after is not None:
            problems = list(_motion_problems(before, after, 1.0 / stage.GetTimeCodesPerSecond(), diameter, periods))
        yield from (f"{name}, frame {frame}: {problem}" for problem in problems)
        before = after


def _read_frame(prim: Usd.Prim, frame: int) -> tuple[Arrays, list[str]]:
    """The clipped arrays of one fluid by name, and what could not be read."""
    arrays: Arrays = {}
    problems: list[str] = []
    may_be_left_out = [*FIELDS, *RHEOLOGY_PRIMVARS]
    primvars = [
        primvar
        for primvar in CLIPPED_PRIMVARS | RHEOLOGY_PRIMVARS
        if primvar not in may_be_left_out or prim.HasAttribute(f"primvars:{primvar}")
    ]
    for name in [*CLIPPED_ATTRIBUTES, *(f"primvars:{primvar}" for primvar in primvars)]:
        attribute = prim.GetAttribute(name)
        try:
            value = attribute.Get(frame) if attribute else None
        except Tf.ErrorException as error:
            problems.append(f"{name} cannot be read: {_reason(error)}")
            continue
        if value is None:
            problems.append(f"{name} is missing")
        elif attribute.GetResolveInfo(frame).GetSource() != Usd.ResolveInfoSourceValueClips:
            problems.append(f"{name} does not come from the frame's own file")
        else:
            arrays[name] = np.array(value)
    return arrays, problems


def _frame_problems(arrays: Arrays, diameter: float) -> Iterator[str]:
    """Arrays that agree with each other, finite values, an extent that holds every particle."""
    count = len(arrays["points"])
    lengths = {name: len(array) for name, array in arrays.items() if name != "extent"}
    wrong = {name: length for name, length in lengths.items() if length != count}
    if wrong or len(arrays["extent"]) != (2 if count else 0):
        found = ", ".join(f"{length} {name}" for name, length in wrong.items())
        yield f"{count} points, {len(arrays['extent'])} corners of the extent{', ' if found else ''}{found}"
        return
    if not count:  # all of it has left
        return
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            yield f"{name} is not finite"
    low, high = arrays["extent"].astype(np.float64)
    rounding = 1e-6 * np.abs(arrays["extent"]).max()
    outside = (arrays["points"] - 0.5 * diameter < low - rounding) | (
        arrays["points"] + 0.5 * diameter > high + rounding
    )
    if outside.any():
        yield f"{outside.any(axis=1).sum()} particles reach out of the extent"
    if len(np.unique(arrays["ids"])) != count:
        yield "ids are not unique"
    if not np.array_equal(arrays["ids"], arrays["primvars:id"]):
        yield "primvars:id differs from ids"
    if not np.allclose(arrays["primvars:speed"], np.linalg.norm(arrays["velocities"], axis=1), rtol=1e-5, atol=1e-6):
        yield "primvars:speed is not the length of velocities"


def _motion_problems(before: Arrays, after: Arrays, dt: float, diameter: float, periods: np.ndarray) -> Iterator[str]:
    """The same particles in the same order, moving with their velocities.

    A particle whose velocity goes from v to v' without turning back between two frames lands within |v' - v| dt / 2 of
    x + (v + v') dt / 2. Half a diameter and a tenth of the way on top allow for what turns back (sound, an impact) and
    for a position that is moved with its neighbours' velocities (XSPH). In a landslide that runs into water, one
    particle in two hundred of the slide still goes farther in the frame of the impact: one in twenty may. A whole
    number of `periods` [m], shape [n, 3], counts as no way: what leaves through a periodic edge comes in at the other.
    """
    stayed = np.isin(before["ids"], after["ids"])  # what has left the scene does not come back
    if not stayed.all():
        before = {name: values[stayed] for name, values in before.items() if len(values) == len(stayed)}
    if not np.array_equal(before["ids"], after["ids"]):
        yield "ids differ from the frame before"
        return
    moved = after["points"].astype(np.float64) - before["points"]
    velocity, next_velocity = (arrays["velocities"].astype(np.float64) for arrays in (before, after))
    for period in periods:
        missing = (0.5 * dt * (velocity + next_velocity) - moved) @ period / (period @ period)
        moved += np.round(missing)[:, None] * period
    error = np.linalg.norm(moved - 0.5 * dt * (velocity + next_velocity), axis=1)
    turned = np.linalg.norm(next_velocity - velocity, axis=1)
    speeds = np.linalg.norm(velocity, axis=1) + np.linalg.norm(next_velocity, axis=1)
    astray = error > 0.5 * dt * turned + 0.5 * diameter + 0.1 * 0.5 * dt * speeds
    if astray.sum() > 0.05 * len(astray):
        yield f"{astray.sum()} of {len(astray)} particles are not where their velocities take them"
