"""Cameras: how places of a scene become places of a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsph.scene.output import Projection

# From where a scene is seen in perspective: as far to the right of the front and above the ground [degrees], and at how
# many times the radius of the ball around the scene.
AZIMUTH, ELEVATION, DISTANCE = 28.0, 24.0, 4.0


@dataclass(frozen=True)
class Camera:
    """An eye, or parallel rays.

    Attributes:
        right, up: Unit vectors in space that are right and up in the picture, shape [3].
        focus: What lies in the middle of a picture in perspective, and is drawn true to size [m], shape [3].
        distance: From the eye to the focus [m]; infinite for parallel rays.
        axes: What is right and up in the picture, "x" and "z" for one; none in perspective.
    """

    right: np.ndarray
    up: np.ndarray
    focus: np.ndarray
    distance: float = np.inf
    axes: tuple[str, str] | None = None

    @classmethod
    def of(cls, projection: Projection, low: np.ndarray, high: np.ndarray) -> Camera:
        """The camera of a projection, for what lies between two corners [m], shape [3]."""
        x, y, z = np.eye(3)
        if projection == "front":
            return cls(x, z, np.zeros(3), axes=("x", "z"))
        if projection == "above":
            return cls(x, y, np.zeros(3), axes=("x", "y"))
        azimuth, elevation = np.radians([AZIMUTH, ELEVATION])
        right = np.cos(azimuth) * x + np.sin(azimuth) * y
        ahead = np.cos(elevation) * (np.cos(azimuth) * y - np.sin(azimuth) * x) - np.sin(elevation) * z
        radius = 0.5 * float(np.linalg.norm(high - low))
        return cls(right, np.cross(right, ahead), 0.5 * (low + high), DISTANCE * radius)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where points [m], shape [n, 3], are in the picture [m at the focus], shape [n, 2]; how far away; how large.

        How far away is counted from the focus [m], how large is 1 at the focus; both have shape [n].
        """
        away = np.cross(self.up, self.right)
        off = points - self.focus
        depth = off @ away
        scale = np.ones(len(points)) if np.isinf(self.distance) else self.distance / (self.distance + depth)
        return np.stack([off @ self.right, off @ self.up], axis=1) * scale[:, None], depth, scale
