"""Rigid bodies on the device: their arrays, allocated once, and the launches of a step in which they move and touch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from warpsph.bodies.body import Body
from warpsph.bodies.contact_geometry import (
    ContactLegs,
    ContactPoints,
    contact_depth,
    corners_at,
    joined,
    joined_legs,
    touching,
)
from warpsph.bodies.motion import KINDS, MotionTable
from warpsph.device.launch import Launch, Launcher
from warpsph.kernels import bodies as body_kernels
from warpsph.kernels import contact as contact_kernels
from warpsph.kernels import contact_solver
from warpsph.shapes.points import Array
from warpsph.shapes.sampling import Surface
from warpsph.shapes.section import MassProperties

# Points whose loads one thread sums; a fixed number, so that sums do not depend on the threads.
BLOCK_SIZE = 64
# Contacts kept of a body and a leg (see kernels/contact.py), and of a body.
SLOTS = {2: 3, 3: 9}
CAPACITY = {2: 32, 3: 128}
SWEEPS = 100
TOLERANCE = 1e-12
TILT = 1e-3
# Speeds below which a contact sticks, and not more than which a bounce is none [m/s].
STILL, CREEP = 1e-4, 1e-2


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
        self._load_bodies(np.asarray(gravity, float))
        self._load_motions()
        self._load_points()
        self._load_contact(list(walls), wall_points or corners_at(np.empty((0, 3))), dimensions, smoothing_length)
        self._has_contact = contact and len(self._legs) > 0

    # ---- the launches, in the order of a step that starts at `time` and lasts `dt` (arrays of one on the device) ----

    def drift(self, begin: float, end: float, time: wp.array, dt: wp.array) -> Launch:
        """Bodies from the fractions `begin` to `end` of the step; their points follow by `move_points`."""
        state = [self.shift, self.turn, self.position, self.orientation, self.velocity, self.spin]
        part = [wp.float64(begin), wp.float64(end), time, dt]
        return self.launcher.record_in_order(
            body_kernels.drift_bodies, self.count, [self.constants, self.motions, *part, *state]
        )

    def move_points(self) -> Launch:
        """Points, normals and the ways to their neighbours to where the bodies are."""
        if not self.point_count:
            return lambda: None
        state = [self.position, self.orientation, self.velocity, self.spin]
        points = [self.point_position, self.point_velocity, self.point_normal]
        launches = [
            self.launcher.record_in_order(
                body_kernels.move_points,
                self.point_count,
                [self.point_body, self._offset, self._outward, *state, *points],
            )
        ] + [
            self.launcher.record_in_order(
                body_kernels.turn_vectors, self.point_count, [self.point_body, vectors, self.orientation, out]
            )
            for vectors, out in ((self._before, self.point_before), (self._after, self.point_after))
        ]

        def launch() -> None:
            for one in launches:
                one()

        return launch

    def sum_loads(self) -> Launch:
        """Force and torque on each body from the forces on its points, always in the same order."""
        blocks = [self._block_first, self._block_body, self._offset, self.orientation, self.point_force]
        sums = [self._block_force, self._block_torque]
        if not self.point_count:
            return lambda: None
        by_block = self.launcher.record_in_order(body_kernels.sum_load_blocks, self._block_count, [*blocks, *sums])
        by_body = self.launcher.record_in_order(
            body_kernels.sum_loads, self.count, [self._body_first_block, *sums, self.force, self.torque]
        )

        def launch() -> None:
            by_block()
            by_body()

        return launch

    def kick(self, time: wp.array, dt: wp.array) -> Launch:
        """Velocity and spin by loads and gravity over the whole step, and then made admissible by contact."""
        inverse = [self.inverse_mass, self.inverse_inertia]
        before = [self.velocity_before, self.spin_before]
        kick = self.launcher.record_in_order(
            body_kernels.kick_bodies,
            self.count,
            [
                *(self.constants, self.motions, time, dt, self.force, self.torque),
                *(self.orientation, self.velocity, self.spin, *before, *inverse),
            ],
        )
        if not self._has_contact:
            return kick
        leg_count = len(self._legs)
        place = [self.position, self.orientation]
        find = self.launcher.record_in_order(
            contact_kernels.find_contacts,
            self.count * leg_count,
            [self.contact, leg_count, *place, self.inverse_mass, self._chosen, self._touched],
        )
        gather = self.launcher.record_in_order(
            contact_solver.gather_contacts,
            self.count,
            [
                *(self.contact, leg_count, dt, self._chosen),
                *(*place, self.velocity, self.spin, *before, *inverse),
                *(self._last_count, self._last_key, self._impulse),
                *(self.contact_count, self._key, self._other, self._place, self._normal),
                *(self.contact_gap, self._target, self._friction, self._inverse_compliance, self._start_impulse),
                self._touched,
            ],
        )
        # Views of one row: one thread solves all.
        rows = [
            array.reshape((1, -1))
            for array in (self.velocity, self.spin, self.shift, self.turn, self._impulse, self.received)
        ]
        solve = self.launcher.record_in_order(
            contact_solver.solve_contacts,
            1,
            [
                *(self.constants, self.contact, self.contact_count, self._key, self._other, self._place, self._normal),
                *(self.contact_gap, self._target, self._friction, self._inverse_compliance, self._start_impulse),
                *(self.position, *inverse, *rows, self._last_count, self._last_key),
            ],
        )

        def launch() -> None:
            kick()
            find()
            gather()
            solve()

        return launch

    def kinetic_energy(self) -> Array:
        """Of each body, the ground's 0 [J], or [J/m] in 2-D; read back from the device."""
        energies = np.zeros(self.count)
        for b, body in enumerate(self.bodies, 1):
            R = rotation(self.orientation.numpy()[b])
            u, w = self.velocity.numpy()[b], R.T @ self.spin.numpy()[b]
            energies[b] = 0.5 * body.mass.mass * u @ u + 0.5 * w @ body.mass.inertia @ w
        return energies

    # ---- arrays ----

    def _array(self, values: Array, dtype: type) -> wp.array:
        return wp.array(np.asarray(values), dtype=dtype, device=self.launcher.device)

    def _zeros(self, dtype: type, *shape: int) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self.launcher.device)

    def _load_bodies(self, gravity: Array) -> None:
        all_bodies = [_GROUND, *self.bodies]
        self.constants = constants = body_kernels.Bodies()
        constants.count, constants.gravity = self.count, wp.vec3d(*gravity)
        constants.mass = self._array([b.mass.mass for b in all_bodies], wp.float64)
        constants.inertia = self._array([b.mass.inertia for b in all_bodies], wp.mat33d)
        constants.free_shift = self._array([b.free_shift for b in all_bodies], wp.vec3d)
        constants.free_turn = self._array([b.free_turn for b in all_bodies], wp.vec3d)
        constants.release = self._array([b.release for b in all_bodies], wp.float64)

        self.position = self._array([b.mass.centre for b in all_bodies], wp.vec3d)
        self.orientation = self._array(np.tile([0.0, 0.0, 0.0, 1.0], (self.count, 1)), wp.quatd)
        self.velocity = self._array([b.velocity for b in all_bodies], wp.vec3d)
        self.spin = self._array([b.spin for b in all_bodies], wp.vec3d)
        self.force, self.torque = self._zeros(wp.vec3d, self.count), self._zeros(wp.vec3d, self.count)
        # Within a step.
        self.velocity_before, self.spin_before = self._zeros(wp.vec3d, self.count), self._zeros(wp.vec3d, self.count)
        self.inverse_mass = self._zeros(wp.vec3d, self.count)
        self.inverse_inertia = self._zeros(wp.mat33d, self.count)
        self.shift, self.turn = self._zeros(wp.vec3d, self.count), self._zeros(wp.vec3d, self.count)
        self.received = self._zeros(wp.vec3d, self.count)

    def _load_motions(self) -> None:
        all_motions = [None, *(b.motion for b in self.bodies)]
        tables = [m.table if m and m.table else _NO_ROWS for m in all_motions]
        centres = [np.zeros(3), *(b.mass.centre for b in self.bodies)]
        axes = [np.asarray(m.axis, float) if m else np.array([0.0, 1.0, 0.0]) for m in all_motions]
        pivots = [
            centre if m is None or m.pivot is None else m.pivot for m, centre in zip(all_motions, centres, strict=True)
        ]
        self.motions = motions = body_kernels.Motions()
        motions.kind = self._array([KINDS["fixed"], *(KINDS[m.kind] if m else 0 for m in all_motions[1:])], int)
        motions.position = self._array(centres, wp.vec3d)
        motions.orientation = self._array(np.tile([0.0, 0.0, 0.0, 1.0], (self.count, 1)), wp.quatd)
        motions.pivot = self._array(pivots, wp.vec3d)
        motions.axis = self._array([axis / np.linalg.norm(axis) for axis in axes], wp.vec3d)
        motions.direction = self._array([m.direction if m else np.zeros(3) for m in all_motions], wp.vec3d)
        for name, otherwise in {"turn": 0.0, "begin": 0.0, "period": 1.0, "phase": 0.0}.items():
            values = [getattr(m, name) if m else otherwise for m in all_motions]
            setattr(motions, name, self._array(values, wp.float64))
        rates = [table.rates() if len(table.time) else (table.shift, table.angle) for table in tables]
        motions.first_row = self._array(np.cumsum([0, *(len(table.time) for table in tables)]), int)
        motions.row_time = self._array(np.concatenate([table.time for table in tables]), wp.float64)
        motions.row_shift = self._array(np.concatenate([table.shift for table in tables]), wp.vec3d)
        motions.row_angle = self._array(np.concatenate([table.angle for table in tables]), wp.float64)
        motions.row_shift_rate = self._array(np.concatenate([shift for shift, _ in rates]), wp.vec3d)
        motions.row_angle_rate = self._array(np.concatenate([angle for _, angle in rates]), wp.float64)

    def _load_points(self) -> None:
        sets = [np.empty((0, 3)), *(b.surface.points - b.mass.centre for b in self.bodies)]
        sizes = [len(points) for points in sets]
        self.point_count = sum(sizes)

        def together(name: str) -> Array:
            return np.concatenate([np.empty((0, 3)), *(getattr(b.surface, name) for b in self.bodies)])

        self.point_body = self._array(np.repeat(np.arange(self.count), sizes), int)
        self._offset = self._array(np.concatenate(sets), wp.vec3d)
        self._outward = self._array(together("normals"), wp.vec3d)
        self._before, self._after = self._array(together("before"), wp.vec3d), self._array(together("after"), wp.vec3d)
        self.point_position, self.point_velocity, self.point_normal, self.point_before, self.point_after = (
            self._zeros(wp.vec3, self.point_count) for _ in range(5)
        )
        self.point_force = self._zeros(wp.vec3, self.point_count)
        self._block_count, self._block_first, self._block_body, self._body_first_block = self._blocks(sizes)
        self._block_force = self._zeros(wp.vec3d, self._block_count)
        self._block_torque = self._zeros(wp.vec3d, self._block_count)

    def _blocks(self, sizes: Sequence[int]) -> tuple[int, wp.array, wp.array, wp.array]:
        """Blocks of the points of each body: how many, their first points and bodies, and each body's first block."""
        firsts = np.concatenate([[0], np.cumsum(sizes)])
        blocks = [
            (first, b) for b, (begin, end) in enumerate(pairwise(firsts)) for first in range(begin, end, BLOCK_SIZE)
        ]
        owners = np.array([b for _, b in blocks], int)
        return (
            len(blocks),
            self._array([*(first for first, _ in blocks), firsts[-1]], int),
            self._array(owners, int),
            self._array(np.searchsorted(owners, np.arange(self.count + 1)), int),
        )

    def _load_contact(self, walls: list[ContactLegs], wall_points: ContactPoints, dimensions: int, h: float) -> None:
        self.contact = contact = contact_kernels.Contact()
        contact.slots, contact.capacity = SLOTS[dimensions], CAPACITY[dimensions]
        contact.sweeps, contact.tolerance, contact.tilt = SWEEPS, TOLERANCE, TILT
        contact.margin, contact.depth, contact.slack = 0.1 * h, contact_depth(h), 1e-4 * h
        contact.still, contact.creep = STILL, CREEP
        for name in ("restitution", "static_friction", "dynamic_friction"):
            setattr(contact, name, self._array([-1.0, *(getattr(b, name) for b in self.bodies)], wp.float64))

        parts, owners, sets = list(walls), [0] * len(walls), [wall_points]
        for b, body in enumerate(self.bodies, 1):
            own, points = touching(body, contact.depth)
            parts, owners, sets = parts + own, owners + [b] * len(own), [*sets, points]
        for name, dtype in {"offset": wp.vec3d, "radius": wp.float64, "way": wp.vec3d, "spread": wp.float64}.items():
            setattr(contact, f"point_{name}", self._array(np.concatenate([getattr(p, name) for p in sets]), dtype))
        contact.point_length = self._array(np.concatenate([p.length for p in sets]), wp.float64)
        contact.point_into = self._array(np.concatenate([p.into for p in sets]), wp.vec3d)
        reach = [float((np.linalg.norm(p.offset, axis=1) + p.radius).max(initial=0.0)) for p in sets[1:]]
        contact.reach = self._array([math.inf, *reach], wp.float64)
        self._load_contact_blocks(joined(sets), [len(p.radius) for p in sets])

        self._legs = legs = joined_legs(parts)
        owner = np.repeat(np.array(owners, int), [len(part) for part in parts])
        contact.leg_body, contact.leg_kind = self._array(owner, int), self._array(legs.kind, int)
        for name in ("origin", "along", "normal", "center", "into"):
            setattr(contact, f"leg_{name}", self._array(getattr(legs, name), wp.vec3d))
        for name in ("radius", "length", "reach"):
            setattr(contact, f"leg_{name}", self._array(getattr(legs, name), wp.float64))
        for name in ("start", "end", "width"):
            setattr(contact, f"leg_{name}", self._array(getattr(legs, name), wp.vec2d))
        contact.leg_border = self._array(np.append(0, np.cumsum(legs.borders)), int)
        contact.border_start = self._array(legs.border_start, wp.vec3d)
        contact.border_into = self._array(legs.border_into, wp.vec3d)
        contact.border_beyond = self._array(legs.border_beyond, wp.vec2d)

        shape = self.count, contact.capacity
        self._chosen = self._zeros(int, max(self.count * len(legs), 1), contact.slots)
        self._touched = self._zeros(int, self.count, max(-(-len(legs) // int(contact_kernels.LEG_BLOCK)), 1))
        self.contact_count, self._last_count = self._zeros(int, self.count), self._zeros(int, self.count)
        self._key, self._last_key = self._zeros(wp.int64, *shape), self._zeros(wp.int64, *shape)
        self._other = self._zeros(int, *shape)
        self._place, self._normal, self._start_impulse = (self._zeros(wp.vec3d, *shape) for _ in range(3))
        self.contact_gap, self._target, self._friction, self._inverse_compliance = (
            self._zeros(wp.float64, *shape) for _ in range(4)
        )
        self._impulse = self._zeros(wp.vec3d, 1, self.count * contact.capacity)

    def _load_contact_blocks(self, points: ContactPoints, sizes: Sequence[int]) -> None:
        """Blocks of points, of which one that is far from a leg is passed over as a whole."""
        contact = self.contact
        count, contact.block_first, _, contact.body_first_block = self._blocks(sizes)
        first = contact.block_first.numpy()
        ends = points.offset + points.length[:, None] * points.way
        middles = 0.5 * (points.offset + ends)
        centres = np.array([middles[first[n] : first[n + 1]].mean(axis=0) for n in range(count)]).reshape(-1, 3)
        reach = 0.5 * points.length + points.radius
        reach = reach + np.linalg.norm(middles - np.repeat(centres, np.diff(first), axis=0), axis=1)
        contact.block_center = self._array(centres, wp.vec3d)
        contact.block_reach = self._array([reach[first[n] : first[n + 1]].max() for n in range(count)], wp.float64)


def rotation(quaternion: Array) -> Array:
    """The matrix of a unit quaternion [x, y, z, w], shape [3, 3]."""
    x, y, z, w = quaternion
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


_NO_ROWS = MotionTable(np.empty(0), np.empty((0, 3)), np.empty(0))
_GROUND = Body(
    name="the ground",
    mass=MassProperties(1.0, np.zeros(3), np.eye(3)),
    surface=Surface(*(np.empty((0, 3)) for _ in range(2)), np.empty(0), *(np.empty((0, 3)) for _ in range(2))),
    free_shift=(0.0, 0.0, 0.0),
    free_turn=(0.0, 0.0, 0.0),
)
