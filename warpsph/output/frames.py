"""Pictures of a run: a frame of particles, an animation of frames, the gauge records.

Everything is drawn on Matplotlib's Agg canvas, which needs no screen, and without pyplot's global state; particles by
a kernel, into the pixels of that canvas.
"""

from __future__ import annotations

import errno
import os
import struct
import subprocess
import zlib
from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
import warp as wp
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image

from warpsph.bodies.body_set import rotation
from warpsph.device.launch import CAPTURE
from warpsph.kernels.pictures import paint_discs
from warpsph.output.records import find_crest, read_record

if TYPE_CHECKING:
    from warpsph.output.usd import DrawnBody, Place
    from warpsph.state import Snapshot

Window = tuple[tuple[float, float], tuple[float, float]]

# Colours of materials that name none, and of lines in plots.
MATERIAL_PALETTE = ("#2f7fb8", "#8a6a4a", "#3c8d7b", "#b98a2e", "#7d5a9b", "#b0513f")
BODY_PALETTE = ("#8c8f94", "#b0895a", "#6f7f6a", "#a46d62")
LINE_PALETTE = ("#1f5f99", "#c2512f", "#2e7d5b", "#8a4f9e", "#a67c00", "#4a5560")
INK = "#2b2f33"
GREY = "#9aa0a6"

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
GIF_WIDTH = 800  # [px]
GIF_RATE = 15.0  # pictures per second of an animated GIF, about [1/s]


# -------------------------------------------------------------------------------------------------- frames of particles


def fluid_colors(fluid_materials: Mapping[str, str], material_colors: Mapping[str, str | None]) -> dict[str, str]:
    """Colour of each fluid, `#rrggbb`.

    Args:
        fluid_materials: Name of each fluid, and of its material.
        material_colors: Name of each material, and its colour; None takes the next of the palette.
    """
    palette = cycle(MATERIAL_PALETTE)
    colors = {material: color or next(palette) for material, color in material_colors.items()}
    return {fluid: colors[material] for fluid, material in fluid_materials.items()}


def window_around(points: np.ndarray, spacing: float) -> Window:
    """A window ((x, x), (z, z)) [m] around points of the x-z plane [m], shape [n, 2], with a little air.

    `spacing` [m] is that of the particles.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    air = 2.0 * spacing + 0.01 * (high - low).max()
    return (float(low[0] - air), float(high[0] + air)), (float(low[1] - air), float(high[1] + air))


class FrameWriter:
    """Draws a PNG of the particles for each frame.

    Axes, legend and labels are drawn once; a frame restores them and adds the particles, as discs one spacing wide in
    their material's colour, the lighter the faster. A 3-D scene is seen from its front, where y is least.

    Args:
        folder: Where frame.00000.png ... go; made when absent.
        title: Written above every frame.
        fluids: Name of each fluid, in the order of `Snapshot.fluid`, and its colour as `#rrggbb`.
        walls: Lines of the walls in the x-z plane [m], each of shape [corner_count, 2].
        bodies: What is drawn of each rigid body, its outline filled.
        spacing: Particle spacing [m].
        origin: From where all places count, x and z [m]; the axes show it added.
        window: What is seen, ((x, x), (z, z)) [m].
        speed_scale: Speed that is drawn lightest [m/s].
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
        origin: tuple[float, float] = (0.0, 0.0),
        window: Window,
        speed_scale: float,
    ) -> None:
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._speed_scale = speed_scale
        self._shades = np.stack([_shades(color) for color in fluids.values()])
        self._shift = np.array(origin)
        shown = tuple((low + more, high + more) for (low, high), more in zip(window, origin, strict=True))
        self._figure, axes, legend = _lay_out(shown, fluid_count=len(fluids))
        if self._shift.any():
            axes.ticklabel_format(useOffset=False, style="plain")
        self._canvas = FigureCanvasAgg(self._figure)
        _draw_legend(legend, list(fluids), self._shades, speed_scale)
        self._scale = axes.bbox.width / (window[0][1] - window[0][0])  # [px/m]
        pixels = spacing * self._scale
        self._radius = 0.5 * (pixels if pixels >= SMALLEST_DISC else 2.0**0.5 * pixels)
        self._walls = LineCollection(
            [line + self._shift for line in walls], colors=INK, linewidths=1.5, capstyle="round"
        )
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
        axes.add_collection(self._walls, autolim=False)
        left, (width, height) = axes.bbox.x0, self._figure.bbox.size
        heading = self._figure.text(left, height - 32, title, fontsize=13, fontweight="bold", color=INK, transform=None)
        heading.set_fontsize(13 * min(1.0, (width - left - RIGHT) / heading.get_window_extent().width))
        self._time = self._figure.text(left, axes.bbox.y1 + 14, "", fontsize=13, color=INK, transform=None)

        self._moving = (*self._bodies, self._walls, self._time)
        for artist in self._moving:
            artist.set_animated(True)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self._figure.bbox)
        self._pixels = np.asarray(self._canvas.buffer_rgba())  # the canvas's own memory
        top = len(self._pixels) - axes.bbox.y1
        self._origin = np.array([left - self._scale * window[0][0], top + self._scale * window[1][1]])
        box = np.round([(left, top), (axes.bbox.x1, len(self._pixels) - axes.bbox.y0)]).astype(int)
        self._box = [wp.vec2i(*corner) for corner in box.tolist()]
        self._paint(np.empty((0, 3)), np.empty((0, 3)))  # compiles, if need be, before the first step

    def write(self, frame: int, snapshot: Snapshot, places: Sequence[Place] = ()) -> Path:
        """Draw a snapshot, with the bodies in their places, as frame `frame`, and return the path of the picture."""
        for artist, body, (x, q) in zip(self._bodies, self._drawn_bodies, places, strict=True):
            corners = x + body.corners @ rotation(q).T
            faces = body.faces
            if len(faces) > 1:
                faces, colors = _seen_from_the_front(corners, np.array(faces), body.color)
                artist.set(facecolors=colors, edgecolors=colors)
            artist.set_verts([corners[face, ::2] + self._shift for face in faces])
        self._time.set_text(f"t = {snapshot.time:.3f} s".replace("-", "−"))
        self._canvas.restore_region(self._background)
        away = snapshot.position[:, 1]
        nearest_last = np.argsort(-away, kind="stable") if away.any() else np.arange(len(away))
        for begin in range(0, len(away), BLOCK):
            some = nearest_last[begin : begin + BLOCK]
            speed = np.linalg.norm(snapshot.velocity[some], axis=1) / self._speed_scale
            shade = np.nan_to_num(np.clip(speed, 0.0, 1.0) * (self._shades.shape[1] - 1)).astype(int)
            self._paint(snapshot.position[some], self._shades[snapshot.fluid[some], shade])
        for artist in self._moving:
            self._figure.draw_artist(artist)
        path = self.folder / f"frame.{frame:05d}.png"
        unfinished = path.with_name(f".{path.name}")
        unfinished.write_bytes(png_bytes(self._pixels[:, :, :3]))
        os.replace(unfinished, path)
        return path

    def _paint(self, position: np.ndarray, color: np.ndarray) -> None:
        """Paint particles at `position` [m], shape [n, 3], in `color`, RGB of 0 to 1, shape [n, 3]."""
        center = self._origin + position[:, ::2] * [self._scale, -self._scale]
        height, width, _ = self._pixels.shape
        arrays = (
            (center.astype(np.float32)[None], wp.vec2),
            ((255.0 * color).astype(np.float32)[None], wp.vec3),
            (self._pixels.reshape(1, height * width, 4), wp.vec4ub),
        )
        with CAPTURE:  # frames are drawn while steps go on
            seen = [wp.array(values, dtype=dtype, device="cpu", copy=False) for values, dtype in arrays]
            inputs = [0, len(position), self._radius, width, *self._box, *seen]
            wp.launch(paint_discs, dim=1, inputs=inputs, device="cpu")


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
    parts = chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(lines, 2)), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def _seen_from_the_front(corners: np.ndarray, faces: np.ndarray, color: str) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of a body that face the front, the nearest last, and their colours, lit from above on the left.

    `corners` [m], shape [n, 3]; `faces` three of them each, counter-clockwise from outside, shape [m, 3].
    """
    a, b, c = np.moveaxis(corners[faces], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    seen = np.flatnonzero(normals[:, 1] < 0.0)
    seen = seen[np.argsort(-(a + b + c)[seen, 1], kind="stable")]
    light = np.array([-0.3, -0.75, 0.6]) / np.linalg.norm([-0.3, -0.75, 0.6])
    brightness = 0.55 + 0.55 * np.clip(normals[seen] @ light, 0.0, 1.0)
    return faces[seen], np.clip(brightness[:, None] * np.array(to_rgb(color)), 0.0, 1.0)


def _shades(color: str) -> np.ndarray:
    """A material's colour from rest (a little darker) to the speed scale (pale), RGB, shape [256, 3]."""
    base = np.array(to_rgb(color))
    darkest, lightest = 0.85 * base, base + 0.7 * (1.0 - base)
    share = np.linspace(0.0, 1.0, 256)[:, None]
    return darkest + share * (lightest - darkest)


def _lay_out(window: Window, fluid_count: int) -> tuple[Figure, Axes, Axes]:
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
    axes.set(xlim=window[0], ylim=window[1], xlabel="x [m]", ylabel="z [m]")
    axes.xaxis.set_major_locator(MaxNLocator(max(2, int(plot[0] / 90)), steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(max(2, int(plot[1] / 45)), steps=[1, 2, 5, 10]))
    axes.spines[:].set_color(GREY)
    _style_labels(axes)
    return figure, axes, add_axes(left + plot[0] - legend[0], height - legend[1] - 42, legend)


def _draw_legend(axes: Axes, names: Sequence[str], shades: np.ndarray, speed_scale: float) -> None:
    """A bar of colour for each fluid, from rest to the speed scale."""
    axes.imshow(shades, extent=(0.0, speed_scale, len(names), 0.0), aspect="auto", interpolation="nearest")
    axes.hlines(range(1, len(names)), 0.0, speed_scale, color="white", linewidth=2.0)
    axes.set_yticks(np.arange(len(names)) + 0.5, names)
    axes.set_xticks([0.0, 0.5 * speed_scale, speed_scale], ["0", "speed [m/s]", f"{speed_scale:.3g}"])
    for label, side in zip(axes.get_xticklabels(), ("left", "center", "right"), strict=True):
        label.set_horizontalalignment(side)
    axes.tick_params(length=0, labelcolor=INK, labelsize=10, pad=4)
    axes.spines[:].set_visible(False)


def _style_labels(axes: Axes) -> None:
    axes.tick_params(color=GREY, labelcolor=INK, labelsize=10)
    axes.xaxis.label.set(color=INK, fontsize=11)
    axes.yaxis.label.set(color=INK, fontsize=11)


# ------------------------------------------------------------------------------------------- animation, sheet of frames


def animate(frames_dir: Path, out: Path, fps: float) -> Path:
    """Make an animation of the frames in a folder.

    An MP4 (H.264) where the package imageio-ffmpeg is installed; otherwise an animated GIF, smaller and with fewer
    pictures per second.

    Args:
        frames_dir: Holds frame.00000.png ...
        out: Path of the animation; its suffix is set to what is made.
        fps: Frames per second of the animation [1/s].

    Returns:
        Path of the animation.

    Raises:
        FileNotFoundError: There are no frames.
        OSError: The animation could not be written.
    """
    frames = sorted(Path(frames_dir).glob("frame.*.png"))
    if not frames:
        raise FileNotFoundError(errno.ENOENT, "no frames to make an animation of", str(frames_dir))
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        ffmpeg = get_ffmpeg_exe()
    except (ImportError, RuntimeError):  # the package is not there, or not the program that it should bring
        path = Path(out).with_suffix(".gif")
        _write_gif(frames, path, fps)
    else:
        path = Path(out).with_suffix(".mp4")
        _write_mp4(ffmpeg, frames, path, fps)
    return path


def _write_mp4(ffmpeg: str, frames: Sequence[Path], path: Path, fps: float) -> None:
    """Let ffmpeg read the frames as a numbered sequence."""
    unfinished = path.resolve().with_name(f".{path.name}")
    first = frames[0].name.split(".")[1]
    command = [ffmpeg, "-y", "-loglevel", "error", "-framerate", str(fps), "-start_number", first]
    # Players expect 4:2:0, which needs the even sizes that frames have, and the index at the front.
    command += ["-i", "frame.%05d.png", "-c:v", "libx264", "-pix_fmt", "yuv420p"]
    # This preset takes half the time of the usual one, for as many bytes and a likeness that is 0.0006 less (SSIM).
    command += ["-preset", "veryfast", "-crf", "18"]
    command += ["-movflags", "+faststart", str(unfinished)]
    done = subprocess.run(command, cwd=frames[0].parent, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if done.returncode != 0:
        unfinished.unlink(missing_ok=True)
        reason = done.stderr.decode(errors="replace").strip().splitlines() or ["no reason given"]
        raise OSError(errno.EIO, f"ffmpeg could not make the animation: {reason[-1]}", str(path))
    os.replace(unfinished, path)


def _write_gif(frames: Sequence[Path], path: Path, fps: float) -> None:
    """Write every few frames, smaller, in one palette for all, so that what stands still does not flicker."""
    step = max(1, round(fps / GIF_RATE))
    shown = frames[::step]

    def small(frame: Path) -> Image.Image:
        with Image.open(frame) as picture:
            width = min(GIF_WIDTH, picture.width)
            size = width, round(picture.height * width / picture.width)
            return picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)

    samples = [np.asarray(small(shown[index])) for index in (0, len(shown) // 2, -1)]
    palette = Image.fromarray(np.concatenate(samples)).quantize(255)
    pictures = (small(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in shown)
    # A GIF counts in hundredths of a second: rounding each instant, not each step, keeps the whole in time.
    instants = np.round(100.0 * step / fps * np.arange(len(shown) + 1))
    durations = (10 * np.diff(instants)).astype(int).tolist()
    unfinished = path.with_name(f".{path.name}")
    next(pictures).save(unfinished, save_all=True, append_images=pictures, duration=durations, loop=0)
    os.replace(unfinished, path)


# -------------------------------------------------------------------------------------------------------------- records


def gauge_picture(csvs: Sequence[Path], out: Path | BinaryIO) -> None:
    """Draw the records of all gauges in one panel, each with the amplitude of its crest.

    Args:
        csvs: Gauge records; a gauge is called by its file's name, and its first level is that of the water at rest.
        out: PNG to write.
    """
    figure, (axes,) = new_plots(1)
    for path, color in zip(csvs, cycle(LINE_PALETTE), strict=False):
        time, level = read_record(path).values()
        if len(time) == 0:
            continue
        axes.plot(time, level - level[0], color=color, linewidth=1.4, label=path.stem)
        amplitude, crest_time = find_crest(time, level)
        if amplitude > 0.0:
            crest = crest_time, amplitude
            axes.plot(*crest, "o", color=color, markersize=6, markeredgecolor="white", markeredgewidth=0.8)
            label = axes.annotate(f"{amplitude:.3f} m", crest, xytext=(0, 8), textcoords="offset points", ha="center")
            label.set(color=color, fontsize=10, fontweight="bold")
    axes.axhline(0.0, color=GREY, linewidth=0.8, zorder=0)
    axes.set(xlabel="time [s]", ylabel="level − still level [m]")
    axes.margins(x=0.0, y=0.14)
    axes.legend(frameon=False, loc="upper left", fontsize=10, labelcolor=INK)
    figure.savefig(out, format="png")


def new_plots(count: int) -> tuple[Figure, Sequence[Axes]]:
    """A figure of plots side by side in the style of all plots of records: two spines, a light grid, quiet ticks."""
    figure = Figure(figsize=(9.0, 4.2), dpi=150)
    figure.set_layout_engine("constrained", w_pad=0.12, h_pad=0.12)
    plots = np.atleast_1d(figure.subplots(1, count))
    for axes in plots:
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(GREY)
        axes.grid(color="#e4e7ea", linewidth=0.7)
        axes.set_axisbelow(True)
        _style_labels(axes)
    return figure, plots
