"""What is drawn and cached of a run: PNG frames, an animation, the gauge picture, the USD cache, the report."""

from __future__ import annotations

import logging
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

import warpsph
from warpsph.device.launch import Launcher
from warpsph.output.colors import body_colors, fluid_colors
from warpsph.placement.images import mirror_lines, periods
from warpsph.placement.origin import localised
from warpsph.placement.place import Start, typical_speed
from warpsph.scene.scene import Scene
from warpsph.shapes.surface import wall_surface
from warpsph.simulation import Simulation, place_within
from warpsph.state import Snapshot

if TYPE_CHECKING:
    from warpsph.output.frames import FrameWriter
    from warpsph.output.usd import DrawnBody, Place, UsdCache

log = logging.getLogger("warpsph")


class Outputs:
    """Pictures and cache of one run folder."""

    def __init__(self, scene: Scene, simulation: Simulation, folder: Path, resume_at: int | None) -> None:
        """`resume_at` is the first frame that is yet to come when a run goes on; None for a new run."""
        self._scene, self._simulation, self._folder, self._resume_at = scene, simulation, folder, resume_at
        self._frame = resume_at or 0
        self._writer, self._writing = ThreadPoolExecutor(1), None
        self._pinned: tuple[dict[str, wp.array], ...] = ({}, {})  # one is written out while the other is filled
        self._is_open = False
        self._pictures: FrameWriter | None = None
        self._cache: UsdCache | None = None

    def _open(self) -> None:
        """Make what draws and caches, with the first frame: Matplotlib and USD are loaded while the steps go on."""
        self._is_open = True
        scene, simulation, folder = self._scene, self._simulation, self._folder
        start = simulation.start
        if scene.output.pictures:
            self._pictures = frame_writer(scene, start, folder / "preview")
        if scene.output.usd:
            from pxr import Gf

            from warpsph.output.usd import UsdCache

            walls = {wall.name: wall_surface(scene, i) for i, wall in enumerate(scene.walls)}
            drawn = {name: wall.faces() if scene.dimensions == 3 else wall.lines()[0] for name, wall in walls.items()}
            crossings = periods(scene)
            self._cache = UsdCache(
                folder / "usd",
                fluids=fluid_colors(scene),
                walls=drawn | mirror_lines(scene, *start.box),
                bodies=drawn_bodies(scene, start),
                spacing=scene.spacing,
                origin=scene.origin,
                frames_per_second=scene.output.frames_per_second,
                provenance={
                    **{"title": scene.title, "source": scene.source, "warpsph": warpsph.__version__},
                    # Across these a particle may turn up on the other side from one frame to the next.
                    **({"periods": {name: Gf.Vec3d(*by) for name, by in crossings.items()}} if crossings else {}),
                },
                resume_at=self._resume_at,
                rheology=bool(simulation.model.viscous and simulation.model.viscous.law),
                extent=start.fluid_box,
                fields=scene.output.usd_fields,
                shows_walls=scene.output.usd_walls,
            )

    def write_frame(self) -> None:
        """Take the fluid as it is now; a thread of its own draws and caches it while the steps go on.

        What went wrong with the frame before, a full disk for one, is raised here.
        """
        if not (self._scene.output.pictures or self._scene.output.usd):
            return
        snapshot = self._simulation.state.snapshot(self._pinned[self._frame % 2])
        # Copies: on the CPU the places are views of what the steps that go on write to.
        places = [(x.copy(), q.copy()) for x, q in self._simulation.bodies.places()] if self._simulation.bodies else []
        self.wait()
        self._writing = self._writer.submit(self._write, self._frame, snapshot, places)
        self._frame += 1

    def wait(self) -> None:
        """Return when every frame is on the disk."""
        if self._writing is not None:
            self._writing.result()

    def _write(self, frame: int, snapshot: Snapshot, places: list[Place]) -> None:
        if not self._is_open:
            self._open()
        if self._pictures is not None:
            self._pictures.write(frame, snapshot, places)
        if self._cache is not None:
            self._cache.write(snapshot, places)

    def finish(self) -> None:
        """Draw the gauge record, and begin the animation, which goes into the page that `report` writes."""
        self.wait()
        if not self._is_open:
            self._open()
        if self._cache is not None:  # whoever took frames away on the way is told
            from warpsph.output.usd import require_frames

            require_frames(self._folder / "usd", self._cache.frame_count)
        preview, scene = self._folder / "preview", self._scene
        if self._pictures is not None and self._frame:
            from warpsph.output.animation import animate

            fps = scene.output.shown_per_second
            self._writing = self._writer.submit(animate, preview, preview / "animation", fps)
        if scene.output.pictures and scene.gauges:
            from warpsph.output.plots import gauge_picture

            gauge_picture(
                [self._folder / "gauges" / f"{gauge.name}.csv" for gauge in scene.gauges], preview / "gauges.png"
            )

    def report(self) -> None:
        """Write the HTML page; needs run.json. Returns when all is on the disk."""
        from warpsph.output.report import write_report

        self.wait()
        write_report(self._folder)
        self._writer.shutdown()


def drawn_bodies(scene: Scene, start: Start) -> dict[str, DrawnBody]:
    """What is drawn of each body."""
    from warpsph.output.usd import DrawnBody

    colors = body_colors(scene)
    return {
        body.name: DrawnBody(*solid.corners(), colors[body.name])
        for body, solid in zip(scene.bodies, start.solids, strict=True)
    }


def frame_writer(scene: Scene, start: Start, folder: Path) -> FrameWriter:
    """What draws the pictures of a scene that has been placed."""
    from warpsph.output.camera import Camera
    from warpsph.output.frames import FLAT, LIT, FrameWriter, Marks, window_around

    view, in_space = scene.output.view, scene.dimensions == 3
    projection = view.projection or ("perspective" if in_space else "front")
    walls = [wall_surface(scene, i) for i in range(len(scene.walls))]
    if in_space and projection != "front":
        lines = [np.concatenate([face, face[:1]]) for wall in walls for face in wall.faces()]
    else:
        flat = [*(line for wall in walls for line in wall.lines()), *mirror_lines(scene, *start.box).values()]
        lines = [np.insert(line, 1, 0.0, axis=1) for line in flat]
    faces = [face for wall in walls for face in wall.faces()]
    there = [*start.fluid_box, *(solid.samples for solid in start.solids), *lines, *faces]
    points = np.concatenate([np.atleast_2d(some) for some in there])
    low, high = points.min(axis=0), points.max(axis=0)
    for axis, seen in enumerate((view.x, view.y, view.z)):
        if seen:
            low[axis], high[axis] = seen
    camera = Camera.of(projection, low, high)
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    window = list(window_around(camera.project(corners)[0], scene.spacing))
    for side, axis in enumerate(camera.axes or ()):  # what the scene asks for is what is seen
        window[side] = getattr(view, axis) or window[side]
    return FrameWriter(
        folder,
        title=scene.title,
        fluids=fluid_colors(scene),
        walls=lines,
        bodies=list(drawn_bodies(scene, start).values()) if scene.bodies else (),
        spacing=scene.spacing,
        origin=scene.origin,
        camera=camera,
        window=(window[0], window[1]),
        speed_scale=scene.output.speed_scale or _round(typical_speed(scene, start)),
        marks=Marks(
            gauges={gauge.name: (gauge.x, gauge.y or 0.0) for gauge in scene.gauges},
            levels=[fluid.fill.level for fluid in scene.fluids if fluid.fill],
            height=(float(low[2]), float(high[2])),
        ),
        shading=LIT if in_space else FLAT,
    )


def picture_setup(scene: Scene, launcher: Launcher, path: Path) -> None:
    """Draw a scene before anything has moved into the PNG `path`.

    Raises:
        SceneError: it cannot be set up.
        NoRoomError: it does not fit into the memory.
    """
    scene = localised(scene)
    placement = place_within(scene, launcher.device)
    start, count = Start.of(placement), len(placement.position)
    snapshot = Snapshot(
        time=scene.start_time,
        step=0,
        position=placement.position,
        velocity=placement.velocity.astype(np.float32),
        density=np.zeros(count),
        pressure=np.zeros(count, dtype=np.float32),
        fluid=placement.fluid,
        id=np.arange(count),
    )
    places = [(solid.body.mass.centre, np.array([0.0, 0.0, 0.0, 1.0])) for solid in start.solids]
    path.write_bytes(frame_writer(scene, start, path.parent).draw(snapshot, places))


def _round(value: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten at or above `value`; 1 for nothing."""
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** math.floor(math.log10(value))
    return next(step * unit for step in (1.0, 2.0, 5.0, 10.0) if step * unit >= value * 0.999)
