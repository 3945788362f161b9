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

import contextlib
import errno
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from warpsph.output import fields as frame_fields
from warpsph.output.camera import Camera

if TYPE_CHECKING:
    from warpsph.state import Snapshot

CLIP_SET, SURFACE_CLIPS = "frames", "surfaces"
SURFACE_SCOPE = "/World/Surface"
FLUID_SCOPE = "/World/Fluid"
WALL_SCOPE = "/World/Walls"
BODY_SCOPE = "/World/Bodies"
LOOK_SCOPE = "/World/Looks"
CAMERA, LIGHT_SCOPE = "/World/Camera", "/World/Lights"

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


@dataclass(frozen=True)
class DrawnBody:
    """A rigid body as it is drawn.

    Attributes:
        corners: About its centre [m], shape [n, 3].
        faces: Indices into `corners` around each face, counter-clockwise from outside; one, the outline, in 2-D.
        color: `#rrggbb`.
    """

    corners: np.ndarray
    faces: list[list[int]]
    color: str


# Position of the centre [m], shape [3], and orientation as a quaternion [x, y, z, w].
Place = tuple[np.ndarray, np.ndarray]


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


def require_frames(folder: Path, count: int) -> None:
    """Raise FileNotFoundError unless the first `count` frames of the cache in `folder` are there."""
    for path in (folder / "frames" / _frame_name(frame) for frame in range(count)):
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, "this frame of the cache is missing", str(path))


def off_stage(stage: Usd.Stage, suffix: str) -> Sdf.Layer:
    """A layer with the content of a stage, of the format that `suffix` names."""
    layer = Sdf.Layer.CreateAnonymous(suffix)
    layer.TransferContent(stage.GetRootLayer())
    return layer


def _frame_name(frame: int) -> str:
    return f"fluid.{frame:05d}.usdc"


def _prim_names(names: Iterable[str]) -> list[str]:
    """A different legal USD name for each of the scene's names."""
    prim_names: list[str] = []
    for name in names:
        prim_name = Tf.MakeValidIdentifier(name)
        while prim_name in prim_names:
            prim_name += "_"
        prim_names.append(prim_name)
    return prim_names


def _linear_color(color: str) -> Gf.Vec3f:
    """USD colours are linear; `#rrggbb` is sRGB."""
    encoded = np.frombuffer(bytes.fromhex(color.removeprefix("#")), dtype=np.uint8) / 255.0
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return Gf.Vec3f(*linear.tolist())


def _ribbon(outline: np.ndarray, half_width: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and four-cornered faces of an outline in the x-z plane, shape [corner_count, 2], widened along y."""
    turns = np.any(np.diff(outline, axis=0) != 0.0, axis=1)
    outline = outline[np.append(True, turns)]  # a corner written twice would make a face without area
    points = np.zeros((len(outline), 2, 3), dtype=np.float32)
    points[:, :, 0] = outline[:, None, 0]
    points[:, :, 1] = -half_width, half_width
    points[:, :, 2] = outline[:, None, 1]
    first = 2 * np.arange(len(outline) - 1, dtype=np.int32)
    return points.reshape(-1, 3), np.stack([first, first + 1, first + 3, first + 2], axis=1)


# Parameters of the preview materials: of fluids, bodies and walls.
WET = {"roughness": 0.15, "ior": 1.333}
DRY = {"roughness": 0.6}
GLASS = {"roughness": 0.2, "opacity": 0.25}
WALL_COLOR = "#b9c0c6"


def _add_look(stage: Usd.Stage, name: str, color: str, parameters: Mapping[str, float]) -> str:
    """Define a preview material, which every renderer knows, and return its path."""
    path = f"{LOOK_SCOPE}/{name}"
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(_linear_color(color))
    for parameter, value in parameters.items():
        shader.CreateInput(parameter, Sdf.ValueTypeNames.Float).Set(value)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return path


def _loose_faces(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and four-cornered faces of faces in space, shape [face_count, 4, 3]."""
    points = faces.reshape(-1, 3).astype(np.float32)
    return points, np.arange(len(points), dtype=np.int32).reshape(-1, 4)


def _slab(corners: np.ndarray, half_width: float) -> tuple[np.ndarray, list[list[int]]]:
    """Points and faces of the area that an outline encloses, counter-clockwise, shape [n, 3], widened along y."""
    count = len(corners)
    reach = np.array([0.0, half_width, 0.0])
    sides = [[i, (i + 1) % count, count + (i + 1) % count, count + i] for i in range(count)]
    return np.concatenate([corners - reach, corners + reach]), [
        list(range(count)),
        list(range(2 * count - 1, count - 1, -1)),
        *(side[::-1] for side in sides),
    ]


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
        extent: tuple[Sequence[float], Sequence[float]],
        fields: bool = True,
        shows_walls: bool = True,
    ) -> None:
        self.folder = Path(folder)
        self.root = self.folder / "scene.usda"
        self.frame_count = resume_at or 0
        self._fluids = dict(zip(_prim_names(fluids), fluids.items(), strict=True))
        self._bodies = dict(zip(_prim_names(bodies or {}), (bodies or {}).items(), strict=True))
        self._spacing, self._origin = spacing, origin
        self._frames_per_second = frames_per_second
        self._provenance = dict(provenance or {})
        kept = {name: primvar for name, primvar in CLIPPED_PRIMVARS.items() if fields or name not in FIELDS}
        self._primvars = kept | (RHEOLOGY_PRIMVARS if rheology else {})
        self._shows_walls = shows_walls
        self._extent = np.asarray(extent, dtype=float)

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
        kept = {self._frame_path(frame) for frame in range(self.frame_count)}
        unfinished = [*self.folder.glob(".scene.*"), *frames.glob(".fluid.*")]
        for path in {*frames.glob("fluid.*.usdc"), *unfinished} - kept:
            path.unlink()
        static, manifest = self._make_static_stage(walls), self._declare_fluids()
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
            points.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([_linear_color(color)])

    def _bind(self, prim: Usd.Prim, look: str) -> None:
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material(prim.GetStage().GetPrimAtPath(look)))

    def _make_static_stage(self, walls: Mapping[str, np.ndarray]) -> Usd.Stage:
        """Walls, in 2-D as ribbons two spacings wide across the x-z plane; bodies; materials, camera and lights."""
        stage = new_stage(self._frames_per_second)
        UsdGeom.Scope.Define(stage, WALL_SCOPE)
        UsdGeom.Scope.Define(stage, LOOK_SCOPE)
        for prim_name, (_, color) in self._fluids.items():
            fluid = UsdGeom.Points.Define(stage, f"{FLUID_SCOPE}/{prim_name}").GetPrim()
            self._bind(fluid, _add_look(stage, prim_name, color, WET))
        for prim_name, (_, body) in self._bodies.items():
            _add_look(stage, f"{prim_name}_body", body.color, DRY)
        _add_look(stage, "wall", WALL_COLOR, GLASS)
        for prim_name, (name, drawn) in zip(_prim_names(walls), walls.items(), strict=True):
            mesh = UsdGeom.Mesh.Define(stage, f"{WALL_SCOPE}/{prim_name}")
            mesh.GetPrim().SetDisplayName(name)
            points, faces = _ribbon(drawn, self._spacing) if drawn.ndim == 2 else _loose_faces(drawn)
            mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
            mesh.CreateFaceVertexCountsAttr([4] * len(faces))
            mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
            mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
            mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
            mesh.CreateDoubleSidedAttr(True)
            mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([_linear_color(WALL_COLOR)])
            mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set([GLASS["opacity"]])
            self._bind(mesh.GetPrim(), f"{LOOK_SCOPE}/wall")
            if not self._shows_walls:
                mesh.CreatePurposeAttr(UsdGeom.Tokens.guide)
        for prim_name, (name, body) in self._bodies.items():
            UsdGeom.Xform.Define(stage, f"{BODY_SCOPE}/{prim_name}").GetPrim().SetDisplayName(name)
            mesh = UsdGeom.Mesh.Define(stage, f"{BODY_SCOPE}/{prim_name}/{prim_name}")
            points, faces = _slab(body.corners, self._spacing) if len(body.faces) == 1 else (body.corners, body.faces)
            mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
            mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
            mesh.CreateFaceVertexIndicesAttr([corner for face in faces for corner in face])
            mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
            mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
            mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([_linear_color(body.color)])
            self._bind(mesh.GetPrim(), f"{LOOK_SCOPE}/{prim_name}_body")
        self._frame(stage, *walls.values())
        return stage

    def _frame(self, stage: Usd.Stage, *walls: np.ndarray) -> None:
        """A camera that has all of it in its picture, and lights: the sky and a sun."""
        low, high = self._extent
        for drawn in walls:
            points = np.insert(drawn, 1, 0.0, axis=1) if drawn.ndim == 2 else drawn.reshape(-1, 3)
            if len(points):
                low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
        is_sheet = high[1] - low[1] < 2.0 * self._spacing
        eye = Camera.of("front" if is_sheet else "perspective", low, high)
        middle, reach = 0.5 * (low + high), 0.5 * (high - low)
        away = np.cross(eye.up, eye.right)
        wide, tall, deep = (float(np.abs(direction) @ reach) for direction in (eye.right, eye.up, away))
        camera = UsdGeom.Camera.Define(stage, CAMERA)
        aperture = camera.GetHorizontalApertureAttr().Get(), camera.GetHorizontalApertureAttr().Get() * 9.0 / 16.0
        camera.CreateVerticalApertureAttr(aperture[1])
        focal = camera.GetFocalLengthAttr().Get()
        # So far off that the nearest part still fits, with a tenth of air around it.
        distance = deep + 1.1 * 2.0 * focal * max(wide / aperture[0], tall / aperture[1])
        camera.CreateFocusDistanceAttr(distance)
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * distance, 10.0 * distance))
        at = middle - distance * away
        rows = [[*axis, 0.0] for axis in (eye.right, eye.up, -away)]
        camera.AddTransformOp().Set(Gf.Matrix4d(*rows[0], *rows[1], *rows[2], *at, 1.0))
        UsdGeom.Scope.Define(stage, LIGHT_SCOPE)
        sky = UsdLux.DomeLight.Define(stage, f"{LIGHT_SCOPE}/sky")
        sky.CreateIntensityAttr(0.6)
        sky.CreateColorAttr(Gf.Vec3f(1.0))
        sun = UsdLux.DistantLight.Define(stage, f"{LIGHT_SCOPE}/sun")
        sun.CreateIntensityAttr(1.0)
        sun.CreateNormalizeAttr(True)  # the intensity counts on a surface, however small the sun's disc
        sun.CreateAngleAttr(1.0)
        UsdGeom.Xformable(sun).AddRotateXYZOp().Set(Gf.Vec3f(40.0, -20.0, 0.0))

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
