"""What contact sees of a surface: its legs, and the points that can touch a leg first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import singledispatch
from typing import Any

import numpy as np

from warpsph.bodies.body import Body
from warpsph.bodies.facets import FacetEdges, Facets, crate_facets, facets, sheet_edges
from warpsph.kernels import contact as contact_kernels
from warpsph.shapes.crate import Crate
from warpsph.shapes.outline import Bend, Line, Outline, counter_clockwise, reversed_outline
from warpsph.shapes.points import Array, spatial
from warpsph.shapes.sheet import Sheet


@dataclass(frozen=True)
class ContactLeg:
    """One leg of a surface as contact sees it, its free side on the left; fields as in kernels/contact.py."""

    kind: int
    origin: Array
    along: Array
    normal: Array
    radius: float = 0.0
    length: float = math.inf
    start: tuple[float, float] = (0.0, 0.0)
    end: tuple[float, float] = (0.0, 0.0)
    center: Array = field(default_factory=lambda: np.zeros(3))
    reach: float = math.inf
    width: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True)
class ContactLegs:
    """Legs of a surface, of which a mesh from a file has many: arrays of a row a leg, fields as in kernels/contact.py.

    `borders` says how many borders each leg has, of the rows of `border_start`, `border_into` and `border_beyond`.
    """

    kind: Array
    origin: Array
    along: Array
    normal: Array
    radius: Array
    length: Array
    start: Array
    end: Array
    center: Array
    reach: Array
    width: Array
    into: Array
    borders: Array
    border_start: Array
    border_into: Array
    border_beyond: Array

    def __len__(self) -> int:
        return len(self.kind)


def _table(kind: int, count: int, **known: Array) -> ContactLegs:
    """`count` legs of one kind; a field that is not `known` is 0, or without end."""
    none = {"radius": np.zeros(count), "length": np.full(count, math.inf), "into": np.zeros((count, 2, 3))}
    none |= {"start": np.zeros((count, 2)), "end": np.zeros((count, 2)), "reach": np.full(count, math.inf)}
    none |= {"width": np.tile([-math.inf, math.inf], (count, 1)), "borders": np.zeros(count, int)}
    none |= {f"border_{name}": np.empty((0, k)) for name, k in (("start", 3), ("into", 3), ("beyond", 2))}
    return ContactLegs(kind=np.full(count, int(kind)), **(none | known))


def _row(leg: ContactLeg) -> ContactLegs:
    """A table of one leg."""
    known = {one.name: np.array([getattr(leg, one.name)]) for one in fields(leg) if one.name != "kind"}
    return _table(leg.kind, 1, **known)


def contact_legs(
    outline: Outline, side: int, depth: float, width: tuple[float, float] = (-math.inf, math.inf)
) -> list[ContactLegs]:
    """The legs of an outline whose free side is on the left (`side` 1) or on the right (-1) of the way along.

    At a corner that points out of the solid a point inside belongs to the nearer leg: the corner is shared along its
    bisector. At one that points into it legs reach `depth` [m] into each other, so that none slips in between.
    `width` is how far they reach across, from y to y [m].
    """
    outline = outline if side > 0 else reversed_outline(outline)
    count = len(outline.legs)
    ends = []
    for i in range(count):
        j = (i + 1) % count
        is_joint = j > i or outline.closed
        ends.append(_joint(outline.legs[i], outline.legs[j], depth) if is_joint else (0.0, 0.0))
    found = []
    for i, leg in enumerate(outline.legs):
        start = ends[i - 1] if i > 0 or outline.closed else (0.0, 0.0)
        if isinstance(leg, Line):
            normal = leg.normals(np.zeros(1))[0]
            numbers: dict[str, Any] = {"kind": int(contact_kernels.LINE), "origin": spatial(leg.start)}
            numbers |= {"normal": spatial(normal), "along": spatial((leg.end - leg.start) / leg.length)}
            middle, reach = 0.5 * (leg.start + leg.end), 0.5 * leg.length
        else:
            half = leg.points(np.array([0.5]))[0]
            inside = -math.copysign(1.0, leg.turn)  # the solid is inside of an arc that turns right
            numbers = {"kind": int(contact_kernels.BEND), "origin": spatial(leg.center), "radius": leg.radius}
            numbers |= {"along": spatial((half - leg.center) / leg.radius), "normal": np.array([0.0, inside, 0.0])}
            middle, reach = leg.center, leg.radius
        shape: dict[str, Any] = {
            "length": leg.length,
            "start": start,
            "end": ends[i],
            "center": spatial(middle),
            "width": width,
        }
        across = max(map(abs, width)) if math.isfinite(width[0]) else 0.0  # bodies of the plane have no width
        found.append(ContactLeg(**numbers, **shape, reach=math.hypot(reach + depth, across)))
    return [_row(leg) for leg in found]


def facet_legs(found: Facets, depth: float) -> list[ContactLegs]:
    """Faces and edges as legs; `depth` [m] as of `contact_legs`."""
    legs, faces, edges = [], found.faces, found.edges
    if len(faces):
        first, counts = faces.first[:-1], np.diff(faces.first)
        middles = 0.5 * (np.minimum.reduceat(faces.corners, first) + np.maximum.reduceat(faces.corners, first))
        gaps = np.linalg.norm(faces.corners - np.repeat(middles, counts, axis=0), axis=1)
        legs.append(
            _table(
                contact_kernels.FACE,
                len(faces),
                origin=faces.corners[first],
                along=faces.along,
                normal=faces.normal,
                center=middles,
                reach=np.maximum.reduceat(gaps, first) + depth,
                borders=counts,
                border_start=faces.corners,
                border_into=faces.into,
                border_beyond=faces.beyond,
            )
        )
    if len(edges):
        legs.append(
            _table(
                contact_kernels.EDGE,
                len(edges),
                origin=edges.start,
                along=edges.way,
                normal=np.cross(edges.way, edges.into[:, 0]),
                length=edges.length,
                center=edges.start + 0.5 * edges.length[:, None] * edges.way,
                reach=0.5 * edges.length + depth,
                into=edges.into,
            )
        )
    return legs


def ball_leg(centre: Array, radius: float) -> ContactLegs:
    """The surface of a ball."""
    x, _, z = np.eye(3)
    return _row(ContactLeg(int(contact_kernels.BALL), centre, x, z, radius=radius, center=centre, reach=radius))


@dataclass(frozen=True)
class ContactPoints:
    """What can touch a leg first: corners, arcs and balls as corners with a radius, edges; as in kernels/contact.py."""

    offset: Array
    radius: Array
    way: Array
    spread: Array
    length: Array
    into: Array

    def about(self, centre: Array) -> ContactPoints:
        """The same in coordinates about `centre` [m], shape [3]."""
        return replace(self, offset=self.offset - centre)


def corners_at(points: Array, radius: float = 0.0) -> ContactPoints:
    """Points [m], shape [n, 3], as corners, or with a `radius` [m] as balls."""
    points = np.asarray(points, float).reshape(-1, 3)
    count = len(points)
    nowhere = np.zeros((count, 3))
    return ContactPoints(
        points, np.full(count, radius), nowhere, -np.ones(count), np.zeros(count), np.zeros((count, 2, 3))
    )


def edges_at(edges: FacetEdges) -> ContactPoints:
    """Edges, which touch other edges."""
    return replace(corners_at(edges.start), way=edges.way, length=edges.length, into=edges.into)


def joined(parts: Sequence[ContactPoints]) -> ContactPoints:
    """All points of several sets, in order."""
    return ContactPoints(*_columns([corners_at(np.empty((0, 3))), *parts]))


def joined_legs(parts: Sequence[ContactLegs]) -> ContactLegs:
    """All legs of several tables, in order."""
    nowhere = np.empty((0, 3))
    empty = _table(contact_kernels.LINE, 0, origin=nowhere, along=nowhere, normal=nowhere, center=nowhere)
    return ContactLegs(*_columns([empty, *parts]))


def _columns(parts: Sequence[ContactPoints] | Sequence[ContactLegs]) -> list[Array]:
    return [np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(parts[0])]


def contact_points(outline: Outline, side: int) -> ContactPoints:
    """The corners and the arcs of an outline that bulge to its free side, the left (`side` 1) or the right (-1).

    Not the smooth joints of legs: what slides over one would stumble over it.
    """
    outline = outline if side > 0 else reversed_outline(outline)
    count = len(outline.legs)
    joints = [(i, (i + 1) % count) for i in range(count if outline.closed else count - 1)]
    corners = [
        spatial(outline.legs[i].points(np.ones(1))[0])
        for i, j in joints
        if _turn(outline.legs[i], outline.legs[j]) < -1e-6
    ]
    if not outline.closed:
        corners += [spatial(outline.legs[0].points(np.zeros(1))[0]), spatial(outline.legs[-1].points(np.ones(1))[0])]
    arcs = [leg for leg in outline.legs if isinstance(leg, Bend) and leg.turn < 0.0]
    plain = corners_at(np.array(corners).reshape(-1, 3))
    round_ones = corners_at(np.array([spatial(leg.center) for leg in arcs]))
    middles = [spatial((leg.points(np.array([0.5]))[0] - leg.center) / leg.radius) for leg in arcs]
    round_ones = replace(
        round_ones,
        radius=np.array([leg.radius for leg in arcs]),
        way=np.array(middles).reshape(-1, 3),
        spread=np.array([math.cos(min(0.5 * abs(leg.turn) + 1e-9, math.pi)) for leg in arcs]),
    )
    return joined([plain, round_ones])


@singledispatch
def contact_of(wall: object, way: int, depth: float) -> tuple[list[ContactLegs], list[ContactPoints]]:
    """A wall as contact sees it: as drawn, with its free side on the left of the way along (`way` 1) or on the right
    (-1), or outside or inside of a closed outline; `depth` [m] as of `contact_legs`.

    A new kind of wall registers its own.
    """
    raise TypeError(f"contact does not know walls that are {type(wall).__name__}")


@contact_of.register
def _of_sheet(wall: Sheet, way: int, depth: float) -> tuple[list[ContactLegs], list[ContactPoints]]:
    if not wall.width:
        return contact_legs(wall.outline, way, depth), [contact_points(wall.outline, way)]
    found = sheet_edges(wall, way)
    legs = contact_legs(wall.outline, way, depth, wall.width) + facet_legs(found, depth)
    return legs, [corners_at(found.corners), edges_at(found.edges)]


@contact_of.register
def _of_crate(wall: Crate, way: int, depth: float) -> tuple[list[ContactLegs], list[ContactPoints]]:
    found = crate_facets(wall, way, depth)
    return facet_legs(found, depth), [corners_at(found.corners), edges_at(found.edges)]


def touching(body: Body, depth: float) -> tuple[list[ContactLegs], ContactPoints]:
    """The legs and the points of a body, about its centre."""
    centre = body.mass.centre
    if body.outline is not None:
        outline = counter_clockwise(body.outline)
        legs = contact_legs(outline.moved(-centre[[0, 2]]), -1, depth)
        return legs, contact_points(outline, -1).about(centre)
    if body.ball is not None:
        middle, radius = body.ball[0] - centre, body.ball[1]
        return [ball_leg(middle, radius)], corners_at(middle[None], radius)
    if body.mesh is not None:
        own = facets(body.mesh.vertices - centre, body.mesh.triangles, depth)
        return facet_legs(own, depth), joined([corners_at(own.corners), edges_at(own.edges)])
    return [], corners_at(np.empty((0, 3)))


def contact_depth(h: float) -> float:
    """Overlap [m] at which a point counts as on the far side of a wall, for a smoothing length of h [m]."""
    return 0.25 * h


def _turn(before: Line | Bend, after: Line | Bend) -> float:
    """The angle by which the way turns left from one leg to the next [rad]."""
    a, b = before.normals(np.ones(1))[0], after.normals(np.zeros(1))[0]
    return math.atan2(a[0] * b[1] - a[1] * b[0], a @ b)


def _joint(before: Line | Bend, after: Line | Bend, depth: float) -> tuple[float, float]:
    """How far two legs reach beyond their joint [m], and how fast that shrinks inside of the solid."""
    turn = _turn(before, after)
    if turn < -1e-9:
        return 0.0, math.tan(-0.5 * turn)
    return (depth, 0.0) if turn > 1e-6 else (1e-9, 0.0)
