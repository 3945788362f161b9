"""What is drawn and cached of a run: PNG frames, an animation, the gauge picture, the USD cache, the report."""

from __future__ import annotations

import logging
import math
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

import warpsph
from warpsph.placement.images import mirror_lines, periods
from warpsph.placement.place import typical_speed
from warpsph.scene.scene import Scene
from warpsph.shapes.surface import wall_surface
from warpsph.simulation import Simulation
from warpsph.state import Snapshot

if TYPE_CHECKING:
    from warpsph.output.frames import FrameWriter
    from warpsph.output.usd import Place, UsdCache

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
        from pxr import Gf

        from warpsph.output.frames import BODY_PALETTE, FrameWriter, fluid_colors, window_around
        from warpsph.output.usd import DrawnBody, UsdCache

        self._is_open = True
        scene, simulation, folder = self._scene, self._simulation, self._folder
        start = simulation.start
        colors = {name: material.color for name, material in scene.materials.items()}
        fluids = fluid_colors({fluid.name: fluid.material for fluid in scene.fluids}, colors)
        walls = {wall.name: wall_surface(scene, i) for i, wall in enumerate(scene.walls)}
        bodies = {
            body.name: DrawnBody(*solid.corners(), body.color or color)
            for body, solid, color in zip(scene.bodies, start.solids, cycle(BODY_PALETTE), strict=False)
        }
        drawn = {name: wall.faces() if scene.dimensions == 3 else wall.lines()[0] for name, wall in walls.items()}
        mirrors = mirror_lines(scene, *start.box)
        crossings = periods(scene)
        if scene.output.pictures:
            view = scene.output.view
            lines = [*(line for wall in walls.values() for line in wall.lines()), *mirrors.values()]
            seen = [np.stack(start.fluid_box)[:, ::2], *lines, *(solid.samples[:, ::2] for solid in start.solids)]
            self._pictures = FrameWriter(
                folder / "preview",
                title=scene.title,
                fluids=fluids,
                walls=lines,
                bodies=list(bodies.values()),
                spacing=scene.spacing,
                origin=(scene.origin[0], scene.origin[2]),
                window=(view.x, view.z) if view else window_around(np.concatenate(seen), scene.spacing),
                speed_scale=scene.output.speed_scale or _round(typical_speed(scene, start)),
            )
        if scene.output.usd:
            self._cache = UsdCache(
                folder / "usd",
                fluids=fluids,
                walls=drawn | mirrors,
                bodies=bodies,
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
        """Draw the gauge record, and begin the animation: it is made beside the report, `report` waits for it."""
        from warpsph.output.frames import animate, gauge_picture

        self.wait()
        if not self._is_open:
            self._open()
        if self._cache is not None:  # whoever took frames away on the way is told
            from warpsph.output.usd import require_frames

            require_frames(self._folder / "usd", self._cache.frame_count)
        preview, scene = self._folder / "preview", self._scene
        if self._pictures is not None and self._frame:
            fps = scene.output.frames_per_second
            self._writing = self._writer.submit(animate, preview, preview / "animation", fps)
        if scene.output.pictures and scene.gauges:
            gauge_picture(
                [self._folder / "gauges" / f"{gauge.name}.csv" for gauge in scene.gauges], preview / "gauges.png"
            )

    def report(self) -> None:
        """Write the HTML page; needs run.json. Returns when all is on the disk."""
        from warpsph.output.report import write_report

        write_report(self._folder)
        self.wait()
        self._writer.shutdown()


def _round(value: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten at or above `value`; 1 for nothing."""
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** math.floor(math.log10(value))
    return next(step * unit for step in (1.0, 2.0, 5.0, 10.0) if step * unit >= value * 0.999)
