"""Walls and lattices: identities of the geometry, and the exact words for what cannot be set out."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from warpsph.placement.drawing import wall_outline
from warpsph.placement.place import drop_height, near, place
from warpsph.scene.loading import load_scene
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError
from warpsph.shapes.outline import Bend, Line, Outline
from warpsph.shapes.points import inside_polygon

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml"))
TANK = {"name": "tank", "path": [[0.0, 2.0], [0.0, 0.0], [3.0, 0.0], [3.0, 2.0]]}
POOL = {"name": "pool", "material": "water", "fill": {"level": 1.0, "above": "tank"}}


PADDLE = {"name": "paddle", "mass": 1.0, "shape": {"box": {"min": [1.4, 0.0], "max": [1.6, 1.5]}}}
ABOVE_LINE = POOL | {"fill": {"level": 0.6, "above": "line"}}


def make(walls=(TANK,), fluids=(POOL,), sound_speed=60.0, density=1000.0, **fields) -> Scene:
    """A scene of those walls and fluids at a spacing of 0.1 m, unless `fields` say otherwise."""
    water = {"density": density, "sound_speed": sound_speed}
    return Scene.model_validate(
        {"title": "t", "spacing": 0.1, "materials": {"water": water}, "run": {"end_time": 1.0}}
        | {"walls": list(walls), "fluids": list(fluids), "smoothing": {"ratio": 1.5}}
        | fields
        | {"wall_model": {"force": "radial"} | fields.get("wall_model", {})}
    )


def outline_of(wall: dict) -> Outline:
    return wall_outline(make([wall], [shaped({"box": {"min": [8, 8], "max": [9, 9]}})]), 0)


def shaped(shape: dict, **fields) -> dict:
    return {"name": "body", "material": "water", "shape": shape, **fields}


def path(*points, **fields) -> dict:
    return {"name": "line", "path": list(points), **fields}


def error_of(scene: Scene) -> str:
    with pytest.raises(SceneError) as caught:
        place(scene)
    return str(caught.value)


def distances(points: np.ndarray) -> np.ndarray:
    """Distance between each pair of points, by brute force; infinite from a point to itself."""
    gap = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(gap, np.inf)
    return gap


# --------------------------------------------------------------------------------------------------------------- walls


@pytest.mark.parametrize("angle", [30.0, 90.0, 135.0, -60.0])
def test_a_rounded_corner_is_tangent_to_both_legs(angle):
    turn, radius = math.radians(angle), 0.3
    end = [math.cos(turn), math.sin(turn)]
    first, arc, last = outline_of(path([-1.0, 0.0], {"at": [0.0, 0.0], "radius": radius}, end)).legs
    assert isinstance(first, Line) and isinstance(arc, Bend) and isinstance(last, Line)
    # It meets the legs where they end, and touches them: the radius stands upright on both.
    joints = arc.points(np.array([0.0, 1.0]))
    np.testing.assert_allclose(joints, [first.end, last.start], atol=1e-14)
    assert (first.end - arc.center) @ (first.end - first.start) == pytest.approx(0.0, abs=1e-14)
    assert (last.start - arc.center) @ (last.end - last.start) == pytest.approx(0.0, abs=1e-14)
    assert arc.length == pytest.approx(radius * abs(turn))
    assert first.length == pytest.approx(1.0 - radius * abs(math.tan(turn / 2)))
    # The normal turns with the line, without a jump at the joints.
    np.testing.assert_allclose(first.normals(np.ones(1)), arc.normals(np.zeros(1)), atol=1e-14)
    np.testing.assert_allclose(arc.normals(np.ones(1)), last.normals(np.zeros(1)), atol=1e-14)


WALLS = {
    "open": (path([0.0, 0.0], [1.0, 0.0], [1.0, 0.73]), 1.73),
    "rounded": (path([0.0, 1.0], {"at": [0.0, 0.0], "radius": 0.5}, [2.0, 0.0]), 2.0 + math.pi / 4),
    "arc_only": (path([0.0, 0.5], {"at": [0.0, 0.0], "radius": 0.5}, [0.5, 0.0]), math.pi / 4),
    "closed": (path([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], closed=True), 2.0 + math.sqrt(2.0)),
    "box": ({"name": "line", "box": {"min": [0.0, 0.0], "max": [1.0, 0.55]}}, 3.1),
    "disc": ({"name": "line", "disc": {"center": [1.0, 2.0], "radius": 0.5}}, math.pi),
    "arc": ({"name": "line", "arc": {"center": [1.0, 2.0], "radius": 1.0, "start": 180.0, "end": 360.0}}, math.pi),
}


@pytest.mark.parametrize(("wall", "length"), WALLS.values(), ids=WALLS.keys())
def test_samples_are_even_and_never_too_far_apart(wall, length):
    one = outline_of(wall)
    spacing = 0.1 / 3
    points, normals, lengths = one.sample(spacing)
    assert one.length == pytest.approx(length)
    assert lengths.sum() == pytest.approx(length)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    np.testing.assert_allclose(one.distance(points), 0.0, atol=1e-12)

    steps = np.linalg.norm(np.diff(points, axis=0, append=points[:1] if one.closed else np.empty((0, 2))), axis=1)
    assert steps.max() <= spacing * (1 + 1e-9)
    assert steps.min() > 0.8 * spacing
    assert distances(points).min() > 0.6 * spacing, "a joint is sampled twice"
    # Each leg is divided evenly, and all of its ends are among the points.
    for leg in one.legs:
        ends = leg.points(np.array([0.0, 1.0]))
        assert np.linalg.norm(points[:, None] - ends[None], axis=2).min(axis=0).max() < 1e-12


def test_normals_point_to_the_left_and_halve_a_corner():
    points, normals, _ = outline_of(TANK).sample(0.1)
    np.testing.assert_allclose(normals[1], [1.0, 0.0], atol=1e-12)  # going down the left wall
    np.testing.assert_allclose(normals[20], [math.sqrt(0.5)] * 2)
    np.testing.assert_allclose(points[20], [0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(normals[21], [0.0, 1.0], atol=1e-12)  # along the bottom
    for inside in (WALLS["box"][0], WALLS["disc"][0]):
        points, normals, _ = outline_of(inside).sample(0.1)
        assert np.all(np.einsum("ij,ij->i", normals, points.mean(axis=0) - points) > 0)


def set_back(wall: dict, body: dict, **model) -> np.ndarray:
    """Wall points [n, 2] of a scene with that one wall and that box of fluid."""
    scene = make([wall], [shaped({"box": body})], sound_speed=100.0, wall_model={"set_back": 0.9, **model})
    return place(scene).wall_position[:, [0, 2]]


@pytest.mark.parametrize("reverse", [False, True])
def test_points_stand_behind_the_line_wherever_the_fluid_is(reverse):
    corners = TANK["path"][::-1] if reverse else TANK["path"]
    inside, outside = {"min": [1.0, 0.5], "max": [2.0, 1.0]}, {"min": [1.0, -1.0], "max": [2.0, -0.5]}
    points = set_back(path(*corners), inside)
    assert (points[:, 0].min(), points[:, 0].max(), points[:, 1].min()) == pytest.approx((-0.09, 3.09, -0.09))
    np.testing.assert_allclose(points[np.argmin(points.sum(axis=1))], [-0.09, -0.09], atol=1e-12)  # legs meet anew
    points = set_back(path(*corners), outside)
    assert (points[:, 0].min(), points[:, 0].max(), points[:, 1].min()) == pytest.approx((0.09, 2.91, 0.09))


def test_points_of_a_bend_stand_behind_it_too():
    line = path([-1.0, 1.0], {"at": [0.0, 0.0], "radius": 0.5}, [2.0, 0.0])
    points = set_back(line, {"min": [0.0, 1.0], "max": [1.0, 1.5]})
    np.testing.assert_allclose(outline_of(line).distance(points), 0.09)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert 0.8 * 0.1 / 3 < steps.min() <= steps.max() <= 0.1 / 3 * (1 + 1e-9)


def test_points_between_two_waters_stay_on_the_line():
    wall = path([0.0, 0.0], [0.0, 2.0])
    sides = [shaped({"box": {"min": [x, 0.5], "max": [x + 1, 1.0]}}) for x in (-1.5, 0.5)]
    scene = make([wall], [sides[0] | {"name": "a"}, sides[1] | {"name": "b"}], sound_speed=100.0)
    assert not place(scene).wall_position[:, 0].any()


def test_distance_to_an_arc():
    leg = Bend(np.zeros(2), 1.0, 0.0, math.pi / 2)
    points = np.array([[2.0, 0.0], [0.5, 0.5], [0.0, -1.0], [-3.0, 1.0], [0.0, 0.0]])
    np.testing.assert_allclose(leg.distance(points), [1.0, 1 - math.sqrt(0.5), math.sqrt(2.0), 3.0, 1.0])
    backwards = Bend(np.zeros(2), 1.0, math.pi / 2, -math.pi / 2)
    np.testing.assert_allclose(backwards.distance(points), leg.distance(points))


@pytest.mark.parametrize(
    ("wall", "words"),
    [
        (
            path([0.0, 1.0], {"at": [0.0, 0.0], "radius": 1.5}, [3.0, 0.0]),
            "walls[0].path[1].radius: 1.5 m takes 1.5 m of a leg with 1 m to spare; 1 m is the most",
        ),
        (
            path([0.0, 1.0], {"at": [0.0, 0.0], "radius": 0.6}, {"at": [1.0, 0.0], "radius": 0.7}, [1.0, 1.0]),
            "walls[0].path[2].radius: 0.7 m takes 0.7 m of a leg with 0.4 m to spare; 0.4 m is the most",
        ),
        (
            path([0.0, 0.0], {"at": [1.0, 0.0], "radius": 0.1}, [0.0, 0.0]),
            "walls[0].path[1]: turns straight back, which no arc can round",
        ),
        (path([0.0, 0.0], [0.0, 0.0], [1.0, 0.0]), "walls[0].path[1]: is the same place as the point before it"),
        (
            path([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], closed=True),
            "walls[0].path[0]: is the same place as the point before it",
        ),
    ],
)
def test_a_path_that_cannot_be_drawn(wall, words):
    assert error_of(make([wall], [shaped({"box": {"min": [5, 5], "max": [6, 6]}})])) == words


# ------------------------------------------------------------------------------------------------------------ searching


@pytest.mark.parametrize("extent", [[1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 0.2, 3.0]])
def test_near_agrees_with_brute_force(extent):
    rng = np.random.default_rng(1)
    points, others = rng.uniform(-1, 1, (300, 3)) * extent, rng.uniform(-1.5, 0.5, (200, 3)) * extent
    gap = np.linalg.norm(points[:, None] - others[None], axis=2).min(axis=1)
    for reach in (0.02, 0.1, 0.7):
        np.testing.assert_array_equal(near(points, others, reach), gap < reach)
    assert not near(points, np.empty((0, 3)), 1.0).any()
    assert near(np.empty((0, 3)), others, 1.0).shape == (0,)


def test_contains_by_the_even_odd_rule():
    bent = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [2.0, 3.0], [2.0, 1.0], [0.0, 1.0]])
    points = np.array([[0.5, 0.5], [2.5, 2.5], [1.0, 2.0], [-1.0, 0.5], [2.5, 3.5]])
    for polygon in (bent, bent[::-1], np.roll(bent, 2, axis=0)):
        np.testing.assert_array_equal(inside_polygon(points, polygon), [True, True, False, False, False])


# --------------------------------------------------------------------------------------------------------------- fluids


def test_a_fill_stands_half_a_spacing_off_bed_and_walls():
    placement = place(make())
    x, y, z = placement.position.T
    assert len(x) == 30 * 10
    np.testing.assert_allclose(np.unique(x.round(9)), np.arange(30) * 0.1 + 0.05)
    np.testing.assert_allclose(np.unique(z.round(9)), np.arange(10) * 0.1 + 0.05)
    assert not y.any()
    np.testing.assert_allclose(placement.initial_depth, 1.0 - z)
    assert placement.warnings == ()


@pytest.mark.parametrize("spacing", [0.1, 0.05, 0.02, 0.0123])
def test_a_fill_has_the_area_of_its_basin(spacing):
    bed = [[-2.0, 2.0], {"at": [0.0, 0.0], "radius": 1.0}, [3.0, 0.0], [3.0, 2.0]]
    scene = make([path(*bed)], [POOL | {"fill": {"level": 1.0, "above": "line"}}], spacing=spacing)
    cut = 1.0**2 * (math.tan(math.pi / 8) - math.pi / 8)  # what the arc takes from the corner
    area = 3.0 + 0.5 - cut
    count = len(place(scene).position)
    # Within one row: half a spacing along the surface, the slope and the bed.
    assert abs(count * spacing**2 - area) < 3.0 * spacing


def test_a_fill_leans_on_its_only_upright_wall():
    bed = [[-2.0, 2.0], [0.0, 0.0], [3.04, 0.0], [3.04, 2.0]]
    x = place(make([path(*bed)], [POOL | {"fill": {"level": 1.0, "above": "line"}}])).position[:, 0]
    assert x.max() == pytest.approx(3.04 - 0.05)


def test_a_fill_between_limits():
    placement = place(make(fluids=[POOL | {"fill": {"level": 1.0, "above": "tank", "between": [0.0, 0.5]}}]))
    assert len(placement.position) == 5 * 10
    assert placement.position[:, 0].max() == pytest.approx(0.45)


def test_a_fill_inside_closed_walls():
    box = {"name": "tank", "box": {"min": [0.0, 0.0], "max": [3.0, 2.0]}}
    assert len(place(make([box])).position) == 300
    disc = {"name": "tank", "disc": {"center": [0.0, 1.0], "radius": 1.0}}
    half = place(make([disc], spacing=0.02)).position
    assert len(half) * 0.02**2 == pytest.approx(math.pi / 2, abs=math.pi * 0.02)
    assert np.hypot(half[:, 0], half[:, 2] - 1.0).max() <= 1.0 - 0.0099


def test_an_obstacle_stays_dry_and_the_tank_around_the_bed_does_not():
    block = {"name": "block", "box": {"min": [1.0, 0.0], "max": [1.5, 0.5]}}
    assert len(place(make([TANK, block])).position) == 300 - 25
    in_the_middle = {"name": "block", "box": {"min": [1.2, 0.0], "max": [1.8, 0.5]}}
    assert len(place(make([TANK, in_the_middle])).position) == 300 - 30
    around = {"name": "around", "box": {"min": [-1.0, -1.0], "max": [4.0, 3.0]}}
    assert len(place(make([TANK, around])).position) == 300


@pytest.mark.parametrize(("angle", "count"), [(0.0, 50), (-30.0, 50), (37.0, 50), (90.0, 50)])
def test_a_turned_box_is_filled_row_by_row(angle, count):
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    corners = [[5 + x * c - z * s, 5 + x * s + z * c] for x, z in ((0, 0), (1, 0), (1, 0.5), (0, 0.5))]
    lattice = {"angle": angle, "origin": corners[0]}
    placement = place(make(fluids=[shaped({"polygon": corners}, lattice=lattice)], sound_speed=100.0))
    assert len(placement.position) == count
    assert distances(placement.position).min() == pytest.approx(0.1)


def test_a_site_on_the_edge_is_in_at_the_low_side_only():
    shape = {"box": {"min": [5.05, 5.05], "max": [5.95, 5.45]}}
    fluid = shaped(shape, lattice={"origin": [5.0, 5.0]})
    x, _, z = place(make(fluids=[fluid], sound_speed=100.0)).position.T
    assert (x.min(), x.max(), z.min(), z.max()) == pytest.approx((5.05, 5.85, 5.05, 5.35))


def test_depth_is_below_the_own_top():
    box = shaped({"box": {"min": [1.0, 0.0], "max": [2.0, 0.8]}})
    placement = place(make(fluids=[box]))
    np.testing.assert_allclose(placement.initial_depth, 0.8 - placement.position[:, 2])
    assert not place(make(fluids=[box | {"hydrostatic": False}])).initial_depth.any()
    # On a slope, the top is the surface straight above, not the highest point of the body.
    band = shaped({"polygon": [[0.5, 0.5], [2.5, 1.5], [2.5, 1.9], [0.5, 0.9]]})
    depth = place(make(fluids=[band])).initial_depth
    assert 0.3 < depth.max() < 0.4
    disc = shaped({"disc": {"center": [1.5, 1.0], "radius": 0.4}})
    placement = place(make(fluids=[disc]))
    x, _, z = placement.position.T
    np.testing.assert_allclose(placement.initial_depth, 1.0 + np.sqrt(0.16 - (x - 1.5) ** 2) - z, atol=2e-4)


def test_a_later_fluid_leaves_room_for_an_earlier_one():
    block = shaped({"box": {"min": [1.0, 0.0], "max": [2.0, 0.5]}}, velocity=[1.0, -2.0])
    placement = place(make(fluids=[block, POOL], sound_speed=80.0))
    np.testing.assert_array_equal(np.bincount(placement.fluid), [50, 250])
    assert distances(placement.position).min() == pytest.approx(0.1)
    assert placement.fluid.dtype == np.int32
    np.testing.assert_array_equal(placement.velocity[0], [1.0, 0.0, -2.0])
    np.testing.assert_array_equal(placement.velocity[-1], [0.0, 0.0, 0.0])
    # Off the lattice, a whole ring of sites is left out.
    disc = shaped({"disc": {"center": [1.51, 0.52], "radius": 0.3}})
    placement = place(make(fluids=[disc, POOL]))
    assert distances(placement.position).min() > 0.1 * (1 - 1e-5)


@pytest.mark.parametrize("file", SCENES, ids=lambda file: file.stem)
def test_the_scenes_that_ship_can_be_set_out(file):
    scene = load_scene(file)
    placement = place(scene)
    dx = scene.spacing
    for i, fluid in enumerate(scene.fluids):
        mine = placement.position[placement.fluid == i]
        # Between dummies a fill is cut by walls and by fluids, and packed.
        off_walls, apart = (0.1, 0.8) if scene.wall_model.force == "dummy_particles" else (fluid.clearance, 1.0)
        assert not near(mine, placement.wall_position, (off_walls - 1e-3) * dx).any()
        assert not near(mine, placement.position[placement.fluid != i], (apart - 1e-5) * dx).any()
    assert placement.position[:, 1].any() == placement.wall_position[:, 1].any() == (scene.dimensions == 3)
    assert np.all(placement.initial_depth >= 0)
    assert np.all(np.isfinite(placement.position))


@pytest.mark.parametrize("name", ["landslide", "landslide_0175", "landslide_0200"])
def test_the_slide_lies_on_its_ramp(name):
    scene = load_scene(SCENES[0].parent / f"{name}.yaml")
    placement = place(scene)
    slide = placement.position[placement.fluid == 0][:, [0, 2]]
    above = slide @ [math.sin(math.pi / 6), math.cos(math.pi / 6)]  # height off the ramp
    assert above.min() == pytest.approx(scene.spacing / 2, abs=1e-5)
    assert len(slide) * placement.volume[0] == pytest.approx(0.020, rel=1e-4)
    water_line = -scene.fluids[1].fill.level / math.tan(math.pi / 6)
    assert [gauge.x - water_line for gauge in scene.gauges][-1] == pytest.approx(1.7, abs=1e-5)


# ------------------------------------------------------------------------------------------------ refusals and warnings


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (
            make(fluids=[POOL | {"fill": {"level": -0.5, "above": "tank"}}]),
            "fluids[0].fill: 'tank' is nowhere below the level -0.5 m",
        ),
        (
            make(fluids=[POOL | {"fill": {"level": 1.0, "above": "tank", "between": [4.0, 5.0]}}]),
            "fluids[0].fill: 'tank' is nowhere below the level 1 m between 4 and 5 m",
        ),
        (
            make(fluids=[POOL | {"fill": {"level": 0.04, "above": "tank"}}]),
            "fluids[0].fill: not one particle fits in it, at a spacing of 0.1 m",
        ),
        (
            make(fluids=[shaped({"disc": {"center": [1.0, 1.0], "radius": 0.01}})]),
            "fluids[0].shape: not one particle fits in it, at a spacing of 0.1 m",
        ),
        (
            make(fluids=[POOL, shaped({"box": {"min": [1.0, 0.0], "max": [2.0, 0.5]}})]),
            "fluids[1].shape: every site of it is taken by an earlier fluid, at a spacing of 0.1 m",
        ),
        (
            make(fluids=[shaped({"box": {"min": [-0.5, 0.5], "max": [0.5, 1.0]}})], walls=[TANK]),
            "fluids[0].shape: wall 'tank' runs through it, at x = 0 m, z = 0.9667 m",
        ),
        (
            make(fluids=[shaped({"box": {"min": [0.02, 0.5], "max": [0.52, 1.0]}}, clearance=1.0)]),
            "fluids[0].shape: 5 of 25 particles lie closer than 1 dx to a wall, the first at x = 0.07 m, z = 0.55 m",
        ),
        (
            make(fluids=[POOL | {"fill": {"level": 2.5, "above": "tank"}}]),
            "fluids[0].fill: it would leak at x = 0 m, z = 2.15 m: 'tank' ends there, below the level 2.5 m",
        ),
        (
            make([path([0.0, 0.0], [3.0, 0.0], [3.0, 2.0])], [POOL | {"fill": {"level": 1.0, "above": "line"}}]),
            "fluids[0].fill: it would leak at x = 0 m, z = 0.15 m: 'line' ends there, below the level 1 m",
        ),
        (
            make(spacing=1e-5),
            "spacing: 1e-05 m is too fine: fluids[0].fill would take 3e+10 points, 1e+08 is the most",
        ),
        (make(spacing=1e-6), "spacing: 1e-06 m is too fine: fluids[0].fill would take 3e+12 points, 1e+08 is the most"),
        (
            make(sound_speed=3.0),
            "materials.water.sound_speed: 3 m/s is too low for a drop of 0.95 m; "
            "at least 21.6 m/s is needed (and 43.2 advised)",
        ),
        (
            make(fluids=[POOL | {"velocity": [10.0, 0.0]}], sound_speed=30.0),
            "materials.water.sound_speed: 30 m/s is too low for a drop of 0.95 m begun at 10 m/s; "
            "at least 54.5 m/s is needed (and 109 advised)",
        ),
    ],
)
def test_what_cannot_be_is_refused(scene, words):
    assert error_of(scene) == words


def test_a_refusal_names_file_and_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("low.yaml").write_text(yaml.safe_dump(make(sound_speed=3.0).model_dump(mode="json", exclude_none=True)))
    text = Path("low.yaml").read_text().splitlines()
    line = next(i for i, words in enumerate(text, 1) if "sound_speed" in words)
    assert error_of(load_scene("low.yaml")).startswith(
        f"low.yaml:{line}: materials.water.sound_speed: 3 m/s is too low"
    )
    override = "materials.water.sound_speed=4"
    assert error_of(load_scene("low.yaml", [override])).startswith(
        f"--set {override}: materials.water.sound_speed: 4 m/s is too low"
    )


def test_a_bed_between_walls_of_other_names_does_not_leak():
    walls = [
        path([0.0, 0.0], [3.0, 0.0]),
        {"name": "left", "path": [[0.0, 0.0], [0.0, 2.0]]},
        {"name": "right", "path": [[3.0, 0.0], [3.0, 2.0]]},
    ]
    assert len(place(make(walls, [POOL | {"fill": {"level": 1.0, "above": "line"}}])).position) == 300


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (
            make(sound_speed=3.0, allow=["low_sound_speed"]),
            "materials.water.sound_speed: 3 m/s is too low for a drop of 0.95 m; "
            "at least 21.6 m/s is needed (and 43.2 advised)",
        ),
        (
            make(sound_speed=25.0),
            "materials.water.sound_speed: 25 m/s is low for a drop of 0.95 m; "
            "at least 21.6 m/s is needed (and 43.2 advised)",
        ),
        (
            make(fluids=[POOL | {"fill": {"level": 0.3, "above": "tank"}}]),
            "fluids[0].fill: its depth of 0.3 m is 3.0 rows of particles; 5 are the least, with spacing=0.06",
        ),
        (
            make([path([-1.0, 1.0], [0.0, 0.0], [1.0, 0.8], [2.0, 0.0], [3.0, 1.0])], [ABOVE_LINE]),
            "fluids[0].fill: fills 2 basins, from -0.4 to 0.6 m and from 1.5 to 2.5 m; if one is meant, "
            "'between' tells which",
        ),
        (
            make(gauges=[{"name": "near", "x": 0.1}]),
            "gauges[0].x: stands 1 spacings off wall 'tank'; 1.5 are needed to see all of the surface; "
            "x = 0.15 m is free",
        ),
        (
            make(gauges=[{"name": "inside", "x": 1.45}], bodies=[PADDLE]),
            "gauges[0].x: stands in body 'paddle'; x = 1.25 m is free",
        ),
        (
            make(density=1.9),
            "materials.water.density: 1.9 kg/m3 is a gas's; if it is in g/cm3, 1900 is meant",
        ),
        (
            make(sound_speed=25.0, bodies=[PADDLE | {"motion": {"kind": "constant", "shift": [4.5, 0]}}]),
            "materials.water.sound_speed: 25 m/s is low for a body that is moved at 4.5 m/s; "
            "at least 22.5 m/s is needed (and 45 advised)",
        ),
        (make(fluids=[POOL | {"hold": True}]), "fluids[0].hold: there is no warm_up to hold it through"),
        (
            make(fluids=[shaped({"box": {"min": [2.5, 2.5], "max": [3.5, 3.0]}})], sound_speed=80.0),
            "fluids[0]: 20 particles have no wall below them, the first at x = 3.15 m, z = 2.55 m",
        ),
        (
            make(fluids=[shaped({"box": {"min": [1.0, -2.0], "max": [2.0, -1.0]}})], sound_speed=80.0),
            "fluids[0]: 100 particles have no wall below them, the first at x = 1.05 m, z = -1.95 m",
        ),
        (
            make(gauges=[{"name": "far", "x": 9.0}]),
            "gauges[0].x: 9 m lies beyond the walls, which reach from 0 to 3 m",
        ),
        (
            make(probes=[{"name": "far", "at": [9.0, 0.0]}]),
            "probes[0].at: sees nothing: along x the walls reach from 0 to 3 m",
        ),
        (
            make(overtopping=[{"name": "far", "start": [-1.0, 0.0], "end": [-1.0, 9.0]}]),
            "overtopping[0]: sees nothing: along x the walls reach from 0 to 3 m",
        ),
        (
            make(output={"view": {"z": [3.0, 4.0]}}),
            "output.view.z: sees nothing: along z the walls reach from 0 to 2 m",
        ),
        (
            make(shifting={"model": "fickian"}),
            "shifting.model: in a fluid without a viscosity of its own it adds energy: two thirds of what a tank that "
            "sloshes converts, within 6 s; none leaves it alone",
        ),
        (
            make(fluids=[shaped({"box": {"min": [1.0, 0.0], "max": [1.18, 1.0]}})]),
            "fluids[0].shape: 20 cells of the lattice cover 11.1% more than its area of 0.18 m2; "
            "its particles are made lighter",
        ),
    ],
)
def test_what_is_doubtful_is_a_warning(scene, words):
    assert place(scene).warnings == (words,)


@pytest.mark.parametrize("thick", [0.02, 0.09, 0.11])
def test_what_is_too_thin_for_a_dummy_particle_is_told(thick):
    """Fluid goes through it: a closed wall of which none is left is refused, a fin of a body is a doubt."""
    dummies = {"wall_model": {"force": "dummy_particles"}}
    plate = {"name": "plate", "box": {"min": [1.5, 0.3], "max": [1.5 + thick, 1.5]}}
    fin = [
        [0.7, 1.0],
        [1.5, 1.0],
        [1.5, 0.4],
        [1.5 + thick, 0.4],
        [1.5 + thick, 1.0],
        [2.2, 1.0],
        [2.2, 1.4],
        [0.7, 1.4],
    ]
    body = {"name": "raft", "density": 500.0, "shape": {"polygon": fin}}
    if thick > 0.1:
        assert place(make([TANK, plate], **dummies)).warnings == ()
        assert place(make(bodies=[body], **dummies)).warnings == ()
        return
    told = error_of(make([TANK, plate], **dummies))
    assert told.startswith("walls[1]: 'plate' is thinner than a spacing at x = 1.5") and "0.1 m is the least" in told
    (doubt,) = place(make(bodies=[body], **dummies)).warnings
    assert doubt.startswith("bodies[0].shape: it is thinner than a spacing at x = 1.5")


def test_drop_height():
    assert drop_height(place(make())) == pytest.approx(0.95)
    no_walls = make([], [shaped({"box": {"min": [0.0, 0.0], "max": [1.0, 1.0]}})])
    placement = place(no_walls)
    assert drop_height(placement) == pytest.approx(0.9)
    assert placement.wall_position.shape == placement.wall_normal.shape == (0, 3)
    assert placement.wall_area.shape == (0,)
    assert place(make(sound_speed=0.1, gravity=0.0)).warnings == ()


def test_a_shape_weighs_what_its_drawing_weighs():
    """0.18 m2 in 20 cells of 0.01 m2; a fill keeps its cells."""
    placement = place(make(fluids=[shaped({"box": {"min": [1.0, 0.0], "max": [1.18, 1.0]}})]))
    np.testing.assert_allclose(len(placement.position) * placement.volume, [0.18])


# ---------------------------------------------------------------------------------------------------------------- space

CRATE = {"name": "tank", "box": {"min": [0.0, 0.0, 0.0], "max": [3.0, 1.0, 2.0], "open": ["top"]}}
GUTTER = TANK | {"width": [0.0, 1.0]}
SIDES = {
    "name": "sides",
    "box": {"min": [0.0, 0.0, 0.0], "max": [3.0, 1.0, 2.0], "open": ["left", "right", "bottom", "top"]},
}


def make_3d(walls=(CRATE,), fluids=(POOL,), **fields) -> Scene:
    return make(walls, fluids, dimensions=3, **fields)


@pytest.mark.parametrize("walls", [(CRATE,), (GUTTER, SIDES)], ids=["a crate", "a gutter between sides"])
def test_a_fill_in_space_stands_half_a_spacing_off_every_wall(walls):
    placement = place(make_3d(walls))
    x, y, z = placement.position.T
    assert len(x) == 30 * 10 * 10 == len(np.unique(placement.position.round(9), axis=0))
    np.testing.assert_allclose(np.unique(x.round(9)), np.arange(30) * 0.1 + 0.05)
    np.testing.assert_allclose(np.unique(y.round(9)), np.arange(10) * 0.1 + 0.05)
    np.testing.assert_allclose(np.unique(z.round(9)), np.arange(10) * 0.1 + 0.05)
    np.testing.assert_allclose(placement.initial_depth, 1.0 - z)
    np.testing.assert_allclose(placement.volume, 0.001)
    assert placement.warnings == () and placement.ground == 0.0


def test_a_plane_scene_is_a_slice_of_the_scene_in_space():
    """The slide and the water of a flume across one spacing are the particles of the flume in the plane."""
    slide = shaped({"polygon": [[-0.4, 0.6], [-0.1, 0.3], [0.1, 0.5], [-0.2, 0.8]]}, lattice={"angle": -45.0})
    flume = path([-1.5, 1.5], {"at": [0.0, 0.0], "radius": 0.3}, [2.0, 0.0], [2.0, 1.0])
    pool = POOL | {"fill": {"level": 0.5, "above": "line"}}
    plane = place(make([flume], [slide, pool]))
    across = {"width": [-0.05, 0.05]}
    sides = {
        "name": "sides",
        "box": {"min": [-1.5, -0.05, 0.0], "max": [2.0, 0.05, 1.5], "open": ["left", "right", "bottom", "top"]},
    }
    space = place(make_3d([flume | across, sides], [slide | {"shape": slide["shape"] | across}, pool]))
    np.testing.assert_allclose(space.position, plane.position, atol=1e-12)
    np.testing.assert_array_equal(space.fluid, plane.fluid)
    np.testing.assert_allclose(space.initial_depth, plane.initial_depth)
    np.testing.assert_allclose(space.volume, plane.volume * 0.1, rtol=2e-3)  # each is felt out to 1e-3


VEE = path([0.0, 1.5], [0.0, 0.6], [1.5, 0.0], [3.0, 0.6], [3.0, 1.5])


@pytest.mark.parametrize(
    ("walls", "level", "area"),
    [
        ([TANK | {"path": [[0.0, 2.0], [0.0, 0.0], [2.95, 0.0], [2.95, 2.0]]}], 0.93, 2.95 * 0.93),
        ([VEE | {"name": "tank"}], 1.0, 3.0 - 0.9),
        ([path([-1.0, 1.0], [2.0, 0.0], [5.0, 1.5], name="tank")], 0.8, 0.5 * 0.8 * (2.4 + 1.6)),
    ],
    ids=["no whole number of spacings", "a V", "two beaches"],
)
@pytest.mark.parametrize("force", ["dummy_particles", "radial"])
def test_a_fill_weighs_what_is_drawn(walls, level, area, force):
    scene = make(walls, [POOL | {"fill": {"level": level, "above": "tank"}}], wall_model={"force": force})
    placement = place(scene)
    assert placement.volume[0] * len(placement.position) == pytest.approx(area, rel=1e-3)


def test_what_a_slope_cuts_stands_evenly():
    """Every particle of a V sees the same fluid around it, to 3 %, as on a lattice; cut cells leave it to 40 %."""
    wide = {"force": "dummy_particles"}
    placement = place(make([VEE | {"name": "tank"}], wall_model=wide, smoothing={"ratio": 1.4}))
    x, dummies, h = placement.position, placement.dummies, 0.14
    assert distances(x).min() > 0.07

    def kernel(points):
        q = np.linalg.norm(x[:, None] - points[None], axis=2) / h
        return 7.0 / (4.0 * np.pi * h**2) * np.maximum(1.0 - 0.5 * q, 0.0) ** 4 * (1.0 + 2.0 * q)

    share = kernel(x).sum(axis=1) * placement.volume[0] + kernel(dummies.position) @ dummies.volume
    inside = placement.initial_depth > 2 * h
    assert np.ptp(share[inside]) < 0.06 and share[inside].mean() == pytest.approx(1.0, abs=0.02)


def test_obstacles_stay_dry_in_space():
    block = {"name": "block", "box": {"min": [1.0, 0.2, 0.0], "max": [1.5, 0.6, 0.5]}}
    assert len(place(make_3d([CRATE, block])).position) == 3000 - 5 * 4 * 5
    pile = {"name": "pile", "disc": {"center": [1.5, 0.5], "radius": 0.3}, "width": [0.0, 1.0]}
    position = place(make_3d([CRATE, pile])).position
    assert np.hypot(position[:, 0] - 1.5, position[:, 2] - 0.5).min() > 0.3 + 0.0499
    around = {"name": "around", "box": {"min": [-1.0, -1.0, -1.0], "max": [4.0, 4.0, 3.0]}}
    assert len(place(make_3d([CRATE, around])).position) == 3000


def test_shapes_in_space_weigh_what_their_drawings_weigh():
    ball = shaped({"sphere": {"center": [1.5, 0.5, 1.0], "radius": 0.33}}, velocity=[1.0, 2.0, -3.0])
    placement = place(make_3d(fluids=[ball]))
    away = np.linalg.norm(placement.position - [1.5, 0.5, 1.0], axis=1)
    assert away.max() < 0.33
    assert len(away) * placement.volume[0] == pytest.approx(4 / 3 * math.pi * 0.33**3)
    assert len(away) == pytest.approx(4 / 3 * math.pi * 3.3**3, rel=0.1)
    np.testing.assert_array_equal(placement.velocity[0], [1.0, 2.0, -3.0])
    x, y, z = placement.position.T
    roof = 1.0 + np.sqrt(0.33**2 - (x - 1.5) ** 2 - (y - 0.5) ** 2)
    np.testing.assert_allclose(placement.initial_depth, roof - z)
    lying = shaped({"disc": {"center": [1.5, 1.0], "radius": 0.4}, "width": [0.2, 0.8]})
    placement = place(make_3d(fluids=[lying]))
    assert len(placement.position) * placement.volume[0] == pytest.approx(math.pi * 0.4**2 * 0.6)
    np.testing.assert_allclose(np.unique(placement.position[:, 1].round(9)), 0.25 + 0.1 * np.arange(6))
    block = place(make_3d(fluids=[shaped({"box": {"min": [1.0, 0.0, 0.0], "max": [1.5, 1.0, 0.4]}}), POOL]))
    np.testing.assert_array_equal(np.bincount(block.fluid), [5 * 10 * 4, 3000 - 5 * 10 * 4])
    assert distances(block.position[:600]).min() == pytest.approx(0.1)


@pytest.mark.parametrize(("wet", "low", "high"), [("inside", -0.09, [3.09, 1.09]), ("outside", 0.09, [2.91, 0.91])])
def test_faces_stand_behind_their_drawing_wherever_the_fluid_is(wet, low, high):
    body = {"inside": [[1.0, 0.2, 0.5], [2.0, 0.8, 1.0]], "outside": [[1.0, 1.5, 0.5], [2.0, 2.5, 1.0]]}[wet]
    body = shaped({"box": {"min": body[0], "max": body[1]}})
    scene = make_3d(fluids=[body], sound_speed=100.0, wall_model={"set_back": 0.9})
    placement = place(scene)
    points, normals = placement.wall_position, placement.wall_normal
    np.testing.assert_allclose(points.min(axis=0), low)
    np.testing.assert_allclose(points.max(axis=0), [*high, 2.09])  # beyond the open top, outward either way
    assert len(np.unique(points.round(6), axis=0)) == len(points), "a point of an edge is there twice"
    assert np.all(np.isin(points.round(9), np.array([low, *high]).round(9)).any(axis=1)), "a point off every face"
    # Normals point to the fluid: into the box or out of it, halfway between the faces at an edge and a corner.
    corner = np.argmin(points.sum(axis=1))
    np.testing.assert_allclose(normals[corner], np.full(3, 1 / math.sqrt(3)) * (1 if wet == "inside" else -1))
    nearest = np.argmin(np.linalg.norm(points - placement.position[0], axis=1))
    assert normals[nearest] @ (placement.position[0] - points[nearest]) > 0.0
    # The areas add up to those of the faces that were sampled.
    size = np.ptp(points, axis=0)
    area = size[0] * size[1] + 2 * (size[0] + size[1]) * size[2]
    assert placement.wall_area.sum() == pytest.approx(area)


def test_extruded_walls_close_with_the_walls_at_their_sides():
    """Wherever water stands, a wall point is no farther off than from a plane wall: edges have no gaps."""
    for walls in ((CRATE,), (GUTTER, SIDES)):
        scene = make_3d(walls)
        placement = place(scene)
        wall, back = placement.wall_position, 0.95 * scene.spacing
        np.testing.assert_allclose(wall.min(axis=0), -back)
        # Points straight behind the edges and the corner, where the set-back faces meet.
        edges = np.array([[-back, -back, 1.0], [-back, 0.5, -back], [1.5, -back, -back], [-back, -back, -back]])
        assert near(edges, wall, scene.wall_spacing).all()
    areas = place(make_3d([GUTTER, SIDES])).wall_area
    inner = (2 * 2.095 + 3.19) * 1.19  # the gutter set back, and as much wider
    assert areas.sum() == pytest.approx(inner + 2 * 3.19 * 2.19, rel=0.02)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (
            make_3d([GUTTER]),
            "fluids[0].fill: it would leak at x = 0.15 m, y = 0 m, z = 0.15 m: 'tank' ends there, below the level 1 m",
        ),
        (
            make_3d([CRATE | {"box": CRATE["box"] | {"open": ["top", "back"]}}]),
            "fluids[0].fill: it would leak at x = 0.15 m, y = 1 m, z = 0.15 m: 'tank' ends there, below the level 1 m",
        ),
        (
            make_3d([CRATE | {"box": CRATE["box"] | {"open": ["top", "bottom"]}}]),
            "fluids[0].fill: it would leak at x = 0.15 m, y = 0.15 m, z = 0 m: 'tank' ends there, below the level 1 m",
        ),
        (
            make_3d(fluids=[POOL | {"fill": {"level": 2.5, "above": "tank"}}]),
            "fluids[0].fill: it would leak at x = 0 m, y = 0 m, z = 2.1 m: 'tank' ends there, below the level 2.5 m",
        ),
        (
            make_3d(fluids=[shaped({"sphere": {"center": [1.5, 0.9, 1.0], "radius": 0.5}})]),
            "fluids[0].shape: wall 'tank' runs through it, at x = 1.367 m, y = 1 m, z = 0.5333 m",
        ),
        (
            make_3d(fluids=[shaped({"box": {"min": [1.0, 0.02, 1.0], "max": [2.0, 0.52, 1.5]}}, clearance=1.0)]),
            "fluids[0].shape: 50 of 250 particles lie closer than 1 dx to a wall, "
            "the first at x = 1.05 m, y = 0.07 m, z = 1.05 m",
        ),
        (
            make_3d(fluids=[shaped({"sphere": {"center": [1.5, 0.5, 1.0], "radius": 0.01}})]),
            "fluids[0].shape: not one particle fits in it, at a spacing of 0.1 m",
        ),
        (
            make_3d(spacing=1e-4),
            "spacing: 0.0001 m is too fine: walls would take 1.7e+10 points, 1e+08 is the most",
        ),
    ],
)
def test_what_cannot_be_in_space_is_refused(scene, words):
    assert error_of(scene) == words


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (
            make_3d(fluids=[shaped({"box": {"min": [1.0, 0.5, 2.5], "max": [2.0, 1.5, 3.0]}})], sound_speed=80.0),
            "fluids[0]: 200 particles have no wall below them, the first at x = 1.05 m, y = 1.15 m, z = 2.55 m",
        ),
        (
            make_3d(gauges=[{"name": "beside", "x": 1.0, "y": 1.5}]),
            "gauges[0].y: 1.5 m lies beyond the walls, which reach from 0 to 1 m",
        ),
        (
            make_3d(fluids=[shaped({"box": {"min": [1.0, 0.0, 0.0], "max": [1.18, 1.0, 1.0]}})]),
            "fluids[0].shape: 200 cells of the lattice cover 11.1% more than its volume of 0.18 m3; "
            "its particles are made lighter",
        ),
    ],
)
def test_what_is_doubtful_in_space_is_a_warning(scene, words):
    assert place(scene).warnings == (words,)
