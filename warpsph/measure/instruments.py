"""Instruments: probes of pressure and velocity, forces on walls, run-up along them, and what passes a line.

All of them read the fluid alone, whatever law its walls have. At a place x a field is the value of the linear function
that fits the particles around best, weighted by their kernel (moving least squares of first order, Lancaster &
Salkauskas 1981), so that on a wall, where half of the kernel sees no fluid, it is the wall's own. The force on a wall
is the integral of that pressure over its surface, without friction along it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpsph.bodies.body_set import rotation
from warpsph.kernels import instruments as kernels
from warpsph.kernels.neighbours import scatter_kernel
from warpsph.measure.compare import read_observed
from warpsph.model import Model
from warpsph.placement.drawing import wall_surface
from warpsph.scene.instruments import Force, RunUp
from warpsph.scene.scene import Scene
from warpsph.shapes.points import Array, spatial
from warpsph.shapes.wall import WallPart
from warpsph.state import State
from warpsph.step.bodies import Coupling
from warpsph.step.neighbours import Neighbours

# Where the fluid fills less of the kernel than this there is none: a lone particle half a spacing off fills 0.2.
LEAST_FRACTION = 0.1
# Second moments of the fluid around, over the moments of a full kernel, below which it has no slope in that way.
LEAST_MOMENT = 0.02
# A wall is wet where the fluid fills as much of the kernel as a level surface does that ends there, by the angle
# between the two: a quarter where the wall is upright. But at least, and at most, so much.
LEAST_WET, MOST_WET = 0.1, 0.4
# Wet pieces that reach less far along a wall, in spacings, are drops, and dry ones that reach less far are gaps.
LEAST_RUN, MOST_GAP = 3.0, 1.0
# Points of a wall in a spacing, along each way.
POINTS_PER_SPACING = {2: 2.0, 3: 1.0}


class Instruments:
    """The probes, forces, run-ups and overtoppings of a scene."""

    def __init__(self, model: Model, state: State, neighbours: Neighbours, bodies: Coupling | None) -> None:
        """Find the points that are looked at.

        Raises:
            SceneError: a part of a wall is empty, or what was observed cannot be read.
        """
        scene = model.scene
        self._scene, self._model, self._state, self._cells = scene, model, state, neighbours.cells
        self._bodies = bodies
        self._names = list(columns(scene))
        for i, probe in enumerate(scene.probes):
            try:
                _ = probe.observed and read_observed(probe.observed)
            except ValueError as error:
                raise scene.error(f"probes[{i}].observed", str(error)) from None
        if not self._names:
            return
        self._surfaces = {}
        for kind in ("forces", "run_up"):
            for i, part in enumerate(getattr(scene, kind)):
                self._surfaces[f"{kind}/{part.name}"] = part_of_wall(scene, f"{kind}[{i}]", part, model.sides)
        self._fixed = np.array([spatial(probe.at) for probe in scene.probes]).reshape(-1, 3)
        self._riding = self._find_riding()
        points = np.concatenate([self._fixed, *(one.points for one in self._surfaces.values())])
        normals = np.concatenate([np.zeros_like(self._fixed), *(one.normals for one in self._surfaces.values())])
        device = model.launcher.device
        self._points = wp.array(points, dtype=wp.vec3, device=device)
        self._normals = wp.array(normals, dtype=wp.vec3, device=device)
        self._sums = wp.zeros((len(points), kernels.SUMS), dtype=float, device=device)
        self._read: wp.array | None = None
        self._gates = self._make_gates()

    # ------------------------------------------------------------------------------------------------------ set up

    def _find_riding(self) -> dict[int, tuple[int, Array]]:
        """Which body a probe rides on, and where in its coordinates [m]."""
        riding = {}
        for i, probe in enumerate(self._scene.probes):
            if probe.body is not None and self._bodies:
                body = self._bodies.names.index(probe.body)
                x, q = self._bodies.places()[body]
                riding[i] = body, (self._fixed[i] - x) @ rotation(q)
        return riding

    def _make_gates(self) -> list[Callable[[], None]]:
        """What counts what passes; nothing where nobody asks."""
        gates, m, s = self._scene.overtopping, self._model, self._state
        if not gates:
            return []
        device, count = m.launcher.device, len(gates)
        corners = np.array([spatial(gate.start) for gate in gates])
        ways = np.array([spatial(gate.end) for gate in gates]) - corners
        if self._scene.dimensions == 2:
            along, up = ways, np.tile([0.0, 1.0, 0.0], (count, 1))
            normals = np.cross(up, along)
        else:
            along, up = ways * [1.0, 1.0, 0.0], ways * [0.0, 0.0, 1.0]
            normals = np.cross(along, up)
        struct = kernels.Gates()
        struct.count = count
        for name, values in {
            "corner": corners,
            "along": along,
            "up": up,
            "normal": normals / np.linalg.norm(normals, axis=1)[:, None],
        }.items():
            setattr(struct, name, wp.array(np.array(values, float), dtype=wp.vec3d, device=device))
        self.last_position = wp.zeros(m.particle_count, dtype=wp.vec3d, device=device)  # by id [m]
        self.volume = wp.zeros(count, dtype=wp.float64, device=device)  # that has passed each [m3, in 2-D m2]
        passed = wp.zeros((s.block_count, count), dtype=wp.float64, device=device)
        now = wp.zeros_like(self.last_position)
        fluid = wp.zeros(m.particle_count, dtype=int, device=device)
        order, count_all = scatter_kernel(wp.vec3d), m.particle_count
        m.launcher.run(order, count_all, place=s.id, values=s.position, values_out=self.last_position)
        # The volumes at the sample before, and its time [s].
        self.last_sample = wp.array(np.append(np.zeros(count), -np.inf), dtype=wp.float64, device=device)
        look = {"gates": struct, "fluid_count": len(m.fluid_names), "position": now, "fluid": fluid, "passed": passed}
        return [
            m.launcher.record(order, count_all, place=s.id, values=s.position, values_out=now),
            m.launcher.record(scatter_kernel(int), count_all, place=s.id, values=s.fluid, values_out=fluid),
            m.launcher.record(kernels.count_passing, s.block_count, m, s, **look, last_position=self.last_position),
            m.launcher.record(kernels.add_passed, count, block_count=s.block_count, passed=passed, volume=self.volume),
            lambda: wp.copy(self.last_position, now),
        ]

    def kept(self) -> dict[str, wp.array]:
        """The arrays that a checkpoint keeps, by name."""
        if not self._scene.overtopping:
            return {}
        names = ("last_position", "volume", "last_sample")
        return {f"instruments.{name}": getattr(self, name) for name in names}

    # ------------------------------------------------------------------------------------------------------- reading

    def _look(self) -> None:
        """Sum up what is around each point."""
        m, s = self._model, self._state
        if self._read is not s.position_volume:
            self._read = s.position_volume
            self._launch = m.launcher.record(
                kernels.probe_kernel(m.scene.smoothing.kernel),
                len(self._points),
                m,
                s,
                reach=m.support + m.longest_motion,
                start=self._cells.start,
                point=self._points,
                normal=self._normals,
                sums=self._sums,
            )
        if self._bodies and self._riding:
            points, places = self._points.numpy().copy(), self._bodies.places()
            for i, (body, offset) in self._riding.items():
                x, q = places[body]
                points[i] = x + rotation(q) @ offset
            self._points.assign(points)
        self._launch()

    def rows(self, time: float) -> list[tuple[str, list[float]]]:
        """The name of each record and its row at `time` [s], columns as `columns`."""
        if not self._names:
            return []
        rows = []
        if len(self._points):
            self._look()
            sums = self._sums.numpy()
            fraction = sums[:, 0]
            values = fitted(sums, self._scene.dimensions)
            axes = [0, 2] if self._scene.dimensions == 2 else [0, 1, 2]
            for i, probe in enumerate(self._scene.probes):
                p, *u = values[i]
                rows.append((f"probes/{probe.name}", [p, *(u[axis] for axis in axes)]))
            first = len(self._scene.probes)
            for name, surface in self._surfaces.items():
                mine = slice(first, first + len(surface.points))
                first = mine.stop
                if name.startswith("forces/"):
                    force = next(one for one in self._scene.forces if f"forces/{one.name}" == name)
                    about = spatial(force.about) if force.about else -np.array(self._scene.origin)
                    rows.append((name, force_on(surface, values[mine, 0], about, axes)))
                else:
                    rows.append((name, self._run_up(surface, fraction[mine], axes)))
        if self._gates:
            for launch in self._gates:
                launch()
            volume = self.volume.numpy().copy()
            *before, then = self.last_sample.numpy().tolist()
            self.last_sample.assign(np.append(volume, time))
            rate = (volume - before) / (time - then) if time > then else np.zeros(len(volume))
            for gate, one, flow in zip(self._scene.overtopping, volume, rate, strict=True):
                rows.append((f"overtopping/{gate.name}", [float(one), float(flow)]))
        return rows

    def _run_up(self, surface: WallPart, fraction: Array, axes: list[int]) -> list[float]:
        """Where the highest wet point of a wall is [m], and how far along it; not a number where all of it is dry."""
        steep = np.arccos(np.clip(surface.normals[:, 2], -1.0, 1.0)) / (2.0 * np.pi)
        excess = fraction - np.clip(steep, LEAST_WET, MOST_WET)
        wet = _without_drops(np.flatnonzero(excess >= 0.0), surface.along, self._model.spacing)
        if not len(wet):
            return [float("nan")] * (len(axes) + 1)
        k = wet[np.argmax(surface.points[wet, 2])]
        point, along = surface.points[k].copy(), float(surface.along[k])
        # Between it and the next point up the wall the excess falls through 0.
        for other in (k - 1, k + 1):
            if (
                0 <= other < len(excess)
                and excess[other] < 0.0
                and surface.points[other, 2] > point[2]
                and np.linalg.norm(surface.points[other] - point) < 1.5 * self._model.spacing
            ):
                share = excess[k] / (excess[k] - excess[other])
                point += share * (surface.points[other] - point)
                along += share * float(surface.along[other] - along)
                break
        return [*(float(point[axis]) for axis in axes), along]


def _without_drops(wet: NDArray[np.int64], along: Array, spacing: float) -> NDArray[np.int64]:
    """The indices of wet pieces that lie in runs long enough; all wet pieces where no outline orders them."""
    if not len(wet) or np.isnan(along[wet]).any():
        return wet
    steps = np.diff(along[wet])
    breaks = np.flatnonzero((steps < 0.0) | (steps > (MOST_GAP + 1.0) * spacing)) + 1
    runs = np.split(wet, breaks)
    kept = [run for run in runs if along[run[-1]] - along[run[0]] >= LEAST_RUN * spacing]
    return np.concatenate(kept) if kept else wet[:0]


def columns(scene: Scene) -> dict[str, list[str]]:
    """The columns of the record of each instrument after its time, by the path of its file without .csv."""
    axes, speeds = ("xz", "uw") if scene.dimensions == 2 else ("xyz", "uvw")
    force, torque, volume = ("N/m", "N m/m", "m3/m") if scene.dimensions == 2 else ("N", "N m", "m3")
    places = [f"{axis} [m]" for axis in axes]
    torques = [f"torque [{torque}]"] if scene.dimensions == 2 else [f"torque {axis} [{torque}]" for axis in axes]
    flow = "m3/s/m" if scene.dimensions == 2 else "m3/s"
    return {
        **{f"probes/{one.name}": ["pressure [Pa]", *(f"{u} [m/s]" for u in speeds)] for one in scene.probes},
        **{f"forces/{one.name}": [*(f"force {a} [{force}]" for a in axes), *torques, *places] for one in scene.forces},
        **{f"run_up/{one.name}": [*places, "length [m]"] for one in scene.run_up},
        **{f"overtopping/{one.name}": [f"volume [{volume}]", f"discharge [{flow}]"] for one in scene.overtopping},
    }


def part_of_wall(scene: Scene, path: str, part: Force | RunUp, sides: Sequence[int]) -> WallPart:
    """The part of a wall that a force or a run-up is about: a point in the middle of each piece of it.

    Raises:
        SceneError: there is nothing of the wall in its box.
    """
    index = [wall.name for wall in scene.walls].index(part.wall)
    wall, spacing = wall_surface(scene, index), scene.spacing / POINTS_PER_SPACING[scene.dimensions]
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    if part.part:
        reach = 1e-6 * scene.spacing  # what lies on the face of the box is in it
        low, high = spatial(part.part.min) - reach, spatial(part.part.max) + reach
        if scene.dimensions == 2:
            low[1], high[1] = -np.inf, np.inf
    surface = wall.pieces(spacing, low, high)
    kept = surface.areas > 1e-4 * surface.areas.max()  # but for slivers that rounding leaves
    if not kept.any() or not surface.areas.any():
        raise scene.error(f"{path}.part", f"there is nothing of wall '{part.wall}' in it")
    return WallPart(
        surface.points[kept], (surface.normals * sides[index])[kept], surface.areas[kept], surface.along[kept]
    )


def fitted(sums: Array, dimensions: int) -> Array:
    """Pressure [Pa] and velocity [m/s] at points, shape [n, 4], of the sums that `probe_kernel` makes.

    No pressure and not a number of velocity where there is no fluid; the mean of what is around where that has no slope
    along some way.
    """
    axes = [0, 2] if dimensions == 2 else [0, 1, 2]
    weight = np.maximum(sums[:, 0].astype(float), 1e-30)
    mean = sums[:, 1:4][:, axes] / weight[:, None]
    # Second moments about the mean, x, y, z then xy, xz, yz.
    place = {(0, 0): 4, (1, 1): 5, (2, 2): 6, (0, 1): 7, (0, 2): 8, (1, 2): 9}
    moments = np.array([[sums[:, place[min(a, b), max(a, b)]] for b in axes] for a in axes]).transpose(2, 0, 1)
    moments = moments / weight[:, None, None] - mean[:, :, None] * mean[:, None, :]
    values, ways = np.linalg.eigh(moments)
    steep = values > LEAST_MOMENT
    inverse = np.where(steep, 1.0 / np.where(steep, values, 1.0), 0.0)
    found = np.empty((len(sums), 4))
    for k in range(4):
        first = sums[:, 10 + 4 * k] / weight
        mixed = sums[:, 11 + 4 * k : 14 + 4 * k][:, axes] / weight[:, None] - mean * first[:, None]
        along = np.einsum("nab,na->nb", ways, mixed) * inverse
        slope = np.einsum("nab,nb->na", ways, along)
        found[:, k] = first - np.einsum("na,na->n", slope, mean)
    dry = sums[:, 0] < LEAST_FRACTION
    found[dry, 0], found[dry, 1:] = 0.0, np.nan
    return found


def force_on(surface: WallPart, pressure: Array, about: Array, axes: list[int]) -> list[float]:
    """Force of the pressure at the points of a surface [N, in 2-D N/m], its torque about a point, counter-clockwise in
    2-D, and its point of attack, where the surface is pressed on the average [m]; not a number where there is none."""
    # A wall holds no fluid back that is in tension.
    pushes = -(np.maximum(pressure, 0.0) * surface.areas)[:, None] * surface.normals
    force = pushes.sum(axis=0)
    torque = np.cross(surface.points - about, pushes).sum(axis=0)
    strength = np.linalg.norm(pushes, axis=1)
    total = float(strength.sum())
    attack = (strength @ surface.points) / total if total > 0.0 else np.full(3, np.nan)
    turn = [-torque[1]] if len(axes) == 2 else list(torque)
    return [*map(float, (force[axis] for axis in axes)), *map(float, turn), *map(float, (attack[a] for a in axes))]
