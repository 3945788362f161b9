"""What stands still in a USD cache or is rigid: walls, the surfaces of bodies, looks, a camera and lights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from warpsph.output.camera import Camera
from warpsph.output.usd_files import (
    BODY_SCOPE,
    CAMERA,
    FLUID_SCOPE,
    LIGHT_SCOPE,
    LOOK_SCOPE,
    WALL_SCOPE,
    new_stage,
    prim_names,
)


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


def linear_color(color: str) -> Gf.Vec3f:
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
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(linear_color(color))
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


def _bind(prim: Usd.Prim, look: str) -> None:
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material(prim.GetStage().GetPrimAtPath(look)))


def static_stage(
    frames_per_second: float,
    fluids: Mapping[str, str],
    walls: Mapping[str, np.ndarray],
    bodies: Mapping[str, tuple[str, DrawnBody]],
    *,
    spacing: float,
    extent: np.ndarray,
    shows_walls: bool,
) -> Usd.Stage:
    """Walls, in 2-D as ribbons two spacings wide across the x-z plane; bodies; materials, camera and lights.

    Args:
        frames_per_second: As of the cache.
        fluids: The colour of each fluid, `#rrggbb`, by the name of its prim.
        walls: The drawing of each wall [m], by its name in the scene, as `UsdCache` takes it.
        bodies: Name in the scene and drawing of each body, by the name of its prim.
        spacing: Particle spacing [m].
        extent: Corners of the box around the fluids [m], shape [2, 3].
        shows_walls: Whether a renderer sees the walls.
    """
    stage = new_stage(frames_per_second)
    UsdGeom.Scope.Define(stage, WALL_SCOPE)
    UsdGeom.Scope.Define(stage, LOOK_SCOPE)
    for prim_name, color in fluids.items():
        fluid = UsdGeom.Points.Define(stage, f"{FLUID_SCOPE}/{prim_name}").GetPrim()
        _bind(fluid, _add_look(stage, prim_name, color, WET))
    for prim_name, (_, body) in bodies.items():
        _add_look(stage, f"{prim_name}_body", body.color, DRY)
    _add_look(stage, "wall", WALL_COLOR, GLASS)
    for prim_name, (name, drawn) in zip(prim_names(walls), walls.items(), strict=True):
        mesh = UsdGeom.Mesh.Define(stage, f"{WALL_SCOPE}/{prim_name}")
        mesh.GetPrim().SetDisplayName(name)
        points, faces = _ribbon(drawn, spacing) if drawn.ndim == 2 else _loose_faces(drawn)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateFaceVertexCountsAttr([4] * len(faces))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
        mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(True)
        mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([linear_color(WALL_COLOR)])
        mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set([GLASS["opacity"]])
        _bind(mesh.GetPrim(), f"{LOOK_SCOPE}/wall")
        if not shows_walls:
            mesh.CreatePurposeAttr(UsdGeom.Tokens.guide)
    for prim_name, (name, body) in bodies.items():
        UsdGeom.Xform.Define(stage, f"{BODY_SCOPE}/{prim_name}").GetPrim().SetDisplayName(name)
        mesh = UsdGeom.Mesh.Define(stage, f"{BODY_SCOPE}/{prim_name}/{prim_name}")
        corners, sides = _slab(body.corners, spacing) if len(body.faces) == 1 else (body.corners, body.faces)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(corners.astype(np.float32)))
        mesh.CreateFaceVertexCountsAttr([len(side) for side in sides])
        mesh.CreateFaceVertexIndicesAttr([corner for side in sides for corner in side])
        mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([linear_color(body.color)])
        _bind(mesh.GetPrim(), f"{LOOK_SCOPE}/{prim_name}_body")
    _frame(stage, extent, spacing, *walls.values())
    return stage


def _frame(stage: Usd.Stage, extent: np.ndarray, spacing: float, *walls: np.ndarray) -> None:
    """A camera that has all of it in its picture, and lights: the sky and a sun."""
    low, high = extent
    for drawn in walls:
        points = np.insert(drawn, 1, 0.0, axis=1) if drawn.ndim == 2 else drawn.reshape(-1, 3)
        if len(points):
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    is_sheet = high[1] - low[1] < 2.0 * spacing
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
