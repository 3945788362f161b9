"""Animations are read back: all frames, in their colours and at their rate."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from warpsph.output.animation import animate


@pytest.fixture
def frames(tmp_path) -> Path:
    folder = tmp_path / "preview"
    folder.mkdir()
    for frame in range(8):
        picture = Image.new("RGB", (1280, 240), "white")
        picture.paste((47, 127, 184), (100 * frame, 50, 100 * frame + 80, 130))
        picture.save(folder / f"frame.{frame:05d}.png")
    return folder


def test_an_mp4_holds_every_frame(frames, tmp_path):
    av = pytest.importorskip("av")
    film = animate(frames, tmp_path / "animation", 30.0)
    assert film == tmp_path / "animation.mp4"
    with av.open(str(film)) as opened:
        stream = opened.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.width, stream.height) == Image.open(frames / "frame.00000.png").size
        assert stream.average_rate == 30
        pictures = [picture.to_ndarray(format="rgb24") for picture in opened.decode(stream)]
    assert len(pictures) == 8
    for frame, picture in enumerate(pictures):
        assert np.abs(picture[90, 100 * frame + 40].astype(int) - (47, 127, 184)).max() < 12


def test_without_av_a_gif_keeps_the_time(frames, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    film = animate(frames, tmp_path / "animation.mp4", 30.0)
    assert film == tmp_path / "animation.gif"
    with Image.open(film) as picture:
        durations = []
        for index in range(picture.n_frames):
            picture.seek(index)
            durations.append(picture.info["duration"])
        assert picture.width == 800
    # Every second frame, 1/15 s each, in hundredths of a second.
    assert durations == [70, 60, 70, 70]


def test_no_frames_make_no_animation(tmp_path):
    with pytest.raises(FileNotFoundError, match="no frames to make an animation of"):
        animate(tmp_path, tmp_path / "animation", 30.0)


def test_a_broken_frame_makes_no_animation(frames, tmp_path):
    pytest.importorskip("av")
    for frame in frames.iterdir():
        frame.write_bytes(b"not a picture")
    with pytest.raises(OSError, match="could not make the animation"):
        animate(frames, tmp_path / "animation", 30.0)
    assert [path.name for path in tmp_path.iterdir()] == ["preview"]
