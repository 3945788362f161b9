"""The animation of a run: its frames as an MP4, by PyAV, or as an animated GIF without it."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image

GIF_WIDTH = 800  # [px]
GIF_RATE = 15.0  # pictures per second of an animated GIF, about [1/s]


def animate(frames_dir: Path, out: Path, fps: float) -> Path:
    """Make an animation of the frames in a folder.

    An MP4 (H.264) where the package av is installed; otherwise an animated GIF, smaller and with fewer pictures per
    second.

    Args:
        frames_dir: Holds frame.00000.png ...
        out: Path of the animation; its suffix becomes that of the format.
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
        import av  # noqa: F401
    except ImportError:
        path, write = Path(out).with_suffix(".gif"), _write_gif
    else:
        path, write = Path(out).with_suffix(".mp4"), _write_mp4
    unfinished = path.with_name(f".{path.name}")
    try:
        write(frames, unfinished, fps)
    except (OSError, ValueError) as error:
        unfinished.unlink(missing_ok=True)
        raise OSError(errno.EIO, f"could not make the animation: {error}", str(path)) from None
    os.replace(unfinished, path)
    return path


def _write_mp4(frames: Sequence[Path], path: Path, fps: float) -> None:
    """Encode the frames one by one."""
    import av
    from av.video.frame import PictureType
    from av.video.reformatter import ColorRange

    # FFmpeg reads PNG in half the time of Pillow, and hands the picture on without a copy.
    reader = av.CodecContext.create("png", "r")
    rate = Fraction(fps).limit_denominator(1001)
    # The index comes first, so that a player may begin before it has all.
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as film:
        # This preset takes half the time of the usual one, for as many bytes and a likeness that is 0.0006 less (SSIM).
        stream = film.add_stream("libx264", rate=rate, options={"preset": "veryfast", "crf": "18"})
        stream.pix_fmt = "yuv420p"  # which players expect; it needs the even sizes that frames have
        stream.thread_count = 1
        for number, frame in enumerate(frames):
            packet = av.Packet(frame.read_bytes())
            packet.is_keyframe = True  # whole by itself, not a change of the one before
            (image,) = reader.decode(packet)
            if not number:
                stream.width, stream.height = image.width, image.height
            picture = image.reformat(format=stream.pix_fmt, dst_color_range=ColorRange.MPEG)
            picture.pts, picture.time_base, picture.pict_type = number, 1 / rate, PictureType.NONE
            film.mux(stream.encode(picture))
        film.mux(stream.encode())


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
    next(pictures).save(path, save_all=True, append_images=pictures, duration=durations, loop=0, format="GIF")
