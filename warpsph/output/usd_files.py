"""Files of USD: layers that are written whole, stages of one scale and one up axis, value clips."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, Vt

# Where things are in the world.
SURFACE_SCOPE = "/World/Surface"
FLUID_SCOPE = "/World/Fluid"
WALL_SCOPE = "/World/Walls"
BODY_SCOPE = "/World/Bodies"
LOOK_SCOPE = "/World/Looks"
CAMERA, LIGHT_SCOPE = "/World/Camera", "/World/Lights"


def publish(layer: Sdf.Layer, path: Path) -> None:
    """Write a layer beside its place, then rename it: neither a reader nor a kill ever meets half a file."""
    partial = path.with_name(f".{path.name}")
    try:
        reason = "" if layer.Export(str(partial)) else "no reason given"
    except Tf.ErrorException as error:
        reason = "; ".join(part.commentary for part in error.args)
    if reason:
        with contextlib.suppress(OSError):  # what there is of it only fills the disk
            partial.unlink()
        raise OSError(errno.EIO, f"could not be written: {reason}", str(path))
    os.replace(partial, path)


def off_stage(stage: Usd.Stage, suffix: str) -> Sdf.Layer:
    """A layer with the content of a stage, of the format that `suffix` names."""
    layer = Sdf.Layer.CreateAnonymous(suffix)
    layer.TransferContent(stage.GetRootLayer())
    return layer


def new_stage(frames_per_second: float) -> Usd.Stage:
    """A stage in memory with the units and the axes that every file of the cache states."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetTimeCodesPerSecond(frames_per_second)
    stage.SetFramesPerSecond(frames_per_second)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    return stage


def name_clips(layer: Sdf.Layer, path: str, clips: str, manifest: str, assets: Sequence[str]) -> None:
    """Name the files of frames 0, 1, ... as value clips of the prim at `path`, as the set that is called `clips`."""
    identity = Vt.Vec2dArray.FromNumpy(np.repeat(np.arange(len(assets), dtype=float)[:, None], 2, axis=1))
    prim = layer.GetPrimAtPath(path)
    prim.SetInfo("clipSets", Sdf.StringListOp.CreateExplicit([clips]))
    facts = {
        "primPath": path,
        "manifestAssetPath": Sdf.AssetPath(manifest),
        "assetPaths": Sdf.AssetPathArray([Sdf.AssetPath(asset) for asset in assets]),
        "active": identity,
        "times": identity,
    }
    prim.SetInfo("clips", {clips: facts})


def prim_names(names: Iterable[str]) -> list[str]:
    """A different legal USD name for each of the scene's names."""
    prim_names: list[str] = []
    for name in names:
        prim_name = Tf.MakeValidIdentifier(name)
        while prim_name in prim_names:
            prim_name += "_"
        prim_names.append(prim_name)
    return prim_names
