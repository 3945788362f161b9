"""Pictures of a run: what is drawn is measured in the pixels."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from warpsph.output.camera import Camera
from warpsph.output.frames import LIT, FrameWriter, Marks, _faces_seen, window_around
from warpsph.output.usd_scenery import DrawnBody
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
        walls=[np.array([[-1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])],
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


def test_the_window_holds_everything():
    (x_low, x_high), (z_low, z_high) = window_around(np.array([[-1.0, 0.6], [2.0, 0.0]]), SPACING)
    assert -1.1 < x_low < -1.0 < 2.0 < x_high < 2.1
    assert -0.1 < z_low < 0.0 < 0.6 < z_high < 0.7


def test_body_in_space_shows_its_front_and_top_and_not_its_back():
    """Of the 12 triangles of a cube seen from the front, turned by 20 degrees about x, 4 face it; lit from above."""
    mesh = box_mesh([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0])
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    corners = mesh.vertices @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]).T
    flat, depth, _ = Camera.of("front", corners.min(axis=0), corners.max(axis=0)).project(corners)
    faces, colors = _faces_seen(corners, flat, depth, mesh.triangles, "#808080")
    assert len(faces) == 4 and colors.shape == (4, 3)
    normals = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    assert np.all(normals[:, 1] < 0.0)
    top = normals[:, 2] > np.abs(normals[:, 1])
    assert top.sum() == 2 and colors[top].min() > colors[~top].max()


def test_the_fastest_water_stands_out_from_the_paper(writer):
    """Its contrast with white is more than 3 to 2 (relative luminance as WCAG 2 defines it)."""
    pixels = pixels_of(writer.write(0, snapshot_of(SLIDE, WATER, speed=9.0)))
    fastest = pixels[-54 - 40, round(74 + (1.0 - WINDOW[0][0]) * PIXELS_PER_METRE)] / 255.0
    linear = np.where(fastest <= 0.04045, fastest / 12.92, ((fastest + 0.055) / 1.055) ** 2.4)
    assert 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05) > 1.5


def test_gauges_and_the_still_level_are_marked(tmp_path):
    options = {"fluids": FLUIDS, "walls": [], "spacing": SPACING, "window": WINDOW, "speed_scale": 2.0}
    marks = Marks(gauges={"near": (1.25, 0.0)}, levels=[0.3], height=(0.0, 0.5))
    plain = FrameWriter(tmp_path / "plain", title="marks", **options)
    marked = FrameWriter(tmp_path / "marked", title="marks", marks=marks, **options)
    bare, shown = (pixels_of(one.write(0, snapshot_of(SLIDE, WATER))) for one in (plain, marked))
    changed = (bare != shown).any(axis=2)
    column = round(74 + (1.25 - WINDOW[0][0]) * PIXELS_PER_METRE)
    row = round(len(bare) - 54 - (0.3 - WINDOW[1][0]) * PIXELS_PER_METRE)
    assert changed[:, column - 1 : column + 2].any(axis=1).sum() > 100
    assert changed[row - 1 : row + 2].any(axis=0).sum() > 200
    water_rows = slice(len(bare) - 54 - 110, len(bare) - 54 - 60)
    # The mark of a gauge lies below the water, and shows through nothing but the rims of particles.
    assert np.abs(bare - shown)[water_rows, column - 1 : column + 2].mean() < 3.0


def test_a_camera_in_perspective_draws_the_nearer_larger():
    low, high = np.zeros(3), np.array([2.0, 1.0, 1.0])
    camera = Camera.of("perspective", low, high)
    assert camera.right @ camera.up == pytest.approx(0.0, abs=1e-15)
    flat, depth, size = camera.project(np.array([camera.focus, [2.0, 0.0, 1.0], [0.0, 1.0, 0.0]]))
    assert np.allclose([*flat[0], depth[0]], 0.0) and size[0] == 1.0
    assert depth[1] < 0.0 < depth[2] and size[1] > 1.0 > size[2]  # seen from the front, the right and above
    front, above = (Camera.of(name, low, high).project(np.array([[1.0, 2.0, 3.0]])) for name in ("front", "above"))
    assert front[0].tolist() == [[1.0, 3.0]] and above[0].tolist() == [[1.0, 2.0]]
    assert front[1] == 2.0 and above[1] == -3.0


def test_particles_before_a_body_cover_it_and_those_behind_do_not(tmp_path):
    mesh = box_mesh([-0.1, -0.1, -0.1], [0.1, 0.1, 0.1])
    body = DrawnBody(mesh.vertices, mesh.triangles.tolist(), "#ff0000")
    options = {"fluids": {"water": FLUIDS["water"]}, "walls": [], "spacing": SPACING, "speed_scale": 1.0}
    writer = FrameWriter(tmp_path, title="marks", window=WINDOW, bodies=[body], shading=LIT, **options)
    place = (np.array([1.0, 0.0, 0.1]), np.array([0.0, 0.0, 0.0, 1.0]))
    for y, is_seen in ((0.2, True), (-0.2, False)):
        snapshot = snapshot_of(block(0.5, 0.0, 1.0, 0.4)[:0], block(0.5, 0.0, 1.0, 0.4) + np.array([0.0, y, 0.0]))
        snapshot.fluid[:] = 0
        pixels = pixels_of(writer.write(0, snapshot, [place]))
        red = (pixels[:, :, 0] > 100) & (pixels[:, :, 1] < 50) & (pixels[:, :, 2] < 50)
        assert (red.sum() / PIXELS_PER_METRE**2 > 0.03) == is_seen
