"""Mirrors and periodic edges on the host's side: the group of images that a scene needs.

An image is an isometry, x' = R x + t. Mirrors and periodic pairs generate a group; kept of it are the images through
which any of the scene can be seen from within it. Corners come out as products.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import warp as wp

from warpsph.kernels import images as kernels
from warpsph.scene.boundaries import ImageField
from warpsph.scene.scene import Scene
from warpsph.shapes.points import Array, spatial

# More images than this are no corner of mirrors but one that does not close.
MOST_IMAGES = 128


@dataclass(frozen=True)
class Edge:
    """A plane that bounds the scene: points of the scene have normal . x >= offset.

    Attributes:
        normal: Unit normal into the scene, shape [3].
        offset: [m].
        name: Name of the image in the scene file.
        path: Where it stands there.
    """

    normal: Array
    offset: float
    name: str
    path: str


@dataclass(frozen=True)
class Image:
    """One image.

    Attributes:
        rotation, translation: x' = R x + t, shapes [3, 3] and [3] [m].
        mirror_translation: t without what periodic edges add to it, shape [3] [m].
        friction, friction_velocity: Velocity that friction sees is F u + f, shapes [3, 3] and [3] [m/s].
        wall: Normal, offset [m] and velocity [m/s] of the one mirror in it; None for several and for none.
        extrapolates: Whether that velocity is extrapolated from the wall instead.
    """

    rotation: Array
    translation: Array
    mirror_translation: Array
    friction: Array
    friction_velocity: Array
    wall: tuple[Array, float, Array] | None = None
    extrapolates: bool = False

    def after(self, inner: Image) -> Image:
        """The image of the image: `inner` first."""
        walls = [wall for wall in (self.wall, inner.wall) if wall]
        # A translation goes along a mirror, so that a mirror seen through it is the same plane.
        both = [one for one in (self, inner) if not np.allclose(one.rotation, np.eye(3))]
        return Image(
            rotation=self.rotation @ inner.rotation,
            translation=self.rotation @ inner.translation + self.translation,
            mirror_translation=self.rotation @ inner.mirror_translation + self.mirror_translation,
            friction=self.friction @ inner.friction,
            friction_velocity=self.friction @ inner.friction_velocity + self.friction_velocity,
            wall=walls[0] if len(both) == 1 and walls else None,
            extrapolates=len(both) == 1 and any(one.extrapolates for one in both),
        )

    def like(self, other: Image, tolerance: float) -> bool:
        """Whether both map space alike; `tolerance` in metres."""
        turned = np.abs(self.rotation - other.rotation).max()
        return turned < 1e-6 and np.abs(self.translation - other.translation).max() < tolerance


def find_edges(scene: Scene) -> tuple[list[Edge], list[Image]]:
    """The planes that bound the scene, and the image through which each of them is left.

    Raises:
        SceneError: periodic edges do not match.
    """
    edges, images = [], []
    for i, spec in enumerate(scene.images):
        path = f"images[{i}]"
        if spec.mirror is not None:
            point, normal = spatial(spec.mirror.point), spatial(spec.mirror.normal)
            normal = normal / np.linalg.norm(normal)
            edges.append(Edge(normal, float(normal @ point), spec.name, path))
            images.append(_reflection(spec, edges[-1]))
        else:
            assert spec.periodic, "an image is a mirror or periodic"
            start, end = spatial(spec.periodic.start), spatial(spec.periodic.end)
            along = (end - start) / np.linalg.norm(end - start)
            edges.append(Edge(along, float(along @ start), spec.name, path))
            images.append(_shift(end - start))
            edges.append(Edge(-along, float(-along @ end), spec.name, path))
            images.append(_shift(start - end))
    _refuse_misfits(scene, edges, images)
    return edges, images


def find_images(scene: Scene, radius: float, lower: Array, upper: Array) -> tuple[list[Edge], list[Image]]:
    """Edges, and all images through which the inside of the edges is seen, up to `radius` [m] beyond them.

    `lower` and `upper` [m], shape [3], are corners of a box around all that counts. The first images are made by the
    edges, in their order.

    Raises:
        SceneError: images do not fit on each other.
    """
    edges, generators = find_edges(scene)
    corners, planes = _corners(edges, lower, upper, scene.dimensions)
    tolerance = 1e-6 * scene.spacing
    found, fresh = list(generators), list(generators)
    itself = _shift(np.zeros(3))
    while fresh:
        products = [generator.after(image) for image in fresh for generator in generators]
        fresh = []
        for image in products:
            if image.like(itself, tolerance) or any(image.like(other, tolerance) for other in found + fresh):
                continue
            gap = _gap(image, corners, planes)
            if gap < -0.01 * scene.spacing:
                raise scene.error(edges[-1].path, _misfit(edges, generators))
            if gap < radius:
                fresh.append(image)
        found += fresh
        if len(found) > MOST_IMAGES:
            raise scene.error("images", _misfit(edges, generators))
    return edges, found


def periods(scene: Scene) -> dict[str, Array]:
    """From edge to edge of each periodic pair, by name [m], shape [3]."""
    pairs = {spec.name: spec.periodic for spec in scene.images if spec.periodic}
    return {name: spatial(pair.end) - spatial(pair.start) for name, pair in pairs.items()}


def mirror_lines(scene: Scene, lower: Array, upper: Array) -> dict[str, Array]:
    """The part of each mirror of a 2-D scene that bounds a box, by name: its ends in the x-z plane [m], shape [2, 2].

    `lower` and `upper` [m], shape [3], are corners of the box.
    """
    if scene.dimensions == 3 or not scene.images:
        return {}
    edges, images = find_edges(scene)
    corners, _ = _corners(edges, lower, upper, scene.dimensions)
    lines = {}
    for edge, image in zip(edges, images, strict=True):
        on = corners[np.abs(corners @ edge.normal - edge.offset) < 1e-6 * scene.spacing]
        if image.wall and len(on) > 1:
            along = on @ np.cross(edge.normal, [0.0, 1.0, 0.0])
            lines[edge.name] = on[[along.argmin(), along.argmax()]][:, ::2]
    return lines


def _reflection(spec: ImageField, edge: Edge) -> Image:
    """The image in a mirror, with its rule of velocity."""
    R = np.eye(3) - 2.0 * np.outer(edge.normal, edge.normal)
    t = 2.0 * edge.offset * edge.normal
    mirror = spec.mirror
    assert mirror, "asked of mirrors alone"
    u_wall = spatial(mirror.velocity) if mirror.velocity else np.zeros(3)
    F, f = {
        "free_slip": (R, np.zeros(3)),
        "no_slip_opposite": (-np.eye(3), 2.0 * u_wall),
        "no_slip_wall": (np.zeros((3, 3)), u_wall),
        "takeda": (-np.eye(3), 2.0 * u_wall),  # in a corner, where there is no one wall to extrapolate from
    }[mirror.velocity_rule]
    wall = (edge.normal, edge.offset, u_wall)
    return Image(R, t, t, F, f, wall, mirror.velocity_rule == "takeda")


def _shift(by: Array) -> Image:
    return Image(np.eye(3), by, np.zeros(3), np.eye(3), np.zeros(3))


def _refuse_misfits(scene: Scene, edges: Sequence[Edge], generators: Sequence[Image]) -> None:
    """Raise SceneError where a periodic pair is too close, or carries a mirror or another pair to another place."""
    closest = 4.0 * scene.smoothing_length
    for edge, image in zip(edges, generators, strict=True):
        if image.wall is not None:
            continue
        period = float(np.linalg.norm(image.translation))
        if period < closest:
            words = f"the edges are {period:.4g} m apart; at least 4 h = {closest:.4g} m is needed"
            raise scene.error(f"{edge.path}.periodic", words)
        cells = period / scene.spacing
        if abs(cells - round(cells)) > 0.01:
            words = f"the edges do not match: {period:.6g} m are {cells:.5g} spacings, and no whole number of them"
            raise scene.error(f"{edge.path}.periodic", words)
        for other, through in zip(edges, generators, strict=True):
            if other.path == edge.path or abs(edge.normal @ other.normal) < 1e-9:
                continue
            kind = "mirror" if through.wall else "other edge"
            words = f"the edges do not match: the {kind} '{other.name}' does not run straight from one to the other"
            raise scene.error(f"{edge.path}.periodic", words)


def _misfit(edges: Sequence[Edge], generators: Sequence[Image]) -> str:
    """What is wrong with mirrors whose images overlap."""
    mirrors = [edge for edge, image in zip(edges, generators, strict=True) if image.wall]
    for one, other in combinations(mirrors, 2):
        cosine = float(np.clip(-one.normal @ other.normal, -1.0, 1.0))
        angle = math.degrees(math.acos(cosine))
        parts = 180.0 / angle if angle > 1e-6 else 1.0
        if abs(parts - round(parts)) > 1e-4:
            return (
                f"mirrors '{one.name}' and '{other.name}' meet at {angle:.5g} degrees: their images overlap; "
                "180 degrees over a whole number fit (90, 60, 45, ...)"
            )
    return "the images of these mirrors and edges overlap"


def _corners(
    edges: Sequence[Edge], lower: Array, upper: Array, dimensions: int
) -> tuple[Array, list[tuple[Array, float]]]:
    """Corners of the part of a box that lies within the edges, shape [n, 3], and its planes (normal, offset)."""
    axes = [0, 2] if dimensions == 2 else [0, 1, 2]
    planes = [(edge.normal, edge.offset) for edge in edges]
    for axis in axes:
        unit = np.eye(3)[axis]
        planes += [(unit, float(lower[axis])), (-unit, -float(upper[axis]))]
    corners = []
    size = float(np.linalg.norm(upper - lower))
    for some in combinations(planes, dimensions):
        matrix = np.array([normal[axes] for normal, _ in some])
        if abs(np.linalg.det(matrix)) < 1e-9:
            continue
        x = np.zeros(3)
        x[axes] = np.linalg.solve(matrix, [offset for _, offset in some])
        if all(normal @ x >= offset - 1e-9 * size for normal, offset in planes):
            corners.append(x)
    return np.array(corners).reshape(-1, 3), planes


def _gap(image: Image, corners: Array, planes: Sequence[tuple[Array, float]]) -> float:
    """How far an image of the convex body of `corners` lies from it [m], at least; less than 0 where they overlap."""
    seen = corners @ image.rotation.T + image.translation
    there = [float((offset - seen @ normal).min()) for normal, offset in planes]
    back = (corners - image.translation) @ image.rotation
    here = [float((offset - back @ normal).min()) for normal, offset in planes]
    return max(there + here)


def folded(edges: Sequence[Edge], images: Sequence[Image], position: Array, velocity: Array) -> tuple[Array, Array]:
    """Where particles that have left through an edge since they were folded are seen, and how fast they go.

    `position` [m] and `velocity` [m/s] have shape [n, 3] and keep their types; without edges they come back.
    """
    if not edges:
        return position, velocity
    position, velocity = position.copy(), velocity.copy()
    for edge, image in zip(edges, images, strict=False):
        out = np.flatnonzero(position @ edge.normal < edge.offset)
        position[out] = position[out] @ image.rotation.T + image.translation
        velocity[out] = velocity[out] @ image.rotation.T
    return position, velocity


def image_struct(edges: Sequence[Edge], found: Sequence[Image], device: wp.Device) -> kernels.Images:
    """Edges and images as kernels read them, on a device."""

    def table(values: list, dtype: type) -> wp.array:
        return wp.array(np.array(values, dtype=float), dtype=dtype, device=device)

    walls = [image.wall or (np.zeros(3), 0.0, np.zeros(3)) for image in found]
    images = kernels.Images()
    images.count, images.edge_count = len(found), len(edges)
    images.rotation = table([image.rotation for image in found], wp.mat33)
    images.translation = table([image.translation for image in found], wp.vec3)
    images.mirror_translation = table([image.mirror_translation for image in found], wp.vec3)
    images.friction = table([image.friction for image in found], wp.mat33)
    images.friction_velocity = table([image.friction_velocity for image in found], wp.vec3)
    images.extrapolates = wp.array([int(image.extrapolates) for image in found], dtype=int, device=device)
    images.wall_normal = table([normal for normal, _, _ in walls], wp.vec3)
    images.wall_offset = table([offset for _, offset, _ in walls], float)
    images.wall_velocity = table([velocity for _, _, velocity in walls], wp.vec3)
    images.edge_normal = table([edge.normal for edge in edges], wp.vec3)
    images.edge_offset = table([edge.offset for edge in edges], float)
    return images
