"""Bodies in the fluid: the lists that join them, and the launches by which they push each other in a step."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpsph.bodies.body_set import BodySet, rotation, together
from warpsph.device.cells import Cells
from warpsph.device.launch import Launch, alias
from warpsph.kernels import loads
from warpsph.kernels.walls import wall_acceleration_kernel
from warpsph.model import Model
from warpsph.placement.bodies import contact_of_walls
from warpsph.placement.drawing import wall_surface
from warpsph.placement.place import Start
from warpsph.state import State
from warpsph.step.act import Stage

# No body may move farther than this in a step, in smoothing lengths: contact looks no farther ahead.
MOST_STEP = 0.1
# How far bodies may move before their points are listed anew, in supports.
MOST_MOTION = 0.35


class Coupling:
    """The bodies of a scene among its fluid.

    Lists of body points reach so far that no particle and no body can come within each other's support before the
    lists are made anew: particles because those of the fluid bound how far any one may go, bodies by a watch of their
    own.

    Attributes:
        set: The bodies on the device.
        first, list: Body points of particle i are list[first[i] : first[i + 1]].
    """

    # All that a checkpoint keeps of bodies.
    KEPT = ("position", "orientation", "velocity", "spin")
    LISTED = ("listed_position", "listed_orientation", "listed_point", "last_velocity")

    def __init__(self, model: Model, state: State, start: Start) -> None:
        scene, launcher = model.scene, model.launcher
        self.model, self.state = model, state
        self.solids = start.solids
        walls = [wall_surface(scene, i) for i in range(len(scene.walls))]
        legs, points = contact_of_walls(scene, walls, start.sides)
        self.set = b = BodySet(
            launcher,
            [solid.body for solid in start.solids],
            legs,
            points,
            dimensions=scene.dimensions,
            gravity=(0.0, 0.0, -scene.gravity),
            smoothing_length=scene.smoothing_length,
        )
        self.names = [solid.body.name for solid in start.solids]
        self._start = [(np.array(s.body.velocity, float), np.array(s.body.spin, float)) for s in start.solids]
        self._hold_still()
        b.move_points()()

        # A law that goes by legs reaches as far beyond its support as a point's leg.
        self._reach = max(model.support + scene.wall_spacing, model.list_radius)
        # The lists of dummies reach less far, and need to know less far ahead.
        self._most_step = (0.5 if model.has_dummies else 1.0) * MOST_STEP * scene.smoothing_length
        self._most_motion = model.body_skin if model.has_dummies else MOST_MOTION * model.support
        self._radius = self._reach + model.longest_motion + self._most_motion
        firsts = np.concatenate([[0], np.cumsum([0, *(len(s.body.surface.points) for s in start.solids)])])
        reach = [0.0, *(_farthest(s.body.surface.points - s.body.mass.centre) for s in start.solids)]
        # Contact may move a corner that stands farther out than the points.
        swept = [0.0, *(_farthest(s.corners()[0]) for s in start.solids)]
        device, count = launcher.device, model.particle_count
        self._body_first = wp.array(firsts, dtype=int, device=device)
        self._body_reach = wp.array(np.array(reach) * (1.0 + 1e-5), dtype=float, device=device)
        self._swept = wp.array(swept, dtype=float, device=device)
        self._count = wp.zeros(count + 1, dtype=int, device=device)
        self.first = wp.zeros(count + 1, dtype=int, device=device)
        self.list = wp.zeros(1024, dtype=int, device=device)
        self.listed_position, self.listed_orientation = wp.clone(b.position), wp.clone(b.orientation)
        self.listed_point = wp.clone(b.point_position)
        self.last_velocity = wp.clone(b.point_velocity)  # of the points, when dummies were last pressed [m/s]
        self._record()

    def kept(self) -> dict[str, wp.array]:
        """The arrays that a checkpoint keeps, by name."""
        arrays = {f"bodies.{name}": getattr(self.set, name) for name in self.KEPT}
        contacts = self.set.contacts
        last = {"_impulse": contacts.last_impulse, "_last_key": contacts.last_key, "_last_count": contacts.last_count}
        arrays |= {f"bodies.{name}": array for name, array in last.items()}
        return arrays | {f"bodies.{name}": getattr(self, name) for name in self.LISTED}

    # ------------------------------------------------------------------------------------------------------- the lists

    def _record(self) -> None:
        """Bind the launches that list to the arrays as they are now."""
        named = {
            "body_count": self.set.count,
            "radius": self._radius,
            "body_position": self.listed_position,
            "body_reach": self._body_reach,
            "body_first": self._body_first,
            "position": self.state.listed_position,
            "point_position": self.listed_point,
            "point_first": self.first,
            "count": self._count,
            "list": self.list,
        }
        self._count_points, self._list_points = (
            self.model.launcher.record(loads.body_points_kernel(listing), self.model.particle_count, **named)
            for listing in (False, True)
        )

    def note_places(self) -> None:
        """Note where bodies are: there their points are listed next."""
        for listed, now in (
            (self.listed_position, self.set.position),
            (self.listed_orientation, self.set.orientation),
            (self.listed_point, self.set.point_position),
        ):
            wp.copy(listed, now)

    def relist(self) -> bool:
        """List the points of bodies where they were listed last.

        Returns True when the list had to grow: launches that were bound to the old one must be recorded again. Dummy
        particles are on the lists of neighbours instead.
        """
        if self.model.has_dummies:
            return False
        self._count_points()
        wp.utils.array_scan(self._count, self.first, inclusive=False)
        last = alias(self.first, int, 1, 4 * self.model.particle_count)
        total = int(self.model.launcher.read(last)[0])
        grown = total > len(self.list)
        if grown:
            self.list = wp.zeros(total + total // 4, dtype=int, device=self.model.launcher.device)
            self._record()
        self._list_points()
        return grown

    # ---------------------------------------------------------------------------------------- the launches, in order

    @property
    def entries(self) -> int:
        """How many entries of the clock are theirs."""
        return 1

    def drift_half(self) -> list[Stage]:
        """Bodies and their points to n+1/2."""
        s = self.state
        return [together(self.set.drift(0.0, 0.5, s.time, s.dt), self.set.move_points())]

    def push_fluid(self) -> list[Launch]:
        """What bodies do to the fluid, on top of the walls' share: after the walls."""
        s, m, b = self.state, self.model, self.set
        kernel = wall_acceleration_kernel(m.scene.wall_model.force, m.scene.smoothing.kernel, moving=True)
        points = {
            "wall_position": b.point_position,
            "wall_velocity": b.point_velocity,
            "wall_normal": b.point_normal,
            "wall_before": b.point_before,
            "wall_after": b.point_after,
            "wall_first": self.first,
            "wall_list": self.list,
        }
        return [m.launcher.record(kernel, m.particle_count, m, s, **points)]

    def take_loads(self, cells: Cells) -> list[Stage]:
        """What the fluid does to bodies, at n+1/2."""
        m, b = self.model, self.set
        near = {"reach": self._reach, "motion": m.longest_motion, "start": cells.start}
        kernel = loads.reaction_kernel(m.scene.wall_model.force, m.scene.smoothing.kernel)
        react = m.launcher.record(kernel, b.point_count, m, self.state, b, force=b.point_force, **near)
        return [together(react, b.sum_loads())]

    def kick_and_drift(self) -> list[Stage]:
        """Velocities to n+1 by loads, gravity and contact, then places."""
        s, b = self.state, self.set
        return [together(b.kick(s.time, s.dt), b.drift(0.5, 1.0, s.time, s.dt), b.move_points())]

    def watch(self) -> list[Launch]:
        """What the bodies allow of the next step, and of the lists: into the last of the entries of the clock."""
        s, b = self.state, self.set
        limits = {"most_step": self._most_step, "most_motion": self._most_motion, "body_reach": self._swept}
        entries = {
            "dt_limit": alias(s.block_dt_limit, float, 1, 4 * s.block_count),
            "strain": alias(s.block_strain, float, 1, 4 * s.strain_block_count),
        }
        listed = {"listed_position": self.listed_position, "listed_orientation": self.listed_orientation}
        record = self.model.launcher.record
        return [record(loads.watch_bodies, 1, b, body_count=b.count, **listed, **limits, **entries)]

    # -------------------------------------------------------------------------------------------- between the steps

    def move_points(self) -> None:
        """The points of the surfaces to where the bodies are."""
        self.set.move_points()()

    def release(self) -> None:
        """Give the held bodies the velocities with which they start."""
        self._set_velocities([body.release > -np.inf for body in self.set.bodies], moving=True)

    def _hold_still(self) -> None:
        self._set_velocities([body.release > -np.inf for body in self.set.bodies], moving=False)

    def _set_velocities(self, which: list[bool], moving: bool) -> None:
        velocity, spin = self.set.velocity.numpy(), self.set.spin.numpy()
        for b, (is_held, start) in enumerate(zip(which, self._start, strict=True), 1):
            if is_held:
                velocity[b], spin[b] = start if moving else (np.zeros(3), np.zeros(3))
        self.set.velocity.assign(velocity)
        self.set.spin.assign(spin)

    def energies(self) -> tuple[float, float]:
        """Kinetic and potential energy (above z = 0) of bodies that are not prescribed [J], or [J/m] in 2-D."""
        kinetic, z = self.set.kinetic_energy()[1:], self.set.position.numpy()[1:, 2]
        free = np.array([body.motion is None for body in self.set.bodies])
        weight = self.model.scene.gravity * np.array([body.mass.mass for body in self.set.bodies])
        return float(kinetic[free].sum()), float((weight * z)[free].sum())

    def holds(self, position: np.ndarray) -> np.ndarray:
        """Whether each of `position` [m], shape [n, 3], lies in a body, deeper than a tenth of a spacing, shape [n]."""
        found = np.zeros(len(position), dtype=bool)
        slack = 0.1 * self.model.spacing
        for solid, (x, q) in zip(self.solids, self.places(), strict=True):
            drawn = (position - x) @ rotation(q) + solid.body.mass.centre
            inside = np.flatnonzero(solid.contains(drawn))
            found[inside[solid.distance(drawn[inside]) > slack]] = True
        return found

    def places(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Position of the centre [m] and orientation (a quaternion [x, y, z, w]) of each body."""
        return list(zip(self.set.position.numpy()[1:], self.set.orientation.numpy()[1:], strict=True))

    def rows(self) -> list[list[float]]:
        """A row of the record of each body, columns as `columns`."""
        names = ("position", "orientation", "velocity", "spin", "force", "torque")
        arrays = [getattr(self.set, name).numpy()[1:] for name in names]
        if self.model.scene.dimensions == 3:
            return [list(np.concatenate(row)) for row in zip(*arrays, strict=True)]
        # Counter-clockwise as one looks at the x-z plane is negative about y.
        return [
            [x[0], x[2], -2.0 * np.degrees(np.arctan2(q[1], q[3])), u[0], u[2], -w[1], f[0], f[2], -t[1]]
            for x, q, u, w, f, t in zip(*arrays, strict=True)
        ]


class NoBodies:
    """Those of a scene without any."""

    @property
    def entries(self) -> int:
        """None of the clock's."""
        return 0

    def drift_half(self) -> list[Stage]:
        """None."""
        return []

    def push_fluid(self) -> list[Launch]:
        """None."""
        return []

    def take_loads(self, cells: Cells) -> list[Stage]:
        """None."""
        return []

    def kick_and_drift(self) -> list[Stage]:
        """None."""
        return []

    def watch(self) -> list[Launch]:
        """None."""
        return []

    def note_places(self) -> None:
        """Nothing to note."""

    def relist(self) -> bool:
        """Nothing to list."""
        return False

    def move_points(self) -> None:
        """Nothing to move."""


def columns(dimensions: int) -> list[str]:
    """Columns of the record of a body after its time."""
    if dimensions == 2:
        place = ["x [m]", "z [m]", "angle [deg]", "u [m/s]", "w [m/s]", "spin [rad/s]"]
        return [*place, "force x [N/m]", "force z [N/m]", "torque [N m/m]"]
    place = ["x [m]", "y [m]", "z [m]", *(f"q{axis}" for axis in "xyzw")]
    motion = ["u [m/s]", "v [m/s]", "w [m/s]", *(f"spin {axis} [rad/s]" for axis in "xyz")]
    return [*place, *motion, *(f"force {axis} [N]" for axis in "xyz"), *(f"torque {axis} [N m]" for axis in "xyz")]


def _farthest(offsets: np.ndarray) -> float:
    return float(np.linalg.norm(offsets, axis=1).max())
