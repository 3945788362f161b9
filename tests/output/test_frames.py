"""Pictures of a run: what is drawn is measured in the pixels, and animations are read back."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from warpsph.output import frames as preview
from warpsph.output.frames import (
    FrameWriter,
    _seen_from_the_front,
    animate,
    fluid_colors,
    gauge_picture,
    window_around,
)
from warpsph.shapes.mesh import box_mesh
from warpsph.state import Snapshot

SPACING = 0.01
WINDOW = ((-1.0, 2.0), (-0.1, 0.5))
FLUIDS = {"slide": "#8a6a4a", "water": "#4a90c2"}
PIXELS_PER_METRE = (1280 - 74 - 26) / 3.0


def block(x: float, z: float, width: float, height: float) -> np.ndarray:
    """Positions of a block of particles whose lower left corner is at (x, z) [m]."""
    columns, rows = round(width / SPACING), round(height / SPACING)
    i, k = (index.ravel() + 0.5 for index in np.mgrid[:columns, :rows])
    return np.stack([x + i * SPACING, 0.0 * i, z + k * SPACING], axis=1)


def snapshot_of(slide: np.ndarray, water: np.ndarray, speed: float = 0.0, time: float = 0.0) -> Snapshot:
    """Both fluids, all moving along x."""
    position = np.concatenate([slide, water])
    count = len(position)
    return Snapshot(
        time=time,
        step=0,
        position=position,
        velocity=np.tile(np.float32([speed, 0.0, 0.0]), (count, 1)),
        density=np.full(count, 1000.0),
        pressure=np.zeros(count, dtype=np.float32),
        fluid=np.repeat(np.int32([0, 1]), [len(slide), len(water)]),
        id=np.arange(count),
    )


SLIDE, WATER = block(-0.8, 0.2, 0.2, 0.1), block(0.5, 0.0, 1.0, 0.2)


@pytest.fixture
def writer(tmp_path) -> FrameWriter:
    return FrameWriter(
        tmp_path / "preview",
        title="Two blocks",
        fluids=FLUIDS,
        walls=[np.array([[-1.0, 0.0], [2.0, 0.0]])],
        spacing=SPACING,
        window=WINDOW,
        speed_scale=2.0,
    )


def pixels_of(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path)).astype(int)


def shows(pixels: np.ndarray, color: str) -> np.ndarray:
    """Where the particles of a fluid at rest are: its colour, a little darker."""
    wanted = 0.85 * np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)])
    return np.abs(pixels - wanted).max(axis=2) < 3


def test_particles_are_drawn_where_they_are_and_as_large(writer):
    pixels = pixels_of(writer.write(0, snapshot_of(SLIDE, WATER)))
    assert pixels.shape[1] == 1280
    for fluid, (x, z, area) in {"slide": (-0.7, 0.25, 0.02), "water": (1.0, 0.1, 0.2)}.items():
        rows, columns = np.nonzero(shows(pixels, FLUIDS[fluid]))
        in_plot = rows > 110  # not in the legend
        rows, columns = rows[in_plot], columns[in_plot]
        assert len(rows) / PIXELS_PER_METRE**2 == pytest.approx(area, rel=0.15)
        assert (columns.mean() + 0.5 - 74) / PIXELS_PER_METRE + WINDOW[0][0] == pytest.approx(x, abs=0.01)
        bottom = len(pixels) - 54
        assert (bottom - rows.mean() - 0.5) / PIXELS_PER_METRE + WINDOW[1][0] == pytest.approx(z, abs=0.01)


@pytest.mark.parametrize(("slide_y", "visible"), [(0.1, "water"), (-0.1, "slide")])
def test_a_scene_in_space_is_seen_from_its_front(writer, slide_y, visible):
    """Of two blocks, one behind the other, the one whose y is less is seen, whatever their order."""
    block_of_slide = block(0.5, 0.0, 0.4, 0.2) + np.array([0.0, slide_y, 0.0])
    pixels = pixels_of(writer.write(0, snapshot_of(block_of_slide, block(0.5, 0.0, 0.4, 0.2))))[110:]
    hidden = {"water": "slide", "slide": "water"}[visible]
    assert shows(pixels, FLUIDS[visible]).sum() / PIXELS_PER_METRE**2 == pytest.approx(0.08, rel=0.15)
    assert shows(pixels, FLUIDS[hidden]).sum() / PIXELS_PER_METRE**2 < 0.002


def test_faster_is_lighter(writer):
    brightness = [
        pixels_of(writer.write(0, snapshot_of(SLIDE, WATER, speed)))[110:].mean() for speed in (0.0, 1.0, 2.0, 9.0)
    ]
    assert brightness[0] < brightness[1] < brightness[2] == brightness[3]


def test_time_changes_nothing_but_the_title(writer):
    earlier, later = (pixels_of(writer.write(0, snapshot_of(SLIDE, WATER, time=time))) for time in (-0.25, 1.5))
    rows = np.nonzero((earlier != later).any(axis=(1, 2)))[0]
    assert 0 < rows.min() <= rows.max() < 106


def test_frames_leave_no_trace_in_each_other(writer):
    first = writer.write(0, snapshot_of(SLIDE, WATER)).read_bytes()
    writer.write(1, snapshot_of(SLIDE + 0.3, WATER - 0.2, 1.0, 0.1))
    assert writer.write(2, snapshot_of(SLIDE, WATER)).read_bytes() == first
    assert sorted(path.name for path in writer.folder.iterdir()) == [f"frame.0000{k}.png" for k in range(3)]


@pytest.mark.parametrize(("width", "height"), [(3.5, 0.6), (10.0, 0.5), (1.0, 1.2), (0.333, 0.777)])
def test_a_picture_has_the_windows_proportions_and_an_even_size(tmp_path, width, height):
    window = ((0.0, width), (0.0, height))
    options = {"fluids": FLUIDS, "walls": [], "spacing": 0.02, "window": window, "speed_scale": 1.0}
    writer = FrameWriter(tmp_path, title="A title that takes more room than a narrow picture has for it" * 2, **options)
    size = Image.open(writer.write(0, snapshot_of(SLIDE, WATER))).size
    assert all(length % 2 == 0 for length in size)
    plot = min(1280 - 74 - 26, 720 * width / height)
    assert size[0] == pytest.approx(max(plot + 74 + 26, 640), abs=2)
    assert size[1] - 54 - 106 == pytest.approx(plot * height / width, abs=2)


def test_colours_come_from_materials_or_the_palette():
    materials = {"water": None, "rock": "#8a6a4a", "oil": None}
    colors = fluid_colors({"pool": "water", "slide": "rock", "rain": "water", "slick": "oil"}, materials)
    assert colors["slide"] == "#8a6a4a"
    assert colors["pool"] == colors["rain"] == preview.MATERIAL_PALETTE[0]
    assert colors["slick"] == preview.MATERIAL_PALETTE[1]


def test_the_window_holds_everything():
    (x_low, x_high), (z_low, z_high) = window_around(np.array([[-1.0, 0.6], [2.0, 0.0]]), SPACING)
    assert -1.1 < x_low < -1.0 < 2.0 < x_high < 2.1
    assert -0.1 < z_low < 0.0 < 0.6 < z_high < 0.7


@pytest.fixture
def frames(writer) -> Path:
    for frame in range(8):
        writer.write(frame, snapshot_of(SLIDE + np.array([0.05 * frame, 0.0, 0.0]), WATER, time=frame / 30))
    return writer.folder


def test_an_mp4_holds_every_frame(frames, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    film = animate(frames, tmp_path / "animation", 30.0)
    assert film == tmp_path / "animation.mp4"
    facts = next(ffmpeg.read_frames(film))
    assert facts["codec"] == "h264"
    assert facts["pix_fmt"].startswith("yuv420p")
    assert facts["size"] == Image.open(frames / "frame.00000.png").size
    assert (ffmpeg.count_frames_and_secs(film)[0], facts["fps"]) == (8, 30.0)


def test_without_ffmpeg_a_gif_keeps_the_time(frames, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
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
    pytest.importorskip("imageio_ffmpeg")
    for frame in frames.iterdir():
        frame.write_bytes(b"not a picture")
    with pytest.raises(OSError, match="ffmpeg could not make the animation"):
        animate(frames, tmp_path / "animation", 30.0)
    assert [path.name for path in tmp_path.iterdir()] == ["preview"]


def test_gauges_are_drawn_with_the_amplitude_of_their_crests(tmp_path, monkeypatch):
    time = np.linspace(0.0, 2.0, 401)
    for name, amplitude in {"near": 0.0914, "far": 0.0832}.items():
        level = 0.15 + amplitude * np.exp(-(((time - 1.0) / 0.1) ** 2))
        lines = [f"{t:.6f},{z:.9g}" for t, z in zip(time, level, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["time [s],level [m]", *lines, ""]))
    (tmp_path / "empty.csv").write_text("time [s],level [m]\n")
    plots = []
    new_plots = preview.new_plots
    monkeypatch.setattr(preview, "new_plots", lambda count: plots.append(new_plots(count)) or plots[-1])
    gauge_picture([tmp_path / "near.csv", tmp_path / "far.csv", tmp_path / "empty.csv"], tmp_path / "gauges.png")
    (_, (axes,)) = plots[0]
    assert [text.get_text() for text in axes.texts] == ["0.091 m", "0.083 m"]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["near", "far"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "level − still level [m]")
    assert Image.open(tmp_path / "gauges.png").size == (1350, 630)


def test_body_in_space_shows_its_front_and_top_and_not_its_back():
    """Of the 12 triangles of a cube seen from the front, turned by 20 degrees about x, 4 face it; lit from above."""
    mesh = box_mesh([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0])
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    corners = mesh.vertices @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]).T
    faces, colors = _seen_from_the_front(corners, mesh.triangles, "#808080")
    assert len(faces) == 4 and colors.shape == (4, 3)
    normals = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    assert np.all(normals[:, 1] < 0.0)
    top = normals[:, 2] > np.abs(normals[:, 1])
    assert top.sum() == 2 and colors[top].min() > colors[~top].max()
