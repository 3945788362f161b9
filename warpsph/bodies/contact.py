"""Contact of bodies with walls and with each other: its arrays on the device, and what finds and solves it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from warpsph.bodies.arrays import Maker
from warpsph.bodies.body import Body
from warpsph.bodies.contact_geometry import (
    ContactLegs,
    ContactPoints,
    contact_depth,
    joined,
    joined_legs,
    touching,
)
from warpsph.device.launch import Launch, Launcher
from warpsph.kernels import bodies as body_kernels
from warpsph.kernels import contact as contact_kernels
from warpsph.kernels import contact_solver

# Contacts kept of a body and a leg (see kernels/contact.py), and of a body.
SLOTS = {2: 3, 3: 9}
CAPACITY = {2: 32, 3: 128}
SWEEPS = 100
TOLERANCE = 1e-12
TILT = 1e-3
# Speeds below which a contact sticks, and not more than which a bounce is none [m/s].
STILL, CREEP = 1e-4, 1e-2


class Contacts:
    """Whatever touches, found anew in every step and solved from the impulses of the last.

    Attributes:
        contact: What contact knows of legs and points, which do not change.
        leg_count: Number of legs that may be touched.
        last_count, last_key, last_impulse: The contacts of each body in the last step and their impulses [N s].
    """

    def __init__(
        self,
        launcher: Launcher,
        bodies: Sequence[Body],
        walls: Sequence[ContactLegs],
        wall_points: ContactPoints,
        dimensions: int,
        smoothing_length: float,
    ) -> None:
        """`bodies` are those beside the ground, `walls` and `wall_points` what belongs to it."""
        self._launcher, self._bodies, self._make = launcher, bodies, Maker(launcher.device)
        self._load(walls, wall_points, dimensions, smoothing_length)
        make, count, capacity = self._make, len(bodies) + 1, self.contact.capacity
        shape = count, capacity
        self.point = make.zeros(int, max(count * self.leg_count, 1), self.contact.slots)
        self.touched = make.zeros(int, count, max(-(-self.leg_count // int(contact_kernels.LEG_BLOCK)), 1))
        self.count, self.last_count = make.zeros(int, count), make.zeros(int, count)
        self.key, self.last_key = make.zeros(wp.int64, *shape), make.zeros(wp.int64, *shape)
        self.other = make.zeros(int, *shape)
        self.place, self.normal, self.start_impulse = (make.zeros(wp.vec3d, *shape) for _ in range(3))
        self.gap, self.target, self.friction, self.inverse_compliance = (
            make.zeros(wp.float64, *shape) for _ in range(4)
        )
        self.last_impulse = make.zeros(wp.vec3d, 1, count * capacity)

    def launches(self, of: object, bodies: body_kernels.Bodies, dt: wp.array) -> list[Launch]:
        """Those that make the velocities of bodies admissible, after a kick over `dt`; `of` has their arrays."""
        count, record = len(self._bodies) + 1, self._launcher.record
        # Views of one row: one thread solves all.
        rows = {name: getattr(of, name).reshape((1, -1)) for name in ("velocity", "spin", "shift", "turn", "received")}
        return [
            record(contact_kernels.find_contacts, count * self.leg_count, self, of),
            record(contact_solver.gather_contacts, count, self, of, dt=dt, count=self.count),
            record(
                contact_solver.solve_contacts,
                1,
                *(self, of),
                bodies=bodies,
                count=self.count,
                impulse=self.last_impulse,
                **rows,
            ),
        ]

    def _load(self, walls: Sequence[ContactLegs], wall_points: ContactPoints, dimensions: int, h: float) -> None:
        make = self._make
        self.contact = contact = contact_kernels.Contact()
        contact.slots, contact.capacity = SLOTS[dimensions], CAPACITY[dimensions]
        contact.sweeps, contact.tolerance, contact.tilt = SWEEPS, TOLERANCE, TILT
        contact.margin, contact.depth, contact.slack = 0.1 * h, contact_depth(h), 1e-4 * h
        contact.still, contact.creep = STILL, CREEP
        for name in ("restitution", "static_friction", "dynamic_friction"):
            setattr(contact, name, make.array([-1.0, *(getattr(b, name) for b in self._bodies)], wp.float64))

        parts, owners, sets = list(walls), [0] * len(walls), [wall_points]
        for b, body in enumerate(self._bodies, 1):
            own, points = touching(body, contact.depth)
            parts, owners, sets = parts + own, owners + [b] * len(own), [*sets, points]
        for name, dtype in {"offset": wp.vec3d, "radius": wp.float64, "way": wp.vec3d, "spread": wp.float64}.items():
            setattr(contact, f"point_{name}", make.array(np.concatenate([getattr(p, name) for p in sets]), dtype))
        contact.point_length = make.array(np.concatenate([p.length for p in sets]), wp.float64)
        contact.point_into = make.array(np.concatenate([p.into for p in sets]), wp.vec3d)
        reach = [float((np.linalg.norm(p.offset, axis=1) + p.radius).max(initial=0.0)) for p in sets[1:]]
        contact.reach = make.array([math.inf, *reach], wp.float64)
        self._load_blocks(joined(sets), [len(p.radius) for p in sets])

        legs = joined_legs(parts)
        self.leg_count = len(legs)
        owner = np.repeat(np.array(owners, int), [len(part) for part in parts])
        contact.leg_body, contact.leg_kind = make.array(owner, int), make.array(legs.kind, int)
        for name in ("origin", "along", "normal", "center", "into"):
            setattr(contact, f"leg_{name}", make.array(getattr(legs, name), wp.vec3d))
        for name in ("radius", "length", "reach"):
            setattr(contact, f"leg_{name}", make.array(getattr(legs, name), wp.float64))
        for name in ("start", "end", "width"):
            setattr(contact, f"leg_{name}", make.array(getattr(legs, name), wp.vec2d))
        contact.leg_border = make.array(np.append(0, np.cumsum(legs.borders)), int)
        contact.border_start = make.array(legs.border_start, wp.vec3d)
        contact.border_into = make.array(legs.border_into, wp.vec3d)
        contact.border_beyond = make.array(legs.border_beyond, wp.vec2d)

    def _load_blocks(self, points: ContactPoints, sizes: Sequence[int]) -> None:
        """Blocks of points, of which one that is far from a leg is passed over as a whole."""
        contact = self.contact
        count, contact.block_first, _, contact.body_first_block = self._make.blocks(sizes)
        first = contact.block_first.numpy()
        ends = points.offset + points.length[:, None] * points.way
        middles = 0.5 * (points.offset + ends)
        centres = np.array([middles[first[n] : first[n + 1]].mean(axis=0) for n in range(count)]).reshape(-1, 3)
        reach = 0.5 * points.length + points.radius
        reach = reach + np.linalg.norm(middles - np.repeat(centres, np.diff(first), axis=0), axis=1)
        contact.block_center = self._make.array(centres, wp.vec3d)
        contact.block_reach = self._make.array([reach[first[n] : first[n + 1]].max() for n in range(count)], wp.float64)
