"""Pictures of the particles of a run, a PNG for each frame.

Everything is drawn on Matplotlib's Agg canvas, which needs no screen, and without pyplot's global state; particles by
a kernel, into the pixels of that canvas.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from warpsph.bodies.body_set import rotation
from warpsph.device.launch import CAPTURE, bound, launch
from warpsph.kernels.pictures import paint_discs, paint_spheres
from warpsph.output.camera import Camera
from warpsph.output.plots import GREY, INK, style_labels

if TYPE_CHECKING:
    from warpsph.output.usd_scenery import DrawnBody, Place
    from warpsph.state import Snapshot

Window = tuple[tuple[float, float], tuple[float, float]]

DOTS_PER_INCH = 100
WIDTH = 1280  # of a frame [px]
NARROWEST = 640  # frame that still has room for its title and legend [px]
TALLEST_PLOT = 720  # a window that would be taller at full width makes a narrower plot [px]
LEFT, RIGHT, BOTTOM = 74, 26, 54  # margins of the plot [px]
# Discs one spacing wide leave gaps. Where a spacing is less than this [px], gaps would only make moiré patterns, and
# discs are drawn just wide enough to close them.
SMALLEST_DISC = 5.0
# So many particles are painted at a time: more would only take memory.
BLOCK = 1 << 18
# How far the colour of the fastest particles is on the way from their material's to white: more is lost on white paper.
PALEST = 0.45
FLAT, LIT = "flat", "lit"


@dataclass(frozen=True)
class Marks:
    """Marks in pictures, besides the fluid, walls and bodies.

    Attributes:
        gauges: Where each gauge stands, x, y [m], by its name.
        levels: Levels of still water [m].
        height: From where to where the mark of a gauge reaches up in space [m].
    """

    gauges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    levels: Sequence[float] = ()
    height: tuple[float, float] = (0.0, 0.0)


def window_around(points: np.ndarray, spacing: float) -> Window:
    """A window ((x, x), (z, z)) [m] around points of a picture [m], shape [n, 2], with a little air.

    `spacing` [m] is the spacing of the particles.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    air = 2.0 * spacing + 0.01 * (high - low).max()
    return (float(low[0] - air), float(high[0] + air)), (float(low[1] - air), float(high[1] + air))


class FrameWriter:
    """Draws a PNG of the particles for each frame.

    Axes, legend and labels are drawn once; a frame restores them and adds the particles, as discs one spacing wide in
    their material's colour, the lighter the faster; lit as spheres in a 3-D scene.

    Args:
        folder: Where frame.00000.png ... go; made when absent.
        title: Written above every frame.
        fluids: Name of each fluid, in the order of `Snapshot.fluid`, and its colour as `#rrggbb`.
        walls: Lines of the walls [m], each of shape [corner_count, 3].
        bodies: What is drawn of each rigid body, its outline filled.
        spacing: Particle spacing [m].
        origin: From where all places count [m], shape [3]; the axes show it added.
        camera: From where the scene is seen.
        window: What is seen, in the picture's own directions [m].
        speed_scale: Speed that is drawn lightest [m/s].
        marks: Gauges and still levels.
        shading: FLAT for discs, LIT for spheres.
    """

    def __init__(
        self,
        folder: Path,
        *,
        title: str,
        fluids: Mapping[str, str],
        walls: Sequence[np.ndarray],
        bodies: Sequence[DrawnBody] = (),
        spacing: float,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        camera: Camera | None = None,
        window: Window,
        speed_scale: float,
        marks: Marks | None = None,
        shading: str = FLAT,
    ) -> None:
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._camera = camera = camera or Camera.of("front", np.zeros(3), np.ones(3))
        self._speed_scale, self._shading, self._spacing = speed_scale, shading, spacing
        self._sheet = spacing if shading == FLAT else 0.0
        self._shades = np.stack([_shades(color) for color in fluids.values()])
        away = np.array(origin)
        self._shift = np.array([away @ camera.right, away @ camera.up]) if camera.axes else np.zeros(2)
        (left, right), (low, high) = window
        aside, up = self._shift.tolist()
        shown = (left + aside, right + aside), (low + up, high + up)
        self._figure, axes, legend = _lay_out(shown, fluid_count=len(fluids), names=camera.axes)
        if self._shift.any():
            axes.ticklabel_format(useOffset=False, style="plain")
        self._canvas = FigureCanvasAgg(self._figure)
        _draw_legend(legend, list(fluids), self._shades, speed_scale)
        self._scale = axes.bbox.width / (window[0][1] - window[0][0])  # [px/m]
        self._drawn_bodies = list(bodies)
        self._bodies = [
            PolyCollection(
                [],
                facecolors=body.color,
                edgecolors=INK,
                linewidths=1.0 if len(body.faces) == 1 else 0.3,  # in 3-D in the colour of each face
            )
            for body in bodies
        ]
        for body in self._bodies:
            axes.add_collection(body, autolim=False)
        near = self._draw_walls(axes, walls)
        levels = self._mark(axes, marks or Marks(), shown)
        left, (width, height) = axes.bbox.x0, self._figure.bbox.size
        heading = self._figure.text(left, height - 32, title, fontsize=13, fontweight="bold", color=INK, transform=None)
        heading.set_fontsize(13 * min(1.0, (width - left - RIGHT) / heading.get_window_extent().width))
        self._time = self._figure.text(left, axes.bbox.y1 + 14, "", fontsize=13, color=INK, transform=None)

        for artist in (*self._bodies, near, *levels, self._time):
            artist.set_animated(True)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self._figure.bbox)
        self._pixels = np.asarray(self._canvas.buffer_rgba())  # the canvas's own memory
        self._over = self._print_over((near, *levels))
        top = len(self._pixels) - axes.bbox.y1
        self._origin = np.array([left - self._scale * window[0][0], top + self._scale * window[1][1]])
        box = np.round([(left, top), (axes.bbox.x1, len(self._pixels) - axes.bbox.y0)]).astype(int)
        self._box = [wp.vec2i(*corner) for corner in box.tolist()]
        self._paint(np.empty((0, 2)), np.empty(0), np.empty((0, 3)))  # compiles, if need be, before the first step

    def _flat(self, points: np.ndarray) -> np.ndarray:
        """Points [m], shape [n, 3], as the axes have them [m], shape [n, 2]."""
        return self._camera.project(points)[0] + self._shift

    def _draw_walls(self, axes: Axes, walls: Sequence[np.ndarray]) -> LineCollection:
        """The lines of walls: in perspective those behind are drawn once, below all; returns those before the water."""
        front = list(walls)
        if self._camera.axes is None:
            depth = [float(self._camera.project(line)[1].mean()) for line in walls]
            front = [line for line, away in zip(walls, depth, strict=True) if away <= 0.0]
            back = [line for line, away in zip(walls, depth, strict=True) if away > 0.0]
            axes.add_collection(LineCollection([self._flat(line) for line in back], colors=GREY), autolim=False)
        style = {"linewidths": 1.5} if self._camera.axes else {"linewidths": 0.9, "alpha": 0.6}
        near = LineCollection([self._flat(line) for line in front], colors=INK, capstyle="round", **style)
        axes.add_collection(near, autolim=False)
        return near

    def _mark(self, axes: Axes, marks: Marks, shown: Window) -> list[LineCollection]:
        """Mark gauges, below the particles, and still levels, over them: these are returned."""
        style: dict[str, Any] = {"color": INK, "fontsize": 9, "ha": "center"}
        for name, (x, y) in marks.gauges.items():
            foot, head = self._flat(np.array([[x, y, z] for z in marks.height]))
            if self._camera.axes == ("x", "z"):
                axes.axvline(foot[0], color=INK, linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
                if shown[0][0] < foot[0] < shown[0][1]:
                    at = (foot[0], shown[1][1])
                    axes.annotate(name, at, (3, -11), textcoords="offset points", **style | {"ha": "left"})
                continue
            ends = [foot, head]
            if self._camera.axes is None:
                axes.plot(*np.transpose(ends), color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
            axes.plot(*head, "v" if self._camera.axes is None else "o", color=INK, markersize=4)
            axes.annotate(name, head, (0, 6), textcoords="offset points", **style)
        if self._camera.axes != ("x", "z"):
            return []
        heights = [level + self._shift[1] for level in marks.levels]
        lines = [[(shown[0][0], level), (shown[0][1], level)] for level in heights]
        still = LineCollection(lines, colors=INK, linewidths=0.8, linestyles=[(0, (1, 3))])
        axes.add_collection(still, autolim=False)
        for level in heights:  # the mark of a water level in an engineer's drawing, at the edge of the picture
            axes.annotate("▽", (shown[0][1], level), (2, 1), textcoords="offset points", fontsize=9, color=INK)
        return [still]

    def _print_over(self, artists: Sequence[Artist]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What lies over the particles in every frame, drawn once: Matplotlib takes longer than to paint a frame.

        Returns:
            The pixels that it covers, shape [n]; the ink on each, [n, 3], of 0 to 255; and the share of the particles
            below that is seen through it, [n, 1].
        """
        drawn = []
        for paper in (0, 255):
            self._pixels[:] = paper, paper, paper, 255
            for artist in artists:
                self._figure.draw_artist(artist)
            drawn.append(self._pixels[:, :, :3].reshape(-1, 3).astype(np.float32))
        on_black, on_white = drawn
        under = (on_white - on_black).mean(axis=1, keepdims=True) / 255.0
        at = np.flatnonzero(under < 1.0)
        return at, on_black[at], under[at]

    def write(self, frame: int, snapshot: Snapshot, places: Sequence[Place] = ()) -> Path:
        """Draw a snapshot, with the bodies in their places, as frame `frame`, and return the path of the picture."""
        path = self.folder / f"frame.{frame:05d}.png"
        unfinished = path.with_name(f".{path.name}")
        unfinished.write_bytes(self.draw(snapshot, places))
        os.replace(unfinished, path)
        return path

    def draw(self, snapshot: Snapshot, places: Sequence[Place] = ()) -> bytes:
        """A snapshot, with the bodies in their places, as a PNG."""
        for artist, body, (x, q) in zip(self._bodies, self._drawn_bodies, places, strict=True):
            corners = x + body.corners @ rotation(q).T
            flat, depth, _ = self._camera.project(corners)
            faces: Sequence[Any] | np.ndarray = body.faces
            if len(faces) > 1:
                faces, colors = _faces_seen(corners, flat, depth, np.array(faces), body.color)
                artist.set(facecolors=colors, edgecolors=colors)
            artist.set_verts([flat[face] + self._shift for face in faces])
        self._time.set_text(f"t = {snapshot.time:.3f} s".replace("-", "−"))
        self._canvas.restore_region(self._background)
        flat, away, size = self._camera.project(snapshot.position)
        nearest_last = np.argsort(-away, kind="stable") if away.any() else np.arange(len(away))
        # Each body covers the particles beyond its centre, and is covered by those before it; a sheet covers nothing.
        depths = self._camera.project(np.array([x for x, _ in places]).reshape(-1, 3))[1] - self._sheet
        ends = np.searchsorted(-away[nearest_last], -depths, side="right")
        drawn = 0
        for body in np.argsort(-depths, kind="stable"):
            self._paint_all(snapshot, flat, size, nearest_last[drawn : ends[body]])
            self._figure.draw_artist(self._bodies[body])
            drawn = ends[body]
        self._paint_all(snapshot, flat, size, nearest_last[drawn:])
        at, ink, under = self._over
        pixels = self._pixels.reshape(-1, 4)
        pixels[at, :3] = ink + under * pixels[at, :3] + 0.5
        self._figure.draw_artist(self._time)
        return png_bytes(self._pixels[:, :, :3])

    def _paint_all(self, snapshot: Snapshot, flat: np.ndarray, size: np.ndarray, order: np.ndarray) -> None:
        """Paint the particles of a snapshot that `order` names, in its order."""
        for begin in range(0, len(order), BLOCK):
            some = order[begin : begin + BLOCK]
            speed = np.linalg.norm(snapshot.velocity[some], axis=1) / self._speed_scale
            shade = np.nan_to_num(np.clip(speed, 0.0, 1.0) * (self._shades.shape[1] - 1)).astype(int)
            self._paint(flat[some], size[some], self._shades[snapshot.fluid[some], shade])

    def _paint(self, flat: np.ndarray, size: np.ndarray, color: np.ndarray) -> None:
        """Paint particles at `flat` [m], shape [n, 2], `size` times as large, in `color`, RGB of 0 to 1, [n, 3]."""
        center = self._origin + flat * [self._scale, -self._scale]
        height, width, _ = self._pixels.shape
        pixels = self._spacing * self._scale
        radius = 0.5 * (pixels if pixels >= SMALLEST_DISC else 2.0**0.5 * pixels)
        arrays = {
            "center": (center.astype(np.float32)[None], wp.vec2),
            "color": ((255.0 * color).astype(np.float32)[None], wp.vec3),
            "pixels": (self._pixels.reshape(1, height * width, 4), wp.vec4ub),
        }
        lower, upper = self._box
        given = {"count": len(flat), "radius": radius, "width": width, "lower": lower, "upper": upper}
        kernel = paint_discs
        if self._shading == LIT:
            kernel = paint_spheres
            arrays["radius"] = ((radius * size).astype(np.float32)[None], wp.float32)
        with CAPTURE:  # frames are drawn while steps go on
            for name, (values, dtype) in arrays.items():
                given[name] = wp.array(values, dtype=dtype, device="cpu", copy=False)
            launch(kernel, dim=1, inputs=[0, *bound(kernel, (), given)], device="cpu")


def png_bytes(pixels: np.ndarray) -> bytes:
    """A PNG of `pixels`, RGB, uint8, shape [height, width, 3].

    Lines are left unfiltered: drawings are of few colours in long runs, which pack better and in a third of the time of
    a filter chosen line by line.
    """
    height, width, _ = pixels.shape
    lines = np.zeros((height, 1 + 3 * width), dtype=np.uint8)  # the first byte names the filter, 0
    for channel in range(3):  # four times as fast as all at once
        lines[:, 1 + channel :: 3] = pixels[:, :, channel]

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)  # 8 bits a channel, RGB, nothing special
    parts = chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(lines.data, 1)), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def _faces_seen(
    corners: np.ndarray, flat: np.ndarray, depth: np.ndarray, faces: np.ndarray, color: str
) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of a body that face the eye, the nearest last, and their colours, lit from above on the left.

    `corners` [m], shape [n, 3]; `flat` the same in the picture, shape [n, 2], and `depth` [m], shape [n]; `faces` three
    of them each, counter-clockwise from outside, shape [m, 3].
    """
    p, q, r = np.moveaxis(flat[faces], 1, 0)
    (along, across), (further, higher) = (q - p).T, (r - p).T
    seen = np.flatnonzero(along * higher - across * further > 0.0)  # still counter-clockwise: the outside
    seen = seen[np.argsort(-depth[faces[seen]].sum(axis=1), kind="stable")]
    a, b, c = np.moveaxis(corners[faces[seen]], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    light = np.array([-0.3, -0.75, 0.6]) / np.linalg.norm([-0.3, -0.75, 0.6])
    brightness = 0.55 + 0.55 * np.clip(normals @ light, 0.0, 1.0)
    return faces[seen], np.clip(brightness[:, None] * np.array(to_rgb(color)), 0.0, 1.0)


def _shades(color: str) -> np.ndarray:
    """A material's colour from rest (a little darker) to the speed scale (pale), RGB, shape [256, 3]."""
    base = np.array(to_rgb(color))
    darkest, lightest = 0.85 * base, base + PALEST * (1.0 - base)
    share = np.linspace(0.0, 1.0, 256)[:, None]
    return darkest + share * (lightest - darkest)


def _lay_out(window: Window, fluid_count: int, names: tuple[str, str] | None) -> tuple[Figure, Axes, Axes]:
    """A figure whose plot has the window's proportions, the plot, and the axes of its legend at the upper right."""
    (x_low, x_high), (z_low, z_high) = window
    scale = min((WIDTH - LEFT - RIGHT) / (x_high - x_low), TALLEST_PLOT / (z_high - z_low))  # [px/m]
    plot = scale * (x_high - x_low), scale * (z_high - z_low)
    legend = 220, 17 * fluid_count
    top = legend[1] + 72
    # Video needs even numbers of pixels.
    width = 2 * round(max(plot[0] + LEFT + RIGHT, NARROWEST) / 2)
    height = 2 * round((plot[1] + BOTTOM + top) / 2)
    figure = Figure(figsize=(width / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH, facecolor="white")

    def add_axes(left: float, bottom: float, size: tuple[float, float]) -> Axes:
        return figure.add_axes((left / width, bottom / height, size[0] / width, size[1] / height))

    left = LEFT + (width - LEFT - RIGHT - plot[0]) / 2
    axes = add_axes(left, BOTTOM, plot)
    axes.set(xlim=window[0], ylim=window[1])
    axes.xaxis.set_major_locator(MaxNLocator(max(2, int(plot[0] / 90)), steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(max(2, int(plot[1] / 45)), steps=[1, 2, 5, 10]))
    if names is None:
        axes.set_axis_off()
    else:
        axes.set(xlabel=f"{names[0]} [m]", ylabel=f"{names[1]} [m]")
    axes.spines[:].set_color(GREY)
    style_labels(axes)
    return figure, axes, add_axes(left + plot[0] - legend[0], height - legend[1] - 42, legend)


def _draw_legend(axes: Axes, names: Sequence[str], shades: np.ndarray, speed_scale: float) -> None:
    """A bar of colour for each fluid, from rest to the speed scale."""
    axes.imshow(shades, extent=(0.0, speed_scale, len(names), 0.0), aspect="auto", interpolation="nearest")
    axes.hlines(range(1, len(names)), 0.0, speed_scale, color="white", linewidth=2.0)
    axes.set_yticks(np.arange(len(names)) + 0.5, names)
    axes.set_xticks([0.0, 0.5 * speed_scale, speed_scale], ["0", "speed [m/s]", f"{speed_scale:.3g}"])
    for label, side in zip(axes.get_xticklabels(), ("left", "center", "right"), strict=True):
        label.set(ha=side)
    axes.tick_params(length=0, labelcolor=INK, labelsize=10, pad=4)
    axes.spines[:].set_visible(False)
