"""Rigid bodies on the device: their arrays, allocated once, and the launches of a step in which they move and touch."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from warpsph.bodies.arrays import Maker
from warpsph.bodies.body import Body
from warpsph.bodies.contact import Contacts
from warpsph.bodies.contact_geometry import ContactLegs, ContactPoints, corners_at
from warpsph.bodies.motion import KINDS, MotionTable
from warpsph.device.launch import Launch, Launcher
from warpsph.kernels import bodies as body_kernels
from warpsph.shapes.points import Array
from warpsph.shapes.sampling import Surface
from warpsph.shapes.section import MassProperties


class BodySet:
    """All bodies of a scene on a device, the ground first (index 0: walls, which never move).

    Arrays, of `count` entries: position [m], orientation, velocity [m/s] of the centre, spin [rad/s], force [N] and
    torque about the centre [N m] by the fluid, received [N s]: the impulse by contact in the last step; in 2-D the last
    three are for a slice 1 m wide.

    Points of the surfaces, of `point_count` entries: point_body, point_position [m], point_velocity [m/s],
    point_normal, point_before and point_after [m], all as the pair loops read them, and point_force [N], which they
    write.
    """

    def __init__(
        self,
        launcher: Launcher,
        bodies: Sequence[Body],
        walls: Sequence[ContactLegs] = (),
        wall_points: ContactPoints | None = None,
        *,
        dimensions: int = 2,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        smoothing_length: float,
        contact: bool = True,
    ) -> None:
        """`walls` and `wall_points` as of `contact_legs`, `facet_legs` and `contact_points`."""
        self.launcher, self.bodies = launcher, tuple(bodies)
        self.count = len(self.bodies) + 1
        self._make = Maker(launcher.device)
        self._load_bodies(np.asarray(gravity, float))
        self._load_motions()
        self._load_points()
        wall_points = wall_points or corners_at(np.empty((0, 3)))
        self.contacts = Contacts(launcher, self.bodies, walls, wall_points, dimensions, smoothing_length)
        self._has_contact = contact and self.contacts.leg_count > 0

    # ---- the launches, in the order of a step that starts at `time` and lasts `dt` (arrays of one on the device) ----

    def drift(self, begin: float, end: float, time: wp.array, dt: wp.array) -> Launch:
        """Bodies from the fractions `begin` to `end` of the step; their points follow by `move_points`."""
        part = {"begin": wp.float64(begin), "end": wp.float64(end), "time": time, "dt": dt}
        return self.launcher.record(body_kernels.drift_bodies, self.count, self, bodies=self.constants, **part)

    def move_points(self) -> Callable[[], None]:
        """Points, normals and the ways to their neighbours to where the bodies are."""
        if not self.point_count:
            return together()
        record = self.launcher.record
        body, offset, outward = self.point_body, self._offset, self._outward
        return together(
            record(body_kernels.move_points, self.point_count, self, body=body, offset=offset, outward=outward),
            *(
                record(body_kernels.turn_vectors, self.point_count, self, body=body, vector=vectors, turned=out)
                for vectors, out in ((self._before, self.point_before), (self._after, self.point_after))
            ),
        )

    def sum_loads(self) -> Callable[[], None]:
        """Force and torque on each body from the forces on its points, always in the same order."""
        if not self.point_count:
            return together()
        firsts = {"block_first": self._block_first, "block_body": self._block_body, "offset": self._offset}
        sums = {"block_force": self._block_force, "block_torque": self._block_torque}
        record = self.launcher.record
        return together(
            record(
                body_kernels.sum_load_blocks,
                self._block_count,
                self,
                force=self._block_force,
                torque=self._block_torque,
                **firsts,
            ),
            record(body_kernels.sum_loads, self.count, self, body_first_block=self._body_first_block, **sums),
        )

    def kick(self, time: wp.array, dt: wp.array) -> Callable[[], None]:
        """Velocity and spin by loads and gravity over the whole step, and then made admissible by contact."""
        kick = self.launcher.record(body_kernels.kick_bodies, self.count, self, bodies=self.constants, time=time, dt=dt)
        if not self._has_contact:
            return kick
        return together(kick, *self.contacts.launches(self, self.constants, dt))

    def kinetic_energy(self) -> Array:
        """Of each body, the ground's 0 [J], or [J/m] in 2-D; read back from the device."""
        energies = np.zeros(self.count)
        for b, body in enumerate(self.bodies, 1):
            R = rotation(self.orientation.numpy()[b])
            u, w = self.velocity.numpy()[b], R.T @ self.spin.numpy()[b]
            energies[b] = 0.5 * body.mass.mass * u @ u + 0.5 * w @ body.mass.inertia @ w
        return energies

    # ---- arrays ----

    def _load_bodies(self, gravity: Array) -> None:
        all_bodies = [_GROUND, *self.bodies]
        self.constants = constants = body_kernels.Bodies()
        constants.count, constants.gravity = self.count, wp.vec3d(*gravity)
        constants.mass = self._make.array([b.mass.mass for b in all_bodies], wp.float64)
        constants.inertia = self._make.array([b.mass.inertia for b in all_bodies], wp.mat33d)
        constants.free_shift = self._make.array([b.free_shift for b in all_bodies], wp.vec3d)
        constants.free_turn = self._make.array([b.free_turn for b in all_bodies], wp.vec3d)
        constants.release = self._make.array([b.release for b in all_bodies], wp.float64)

        self.position = self._make.array([b.mass.centre for b in all_bodies], wp.vec3d)
        self.orientation = self._make.array(np.tile([0.0, 0.0, 0.0, 1.0], (self.count, 1)), wp.quatd)
        self.velocity = self._make.array([b.velocity for b in all_bodies], wp.vec3d)
        self.spin = self._make.array([b.spin for b in all_bodies], wp.vec3d)
        self.force, self.torque = self._make.zeros(wp.vec3d, self.count), self._make.zeros(wp.vec3d, self.count)
        # Within a step.
        self.velocity_before, self.spin_before = (
            self._make.zeros(wp.vec3d, self.count),
            self._make.zeros(wp.vec3d, self.count),
        )
        self.inverse_mass = self._make.zeros(wp.vec3d, self.count)
        self.inverse_inertia = self._make.zeros(wp.mat33d, self.count)
        self.shift, self.turn = self._make.zeros(wp.vec3d, self.count), self._make.zeros(wp.vec3d, self.count)
        self.received = self._make.zeros(wp.vec3d, self.count)

    def _load_motions(self) -> None:
        all_motions = [None, *(b.motion for b in self.bodies)]
        tables = [m.table if m and m.table else _NO_ROWS for m in all_motions]
        centres = [np.zeros(3), *(b.mass.centre for b in self.bodies)]
        axes = [np.asarray(m.axis, float) if m else np.array([0.0, 1.0, 0.0]) for m in all_motions]
        pivots = [
            centre if m is None or m.pivot is None else m.pivot for m, centre in zip(all_motions, centres, strict=True)
        ]
        self.motions = motions = body_kernels.Motions()
        motions.kind = self._make.array([KINDS["fixed"], *(KINDS[m.kind] if m else 0 for m in all_motions[1:])], int)
        motions.position = self._make.array(centres, wp.vec3d)
        motions.orientation = self._make.array(np.tile([0.0, 0.0, 0.0, 1.0], (self.count, 1)), wp.quatd)
        motions.pivot = self._make.array(pivots, wp.vec3d)
        motions.axis = self._make.array([axis / np.linalg.norm(axis) for axis in axes], wp.vec3d)
        motions.direction = self._make.array([m.direction if m else np.zeros(3) for m in all_motions], wp.vec3d)
        for name, otherwise in {"turn": 0.0, "begin": 0.0, "period": 1.0, "phase": 0.0}.items():
            values = [getattr(m, name) if m else otherwise for m in all_motions]
            setattr(motions, name, self._make.array(values, wp.float64))
        rates = [table.rates() if len(table.time) else (table.shift, table.angle) for table in tables]
        motions.first_row = self._make.array(np.cumsum([0, *(len(table.time) for table in tables)]), int)
        motions.row_time = self._make.array(np.concatenate([table.time for table in tables]), wp.float64)
        motions.row_shift = self._make.array(np.concatenate([table.shift for table in tables]), wp.vec3d)
        motions.row_angle = self._make.array(np.concatenate([table.angle for table in tables]), wp.float64)
        motions.row_shift_rate = self._make.array(np.concatenate([shift for shift, _ in rates]), wp.vec3d)
        motions.row_angle_rate = self._make.array(np.concatenate([angle for _, angle in rates]), wp.float64)

    def _load_points(self) -> None:
        sets = [np.empty((0, 3)), *(b.surface.points - b.mass.centre for b in self.bodies)]
        sizes = [len(points) for points in sets]
        self.point_count = sum(sizes)

        def joined(name: str) -> Array:
            return np.concatenate([np.empty((0, 3)), *(getattr(b.surface, name) for b in self.bodies)])

        self.point_body = self._make.array(np.repeat(np.arange(self.count), sizes), int)
        self._offset = self._make.array(np.concatenate(sets), wp.vec3d)
        self._outward = self._make.array(joined("normals"), wp.vec3d)
        self._before, self._after = (
            self._make.array(joined("before"), wp.vec3d),
            self._make.array(joined("after"), wp.vec3d),
        )
        self.point_position, self.point_velocity, self.point_normal, self.point_before, self.point_after = (
            self._make.zeros(wp.vec3, self.point_count) for _ in range(5)
        )
        self.point_force = self._make.zeros(wp.vec3, self.point_count)
        self._block_count, self._block_first, self._block_body, self._body_first_block = self._make.blocks(sizes)
        self._block_force = self._make.zeros(wp.vec3d, self._block_count)
        self._block_torque = self._make.zeros(wp.vec3d, self._block_count)


def together(*launches: Callable[[], None]) -> Callable[[], None]:
    """What makes launches one after the other."""

    def launch() -> None:
        for one in launches:
            one()

    return launch


def rotation(quaternion: Array) -> Array:
    """The matrix of a unit quaternion [x, y, z, w], shape [3, 3]."""
    x, y, z, w = quaternion
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


_NO_ROWS = MotionTable(np.empty(0), np.empty((0, 3)), np.empty(0))
_NONE = np.empty((0, 3))
_GROUND = Body(
    name="the ground",
    mass=MassProperties(1.0, np.zeros(3), np.eye(3)),
    surface=Surface(_NONE, _NONE, np.empty(0), _NONE, _NONE),
    free_shift=(0.0, 0.0, 0.0),
    free_turn=(0.0, 0.0, 0.0),
)
