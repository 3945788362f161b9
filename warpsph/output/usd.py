"""The USD point cache of a run: a small root file, and one file of particles per frame behind value clips.

    usd/scene.usda                  what a renderer opens: /World, its fluids, walls, the list of finished frames, and
                                    where each body is in them
    usd/manifest.usda               names the attributes that the frames hold
    usd/static.usdc                 the walls, the surfaces of bodies, materials, a camera and lights
    usd/frames/fluid.00000.usdc     one frame; it also opens by itself

Every file is written under another name and then renamed, the root last. Whatever ends the run, the cache therefore
opens and holds all the frames that were finished.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from warpsph.output import fields as frame_fields
from warpsph.output.usd_files import BODY_SCOPE, FLUID_SCOPE, name_clips, new_stage, off_stage, prim_names, publish
from warpsph.output.usd_scenery import DrawnBody, Place, linear_color, static_stage

if TYPE_CHECKING:
    from warpsph.state import Snapshot

CLIP_SET = "frames"
# What changes from frame to frame, and so lives in the clips alone: a value in the root would hide them.
CLIPPED_ATTRIBUTES = {
    "points": (Sdf.ValueTypeNames.Point3fArray, "Position [m]."),
    "velocities": (Sdf.ValueTypeNames.Vector3fArray, "Velocity [m/s]."),
    "ids": (Sdf.ValueTypeNames.Int64Array, "The same number for the same particle in every frame."),
    "extent": (Sdf.ValueTypeNames.Float3Array, "Corners of the box around the particles [m]."),
}
# Blender reads primvars of these types only: it drops one of another type, and every later one with it.
_NUMBERS, _WHOLE_NUMBERS = Sdf.ValueTypeNames.FloatArray, Sdf.ValueTypeNames.IntArray
# Velocities are an attribute of points, and each fluid is a prim of its own.
_PRIMVARS = tuple(one for one in frame_fields.FIELDS if one.name not in ("velocity", "fluid"))


def _declared(primvars: Iterable[frame_fields.Field]) -> dict[str, tuple[Sdf.ValueTypeName, str]]:
    return {one.name: (_WHOLE_NUMBERS if one.is_whole else _NUMBERS, one.description) for one in primvars}


CLIPPED_PRIMVARS = _declared(one for one in _PRIMVARS if not one.is_rheological)
# What an artist may leave out.
FIELDS = ("pressure", "density")
# Only of fluids with a rheology.
RHEOLOGY_PRIMVARS = _declared(one for one in _PRIMVARS if one.is_rheological)


def require_frames(folder: Path, count: int) -> None:
    """Raise FileNotFoundError unless the first `count` frames of the cache in `folder` are there."""
    for path in (folder / "frames" / _frame_name(frame) for frame in range(count)):
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, "this frame of the cache is missing", str(path))


def _frame_name(frame: int) -> str:
    return f"fluid.{frame:05d}.usdc"


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Provenance in the types that layer data holds: what USD has no type for becomes text."""
    return {
        str(name): _plain(value)
        if isinstance(value, Mapping)
        else value
        if isinstance(value, (bool, int, float, str, Gf.Vec3d))
        else str(value)
        for name, value in values.items()
    }


class UsdCache:
    """Writes the USD cache of one run, a frame at a time.

    Args:
        folder: Where the cache goes; made when absent.
        fluids: Name of each fluid, in the order of `Snapshot.fluid`, and its colour as `#rrggbb`.
        walls: Name of each wall and its outline in the x-z plane [m], shape [corner_count, 2]; a closed outline ends
            where it starts. In 3-D its four-cornered faces [m], shape [face_count, 4, 3].
        bodies: Name of each rigid body and its drawing.
        spacing: Particle spacing [m], drawn as the diameter of a particle.
        origin: From where all points count [m]: where the world is put.
        frames_per_second: Frames per second of simulated time; frame i is at time code i.
        provenance: What made the run, kept in the root file; nested mappings and plain values.
        resume_at: Continue a cache: keep its frames before this one, drop the others.
        rheology: Whether snapshots hold the apparent viscosity and what has yielded.
        extent: Corners of the box around the fluids at the start [m], shape [3] each.
        fields: Whether to keep density and pressure.
        shows_walls: Whether a renderer sees the walls; they are guides otherwise, which a viewer may show.

    Raises:
        FileExistsError: The folder holds a cache, and `resume_at` is not given.
        FileNotFoundError: A frame before `resume_at` is missing.
        OSError: A file could not be written.
    """

    def __init__(
        self,
        folder: Path,
        *,
        fluids: Mapping[str, str],
        walls: Mapping[str, np.ndarray],
        bodies: Mapping[str, DrawnBody] | None = None,
        spacing: float,
        origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
        frames_per_second: float,
        provenance: Mapping[str, Any] | None = None,
        resume_at: int | None = None,
        rheology: bool = False,
        extent: tuple[ArrayLike, ArrayLike],
        fields: bool = True,
        shows_walls: bool = True,
    ) -> None:
        self.folder = Path(folder)
        self.root = self.folder / "scene.usda"
        self.frame_count = resume_at or 0
        self._fluids = dict(zip(prim_names(fluids), fluids.items(), strict=True))
        self._bodies = dict(zip(prim_names(bodies or {}), (bodies or {}).items(), strict=True))
        self._spacing, self._origin = spacing, origin
        self._frames_per_second = frames_per_second
        self._provenance = dict(provenance or {})
        kept = {name: primvar for name, primvar in CLIPPED_PRIMVARS.items() if fields or name not in FIELDS}
        self._primvars = kept | (RHEOLOGY_PRIMVARS if rheology else {})

        frames = self.folder / "frames"
        if resume_at is not None:
            require_frames(self.folder, resume_at)
        elif self.root.exists() or any(frames.glob("fluid.*.usdc")):
            raise FileExistsError(errno.EEXIST, "holds the USD cache of an earlier run", str(self.folder))
        frames.mkdir(parents=True, exist_ok=True)
        self._root_layer = self._make_root_layer()
        self._frame_layer = self._make_frame_layer()
        if self.frame_count and self._bodies:
            self._recall_places()
        # The root forgets the stale frames before they go, so that it never names a file that is not there.
        if self.frame_count:
            self._write_root()
        else:
            self.root.unlink(missing_ok=True)
        finished = {self._frame_path(frame) for frame in range(self.frame_count)}
        unfinished = [*self.folder.glob(".scene.*"), *frames.glob(".fluid.*")]
        for path in {*frames.glob("fluid.*.usdc"), *unfinished} - finished:
            path.unlink()
        static = static_stage(
            frames_per_second,
            {prim_name: color for prim_name, (_, color) in self._fluids.items()},
            walls,
            self._bodies,
            spacing=spacing,
            extent=np.asarray(extent, dtype=float),
            shows_walls=shows_walls,
        )
        manifest = self._declare_fluids()
        publish(static.GetRootLayer(), self.folder / "static.usdc")
        publish(manifest.GetRootLayer(), self.folder / "manifest.usda")

    def write(self, snapshot: Snapshot, places: Sequence[Place] = ()) -> Path:
        """Write the next frame, then the root that names it.

        Args:
            snapshot: The fluid at the frame's instant, in id order.
            places: Where each body is.

        Returns:
            Path of the frame's file.

        Raises:
            OSError: The file could not be written.
        """
        frame = self.frame_count
        layer = self._frame_layer
        layer.startTimeCode = layer.endTimeCode = frame
        layer.customLayerData = {"time": float(snapshot.time), "step": int(snapshot.step)}
        for index, prim_name in enumerate(self._fluids):
            # All at once, and without a copy, where there is one fluid.
            members = slice(None) if len(self._fluids) == 1 else np.flatnonzero(snapshot.fluid == index)
            for name, value in self._values(snapshot, members).items():
                attribute = f"{FLUID_SCOPE}/{prim_name}.{name}"
                layer.EraseTimeSample(attribute, frame - 1)
                layer.SetTimeSample(attribute, frame, value)
        path = self._frame_path(frame)
        publish(layer, path)
        self.frame_count = frame + 1
        for prim_name, (x, q) in zip(self._bodies, places, strict=True):
            x, q = x.tolist(), q.tolist()
            self._root_layer.SetTimeSample(f"{BODY_SCOPE}/{prim_name}.xformOp:translate", frame, Gf.Vec3d(*x))
            turn = Gf.Quatf(q[3], *q[:3])
            self._root_layer.SetTimeSample(f"{BODY_SCOPE}/{prim_name}.xformOp:orient", frame, turn)
        self._write_root()
        return path

    def _values(self, snapshot: Snapshot, members: np.ndarray | slice) -> dict[str, Any]:
        """The values of the clipped attributes for one fluid, whose particles are `members` of the snapshot."""
        points = snapshot.position[members].astype(np.float32)
        velocities = np.ascontiguousarray(snapshot.velocity[members], dtype=np.float32)
        ids = np.ascontiguousarray(snapshot.id[members], dtype=np.int64)
        radius = np.float32(0.5 * self._spacing)
        # Of nothing where all of a fluid has left.
        extent = np.stack([points.min(axis=0) - radius, points.max(axis=0) + radius]) if len(points) else points
        primvars = {}
        for one in _PRIMVARS:
            if (one.name in self._primvars or one.is_rheological) and (values := one.values(snapshot)) is not None:
                kind, dtype = (Vt.IntArray, np.int32) if one.is_whole else (Vt.FloatArray, np.float32)
                primvars[f"primvars:{one.name}"] = kind.FromNumpy(np.ascontiguousarray(values[members], dtype=dtype))
        return {
            "points": Vt.Vec3fArray.FromNumpy(points),
            "velocities": Vt.Vec3fArray.FromNumpy(velocities),
            "ids": Vt.Int64Array.FromNumpy(ids),
            "extent": Vt.Vec3fArray.FromNumpy(extent),
            **primvars,
        }

    def _put_world(self, stage: Usd.Stage) -> None:
        """Put the world at the origin, in double precision: points are in single, which is too coarse for a map."""
        if any(self._origin):
            world = UsdGeom.Xform(stage.GetPrimAtPath("/World"))
            world.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*self._origin))

    def _declare_fluids(self) -> Usd.Stage:
        """A stage that declares the fluids and what changes in them, without a value."""
        stage = new_stage(self._frames_per_second)
        UsdGeom.Scope.Define(stage, FLUID_SCOPE)
        for prim_name, (name, _) in self._fluids.items():
            prim = UsdGeom.Points.Define(stage, f"{FLUID_SCOPE}/{prim_name}").GetPrim()
            prim.SetDisplayName(name)
            for attribute, (value_type, text) in CLIPPED_ATTRIBUTES.items():
                prim.CreateAttribute(attribute, value_type, custom=False).SetDocumentation(text)
            for primvar, (value_type, text) in self._primvars.items():
                created = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(primvar, value_type, UsdGeom.Tokens.vertex)
                created.GetAttr().SetDocumentation(text)
        return stage

    def _set_appearance(self, stage: Usd.Stage) -> None:
        """Set what stays the same from frame to frame: the diameter and the colour of the particles."""
        for prim_name, (_, color) in self._fluids.items():
            points = UsdGeom.Points(stage.GetPrimAtPath(f"{FLUID_SCOPE}/{prim_name}"))
            points.CreateWidthsAttr([self._spacing])
            points.SetWidthsInterpolation(UsdGeom.Tokens.constant)
            points.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([linear_color(color)])

    def _make_frame_layer(self) -> Sdf.Layer:
        """What all frames have in common; off any stage, which would follow every change."""
        stage = self._declare_fluids()
        self._put_world(stage)
        self._set_appearance(stage)
        return off_stage(stage, ".usdc")

    def _make_root_layer(self) -> Sdf.Layer:
        """The root without its frames; off any stage, which would look for the other files at once."""
        stage = self._declare_fluids()
        self._put_world(stage)
        self._set_appearance(stage)
        if self._bodies:
            UsdGeom.Scope.Define(stage, BODY_SCOPE)
        for prim_name in self._bodies:
            xform = UsdGeom.Xform.Define(stage, f"{BODY_SCOPE}/{prim_name}")
            xform.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
            xform.AddOrientOp(UsdGeom.XformOp.PrecisionFloat)
        layer = off_stage(stage, ".usda")
        layer.customLayerData = _plain(self._provenance)
        layer.startTimeCode = 0
        layer.subLayerPaths.append("./static.usdc")
        return layer

    def _recall_places(self) -> None:
        """Take the places of bodies in the frames that are kept from the root that is there."""
        old = Sdf.Layer.OpenAsAnonymous(str(self.root))
        for prim_name in self._bodies:
            for operation in ("translate", "orient"):
                path = f"{BODY_SCOPE}/{prim_name}.xformOp:{operation}"
                for frame in old.ListTimeSamplesForPath(path):
                    if frame < self.frame_count:
                        self._root_layer.SetTimeSample(path, frame, old.QueryTimeSample(path, frame))

    def _write_root(self) -> None:
        """Name the finished frames in the root."""
        assets = [f"./frames/{_frame_name(frame)}" for frame in range(self.frame_count)]
        name_clips(self._root_layer, "/World", CLIP_SET, "./manifest.usda", assets)
        self._root_layer.endTimeCode = self.frame_count - 1
        publish(self._root_layer, self.root)

    def _frame_path(self, frame: int) -> Path:
        return self.folder / "frames" / _frame_name(frame)
