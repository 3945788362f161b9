"""What takes the frames of a run: PNG pictures and an animation, the USD cache, particles for ParaView; the report."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
import warp as wp

import warpsph
from warpsph.device.launch import Launcher
from warpsph.output.colors import body_colors, fluid_colors
from warpsph.placement.drawing import wall_surface
from warpsph.placement.images import mirror_lines, periods
from warpsph.placement.origin import localised
from warpsph.placement.place import Start, typical_speed
from warpsph.scene.scene import Scene
from warpsph.simulation import Simulation, place_within
from warpsph.state import Snapshot

if TYPE_CHECKING:
    from warpsph.output.frames import FrameWriter
    from warpsph.output.usd_scenery import DrawnBody, Place


class Writer(Protocol):
    """Something that takes every frame of a run: pictures, a point cache, files of particles."""

    def write(self, frame: int, snapshot: Snapshot, places: Sequence[Place]) -> object:
        """Write frame `frame`: the fluid in `snapshot`, in id order, and where each body is."""

    def finish(self) -> None:
        """What is left to do when the last frame of a run is written."""


class Outputs:
    """What takes the frames of one run: the WRITERS that the scene asks for."""

    def __init__(self, scene: Scene, simulation: Simulation, folder: Path, resume_at: int | None) -> None:
        """`resume_at` is the first frame that is yet to come when a run goes on; None for a new run."""
        self._scene, self._simulation, self._folder, self._resume_at = scene, simulation, folder, resume_at
        self._frame = resume_at or 0
        self._thread = ThreadPoolExecutor(1)
        self._writing: Future[None] | None = None
        self._pinned: tuple[dict[str, wp.array], ...] = ({}, {})  # one is written out while the other is filled
        self._names = [name for name in WRITERS if getattr(scene.output, name)]
        self._writers: list[Writer] | None = None

    def _open(self) -> list[Writer]:
        """The writers, made with the first frame: Matplotlib and USD are loaded while the steps go on."""
        if self._writers is None:
            room = (self._scene, self._simulation, self._folder, self._resume_at)
            self._writers = [WRITERS[name](*room) for name in self._names]
        return self._writers

    def write_frame(self) -> None:
        """Take the fluid as it is now; a thread of its own hands it to the writers while the steps go on.

        What went wrong with the frame before, a full disk for one, is raised here.
        """
        if not self._names:
            return
        snapshot = self._simulation.state.snapshot(self._pinned[self._frame % 2])
        # Copies: on the CPU the places are views of arrays that the next steps write to.
        places = [(x.copy(), q.copy()) for x, q in self._simulation.bodies.places()] if self._simulation.bodies else []
        self.wait()
        self._writing = self._thread.submit(self._write, self._frame, snapshot, places)
        self._frame += 1

    def wait(self) -> None:
        """Return when every frame is on the disk."""
        if self._writing is not None:
            self._writing.result()

    def _write(self, frame: int, snapshot: Snapshot, places: list[Place]) -> None:
        for writer in self._open():
            writer.write(frame, snapshot, places)

    def finish(self) -> None:
        """Let the writers begin what comes last, such as the animation, which goes into the page of `report`."""
        self.wait()
        # Before the page is loaded beside them: USD gives Python up while it holds the loader of libraries, which the
        # page then waits for with Python in its hands. A run that ends before its first frame hung there.
        self._open()
        self._writing = self._thread.submit(self._finish)

    def _finish(self) -> None:
        for writer in self._open():
            writer.finish()

    def report(self) -> None:
        """Write the HTML page; needs run.json. Returns when all is on the disk."""
        from warpsph.output.report import write_report

        self.wait()
        write_report(self._folder)
        self._thread.shutdown()


class Pictures:
    """Frames as PNG, the animation that they make, and what gauges recorded."""

    def __init__(self, scene: Scene, simulation: Simulation, folder: Path, resume_at: int | None) -> None:
        self._scene, self._folder, self._frames = scene, folder, resume_at or 0
        self._drawer = frame_writer(scene, simulation.start, folder / "preview")

    def write(self, frame: int, snapshot: Snapshot, places: Sequence[Place]) -> None:
        """Draw a frame."""
        self._drawer.write(frame, snapshot, places)
        self._frames = frame + 1

    def finish(self) -> None:
        """Draw the gauge record, and make the animation."""
        preview, gauges = self._folder / "preview", self._scene.gauges
        if gauges:
            from warpsph.output.plots import gauge_picture

            gauge_picture([self._folder / "gauges" / f"{gauge.name}.csv" for gauge in gauges], preview / "gauges.png")
        if self._frames:
            from warpsph.output.animation import animate

            animate(preview, preview / "animation", self._scene.output.shown_per_second)


class Cache:
    """The USD point cache."""

    def __init__(self, scene: Scene, simulation: Simulation, folder: Path, resume_at: int | None) -> None:
        from pxr import Gf

        from warpsph.output.usd import UsdCache

        start = simulation.start
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
            resume_at=resume_at,
            rheology=bool(simulation.model.viscous and simulation.model.viscous.law),
            extent=start.fluid_box,
            fields=scene.output.usd_fields,
            shows_walls=scene.output.usd_walls,
        )

    def write(self, frame: int, snapshot: Snapshot, places: Sequence[Place]) -> None:
        """Write a frame, then the root that names it."""
        self._cache.write(snapshot, places)

    def finish(self) -> None:
        """Tell whoever took frames away on the way: raises FileNotFoundError."""
        from warpsph.output.usd import require_frames

        require_frames(self._cache.folder, self._cache.frame_count)


def particles(scene: Scene, simulation: Simulation, folder: Path, resume_at: int | None) -> Writer:
    """What writes particles for ParaView."""
    from warpsph.output.vtk import Particles

    fps = scene.output.frames_per_second
    return Particles(folder / "particles", origin=scene.origin, frames_per_second=fps, resume_at=resume_at)


# By the switches of `output` in a scene.
WRITERS: Mapping[str, Callable[[Scene, Simulation, Path, int | None], Writer]] = {
    "pictures": Pictures,
    "usd": Cache,
    "vtk": particles,
}
# What they, and whoever makes more of their frames later, call their files, by folder: a run that is replaced takes
# these away.
FILES: dict[str, str] = {
    "preview": r"\.?frame\.\d{5,}\.png|\.?animation\.(mp4|gif)|gauges\.png",
    "usd": r"\.?((scene|surface|manifest|surface_manifest)\.usda|static\.usdc)",
    "usd/frames": r"\.?(fluid|surface)\.\d{5,}\.usdc",
    "particles": r"\.?(fluid\.\d{5,}\.vtu|particles\.pvd)",
}


def drawn_bodies(scene: Scene, start: Start) -> dict[str, DrawnBody]:
    """What is drawn of each body."""
    from warpsph.output.usd_scenery import DrawnBody

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
    for side, name in enumerate(camera.axes or ()):  # the scene's own bounds win
        window[side] = getattr(view, name) or window[side]
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
