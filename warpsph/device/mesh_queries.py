"""Questions to a triangle mesh, answered on the host by Warp's tree of boxes: in seconds for 100,000 triangles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpsph.device.launch import bound, launch
from warpsph.kernels.mesh_queries import find_inside, find_nearest

# Points asked at a time, for the sake of memory.
BLOCK = 1 << 20


class MeshQueries:
    """A mesh that is asked for its nearest triangles and for its inside.

    Single precision, about the middle of the mesh, lengths over its size: places are good to 1e-7 of its size.
    """

    def __init__(self, vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> None:
        """`vertices` [m], shape [n, 3]; `triangles` are indices into them, shape [m, 3], counter-clockwise outside."""
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        self._middle, self._size = 0.5 * (low + high), float((high - low).max())
        points = wp.array((vertices - self._middle) / self._size, dtype=wp.vec3, device="cpu")
        indices = wp.array(triangles.ravel(), dtype=int, device="cpu")
        self._mesh = wp.Mesh(points, indices)

    def nearest(self, points: NDArray[np.float64], within: float = math.inf) -> NDArray[np.int32]:
        """The triangle that is nearest to each of `points` [m], shape [k, 3]; -1 where none is `within` [m], shape [k].

        From deep inside, where many are about as near, to ask for the nearest one takes long, and for one that is not
        there a moment.
        """
        triangle = np.empty(len(points), dtype=np.int32)
        for begin in range(0, len(points), BLOCK):
            some = slice(begin, begin + BLOCK)
            asked, answer = self._asked(points[some]), wp.empty(len(points[some]), dtype=int, device="cpu")
            farthest = min(within / self._size, 1e6)
            self._ask(find_nearest, farthest=farthest, point=asked, triangle=answer)
            triangle[some] = answer.numpy()
        return triangle

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether each of `points` [m], shape [k, 3], lies inside, shape [k]."""
        inside = np.empty(len(points), dtype=bool)
        for begin in range(0, len(points), BLOCK):
            some = slice(begin, begin + BLOCK)
            asked, answer = self._asked(points[some]), wp.empty(len(points[some]), dtype=wp.uint8, device="cpu")
            self._ask(find_inside, point=asked, inside=answer)
            inside[some] = answer.numpy() > 0
        return inside

    def _ask(self, kernel: wp.Kernel, **named: Any) -> None:
        launch(kernel, len(named["point"]), [0, *bound(kernel, (), {"mesh": self._mesh.id, **named})], device="cpu")

    def _asked(self, points: NDArray[np.float64]) -> wp.array:
        return wp.array((points - self._middle) / self._size, dtype=wp.vec3, device="cpu")
