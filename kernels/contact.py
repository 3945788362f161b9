"""Contacts of rigid bodies with walls and with each other: what of a body is near which leg of another.

Surfaces are the exact legs of outlines, straight or arcs, not their samples: a block slides over an arc without bumps,
a disc rolls without being a polygon, and a wall is one-sided and as thick as `depth`. Against the legs of one body
stand the corners and the arcs of another (an arc is a corner with a radius), and the other way round: in the plane
nothing else can touch first.

In 3-D legs are the flat FACEs of meshes and boxes, the walls of the plane across their width, and BALLs; a ball is a
corner with a radius too. Two edges can touch first as well, each a point of its body and an EDGE for a leg. They do
where the normal of both is one of the body's own at its edge, halfway between its two faces at most (the sides of
Minkowski's difference, Gilbert & Foo 1990). Where a corner lies on the very border of a face, or two edges cross in the
very end of one, it depends on nothing but rounding which face or edge it is: there the one counts that has the other
body's centre in front of it.

Of the points near a leg only few are kept: those that would touch first, with the leg as it is and slightly tilted each
way.
"""

import warp as wp

LINE = wp.constant(0)
BEND = wp.constant(1)
FACE = wp.constant(2)
EDGE = wp.constant(3)
BALL = wp.constant(4)

# Tilts by which the points that span a contact are told from those between them: 0 and eight ways, of which the
# first two are in the x-z plane.
MOST_SLOTS = 9
# Legs in a block: a body that touches none of them passes them over as one.
LEG_BLOCK = wp.constant(64)
# Edges whose directions differ by less are parallel: they touch where corners do. And how far the normal of two edges
# may lie beyond a face. Sine of the angle.
PARALLEL = wp.constant(wp.float64(1.0e-4))
BEYOND_FACE = wp.constant(wp.float64(1.0e-3))

Scores = wp.types.vector(length=MOST_SLOTS, dtype=wp.float64)
Chosen = wp.types.vector(length=MOST_SLOTS, dtype=wp.int32)


@wp.struct
class Contact:
    """Numbers of contact, of each leg and of each body (the ground's own coefficients are -1: none)."""

    slots: int  # contacts that are kept of a body and a leg: 3 in 2-D, 9 in 3-D
    capacity: int  # contacts that are kept of a body
    sweeps: int  # at most
    tolerance: wp.float64  # of the sweeps: change of impulses relative to the largest
    margin: wp.float64  # gap at which a contact is looked at [m]
    depth: wp.float64  # overlap at which a point counts as on the far side [m]
    slack: wp.float64  # overlap that is not put right [m]
    tilt: wp.float64  # slope of the tilts
    still: wp.float64  # speed below which a contact sticks [m/s]
    creep: wp.float64  # speed up to which a bounce is none [m/s]
    restitution: wp.array[wp.float64]
    static_friction: wp.array[wp.float64]
    dynamic_friction: wp.array[wp.float64]
    reach: wp.array[wp.float64]  # of a body's points from its centre [m]
    point_offset: wp.array[wp.vec3d]  # corners, centres of arcs, starts of edges, in the coordinates of their body [m]
    point_radius: wp.array[wp.float64]  # of an arc or a ball [m]; 0: a corner
    point_way: wp.array[wp.vec3d]  # from the centre to the middle of an arc, along an edge; unit vector
    point_spread: wp.array[wp.float64]  # cosine of half the angle that an arc turns; -1: all around
    point_length: wp.array[wp.float64]  # of an edge [m]; 0: none
    point_into: wp.array2d[wp.vec3d]  # from an edge into either of its faces, unit vectors
    body_first_block: wp.array[
        int
    ]  # body b has the blocks of points body_first_block[b] .. body_first_block[b + 1] - 1
    block_first: wp.array[int]  # block n has the points block_first[n] .. block_first[n + 1] - 1
    block_center: wp.array[wp.vec3d]  # of a sphere around a block [m]
    block_reach: wp.array[wp.float64]  # its radius [m]
    leg_body: wp.array[int]  # legs lie in the coordinates of their body
    leg_kind: wp.array[int]
    leg_origin: wp.array[wp.vec3d]  # start of a line or an edge, centre of an arc or a ball, any point of a face [m]
    leg_along: wp.array[wp.vec3d]  # unit vector to the end of a line, from the centre to the middle of an arc
    leg_into: wp.array2d[wp.vec3d]  # from an edge into either of its faces, unit vectors
    leg_normal: wp.array[wp.vec3d]  # out of the solid; of an arc y, times 1 where the solid is inside of it, else -1
    leg_radius: wp.array[wp.float64]  # of an arc or a ball [m]
    leg_length: wp.array[wp.float64]  # [m]
    leg_start: wp.array[wp.vec2d]  # how far below its start the leg still counts [m], and how fast that shrinks inside
    leg_end: wp.array[wp.vec2d]  # the same beyond its end
    leg_width: wp.array[wp.vec2d]  # from y to y, of a line or an arc [m]
    leg_border: wp.array[
        int
    ]  # borders of the triangles of a face: leg_border[leg] .. leg_border[leg + 1] - 1, by threes
    border_start: wp.array[wp.vec3d]  # any point of the border of a triangle [m]
    border_into: wp.array[wp.vec3d]  # from it into the triangle, unit vector
    border_beyond: wp.array[wp.vec2d]  # as leg_start
    leg_center: wp.array[wp.vec3d]  # of a sphere around the leg [m]
    leg_reach: wp.array[wp.float64]  # its radius [m]; infinite where the leg is


@wp.func
def leg_coordinates(contact: Contact, leg: int, x: wp.vec3d):
    """Gap [m], normal, and two coordinates along the surface [m] of a point, all in the coordinates of the leg."""
    arm = x - contact.leg_origin[leg]
    along, axis = contact.leg_along[leg], contact.leg_normal[leg]
    if contact.leg_kind[leg] == BALL:
        away = wp.length(arm)
        return away - contact.leg_radius[leg], arm / away, wp.dot(arm, along), wp.dot(arm, wp.cross(axis, along))
    if contact.leg_kind[leg] != BEND:
        return wp.dot(arm, axis), axis + wp.vec3d(), wp.dot(arm, along), wp.dot(arm, wp.cross(axis, along))
    side, radius = axis[1], contact.leg_radius[leg]
    flat = wp.vec3d(arm[0], wp.float64(0.0), arm[2])
    distance = wp.max(wp.length(flat), wp.float64(1.0e-12) * radius)
    # The free side is on the left of the way along: clockwise where the solid is inside.
    angle = wp.atan2(wp.cross(along, flat)[1], wp.dot(along, flat))
    t = side * angle * radius + wp.float64(0.5) * contact.leg_length[leg]
    return side * (distance - radius), side * flat / distance, t, arm[1]


@wp.func
def point_coordinates(
    contact: Contact, leg: int, b: int, k: int, x: wp.vec3d, q: wp.quatd, x_other: wp.vec3d, q_other: wp.quatd
):
    """As `leg_coordinates`, but of the outermost place of point k of body b at x and q, and the normal in the world.

    Also whether the point lies over the leg, and not over its neighbour, near enough to touch; and the way there from
    the centre of its body [m].
    """
    kind = contact.leg_kind[leg]
    arm = wp.quat_rotate(q, contact.point_offset[k])
    place = wp.quat_rotate_inv(q_other, x + arm - x_other)
    centre = wp.quat_rotate_inv(q_other, x - x_other)
    radius = contact.point_radius[k]
    length = contact.point_length[k]
    gap, t, s = wp.float64(wp.inf), wp.float64(0.0), wp.float64(0.0)
    normal = wp.vec3d()
    is_near = bool(False)
    if length > wp.float64(0.0):
        # Of two bodies only one looks at the crossings of their edges.
        if kind == EDGE and contact.leg_body[leg] < b:
            way = wp.quat_rotate_inv(q_other, wp.quat_rotate(q, contact.point_way[k]))
            into = wp.quat_rotate_inv(q_other, wp.quat_rotate(q, contact.point_into[k, 0]))
            into_too = wp.quat_rotate_inv(q_other, wp.quat_rotate(q, contact.point_into[k, 1]))
            gap, normal, t, s, is_near = crossing(contact, leg, place, way, length, into, into_too, centre)
            arm += s * wp.quat_rotate(q, contact.point_way[k])
    elif kind == EDGE:
        if radius > wp.float64(0.0):
            start, along = contact.leg_origin[leg], contact.leg_along[leg]
            t = wp.clamp(wp.dot(place - start, along), wp.float64(0.0), contact.leg_length[leg])
            off = place - start - t * along
            gap = wp.length(off) - radius
            normal = wp.normalize(off)
            is_near = gap < contact.margin and gap > -contact.depth
    elif kind == FACE:
        gap, normal, t, s = leg_coordinates(contact, leg, place)
        gap -= radius
        is_near = is_on_face(contact, leg, gap, place, wp.dot(centre - contact.leg_origin[leg], normal))
    else:
        gap, normal, t, s = leg_coordinates(contact, leg, place)
        gap -= radius
        is_near = is_on_leg(contact, leg, gap, t, place[1])
    n = wp.quat_rotate(q_other, normal)
    towards = -wp.dot(wp.quat_rotate_inv(q, n), contact.point_way[k])
    if radius > wp.float64(0.0) and towards < contact.point_spread[k]:
        is_near = False
    return gap, n, t, s, is_near, arm - radius * n


@wp.func
def is_on_leg(contact: Contact, leg: int, gap: wp.float64, t: wp.float64, y: wp.float64) -> bool:
    """Whether a point with that gap lies over the leg, and not over its neighbour, near enough to touch."""
    if gap >= contact.margin or gap <= -contact.depth:
        return False
    if contact.leg_kind[leg] == BALL:
        return True
    width = contact.leg_width[leg]
    if y < width[0] or y > width[1]:
        return False
    inside = wp.max(-gap, wp.float64(0.0))
    start, end = contact.leg_start[leg], contact.leg_end[leg]
    return t >= start[1] * inside - start[0] and t <= contact.leg_length[leg] - end[1] * inside + end[0]


@wp.func
def is_on_face(contact: Contact, leg: int, gap: wp.float64, place: wp.vec3d, before: wp.float64) -> bool:
    """As `is_on_leg`, over one of the triangles of a face. The point's body has its centre `before` it [m]."""
    if gap >= contact.margin or gap <= -contact.depth:
        return False
    inside = wp.max(-gap, wp.float64(0.0))
    is_on = bool(False)
    first = contact.leg_border[leg]
    for triangle in range((contact.leg_border[leg + 1] - first) // 3):
        room = wp.float64(wp.inf)
        for border in range(first + 3 * triangle, first + 3 * triangle + 3):
            beyond = contact.border_beyond[border]
            to_border = wp.dot(place - contact.border_start[border], contact.border_into[border])
            room = wp.min(room, to_border + beyond[0] - beyond[1] * inside)
        if room > contact.slack or (room > -contact.slack and before > wp.float64(0.0)):
            is_on = True
    return is_on


@wp.func
def is_before_edge(n: wp.vec3d, into: wp.vec3d, into_too: wp.vec3d) -> bool:
    """Whether n is a normal at an edge: neither of its faces reaches beyond the plane."""
    return wp.dot(n, into) < BEYOND_FACE and wp.dot(n, into_too) < BEYOND_FACE


@wp.func
def crossing(
    contact: Contact,
    leg: int,
    start: wp.vec3d,
    way: wp.vec3d,
    length: wp.float64,
    into: wp.vec3d,
    into_too: wp.vec3d,
    centre: wp.vec3d,
):
    """Gap, normal, the place along the leg and along the edge from `start`, and whether the two can touch.

    The normal n is square to both edges, n = a x d / |a x d|, and the gap its part of the way between them. All is in
    the coordinates of the leg, `centre` the centre of the other edge's body.
    """
    origin, along, limit = contact.leg_origin[leg], contact.leg_along[leg], contact.leg_length[leg]
    across = wp.cross(along, way)
    sine = wp.length(across)
    gap, t, s = wp.float64(wp.inf), wp.float64(0.0), wp.float64(0.0)
    n = wp.vec3d()
    is_near = bool(False)
    if sine > PARALLEL:
        n = across / sine
        is_facing = is_before_edge(n, contact.leg_into[leg, 0], contact.leg_into[leg, 1])
        if not (is_facing and is_before_edge(-n, into, into_too)):
            n = -n
            is_facing = is_before_edge(n, contact.leg_into[leg, 0], contact.leg_into[leg, 1])
        if is_facing and is_before_edge(-n, into, into_too):
            arm = start - origin
            gap = wp.dot(arm, n)
            cosine = wp.dot(along, way)
            t = (wp.dot(arm, along) - cosine * wp.dot(arm, way)) / (sine * sine)
            s = cosine * t - wp.dot(arm, way)
            room = wp.min(wp.min(t, limit - t), wp.min(s, length - s))
            is_near = gap < contact.margin and gap > -contact.depth and room > -contact.slack
            if room < contact.slack and wp.dot(centre - origin, n) < wp.float64(0.0):
                is_near = False
    return gap, n, t, s, is_near


@wp.func
def tilt_direction(slot: int) -> wp.vec2d:
    """The way in which the leg is tilted for a slot: none, along, back, across, and the diagonals."""
    if slot == 0:
        return wp.vec2d()
    if slot < 5:
        way = wp.float64(1 - 2 * ((slot - 1) % 2))
        if slot < 3:
            return wp.vec2d(way, wp.float64(0.0))
        return wp.vec2d(wp.float64(0.0), way)
    return wp.vec2d(
        wp.float64(2 * ((slot - 5) % 2) - 1) * wp.float64(0.7071067811865476),
        wp.float64(2 * ((slot - 5) // 2) - 1) * wp.float64(0.7071067811865476),
    )


@wp.func
def may_touch(
    contact: Contact,
    b: int,
    leg: int,
    position: wp.array[wp.vec3d],
    orientation: wp.array[wp.quatd],
    inverse_mass: wp.array[wp.vec3d],
) -> bool:
    """Whether body b and the leg of another are close, and at least one of them can be moved."""
    other = contact.leg_body[leg]
    if other == b:
        return False
    if wp.length(inverse_mass[b]) + wp.length(inverse_mass[other]) == wp.float64(0.0):
        return False
    center = position[other] + wp.quat_rotate(orientation[other], contact.leg_center[leg])
    return wp.length(position[b] - center) < contact.reach[b] + contact.leg_reach[leg] + contact.margin


@wp.kernel(enable_backward=False)
def find_contacts(
    first: int,
    contact: Contact,
    leg_count: int,
    position: wp.array[wp.vec3d],
    orientation: wp.array[wp.quatd],
    inverse_mass: wp.array[wp.vec3d],
    point_out: wp.array2d[int],
    touched_out: wp.array2d[int],
):
    """For a body and a leg that may touch, row b * leg_count + leg: the points that would touch first, -1 for none.

    Where there are any, the body's entry for the block of the leg is 1.
    """
    row = first + wp.tid()
    b = row // leg_count
    leg = row - b * leg_count
    if may_touch(contact, b, leg, position, orientation, inverse_mass):
        other = contact.leg_body[leg]
        best = Scores()
        chosen = Chosen()
        for slot in range(MOST_SLOTS):
            chosen[slot] = -1
        centre = position[other] + wp.quat_rotate(orientation[other], contact.leg_center[leg])
        centre = wp.quat_rotate_inv(orientation[b], centre - position[b])
        for block in range(contact.body_first_block[b], contact.body_first_block[b + 1]):
            reach = contact.block_reach[block] + contact.leg_reach[leg] + contact.margin
            if wp.length(contact.block_center[block] - centre) < reach:
                for k in range(contact.block_first[block], contact.block_first[block + 1]):
                    gap, _n, t, s, is_near, _arm = point_coordinates(
                        contact, leg, b, k, position[b], orientation[b], position[other], orientation[other]
                    )
                    if is_near:
                        for slot in range(contact.slots):
                            way = tilt_direction(slot)
                            score = contact.tilt * (way[0] * t + way[1] * s) - gap
                            if chosen[slot] < 0 or score > best[slot]:
                                best[slot] = score
                                chosen[slot] = k
        for slot in range(contact.slots):
            point_out[row, slot] = chosen[slot]
        if chosen[0] >= 0:
            touched_out[b, leg // LEG_BLOCK] = 1
