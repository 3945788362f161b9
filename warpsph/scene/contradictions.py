"""What no single field of a scene can know: whatever does not fit the rest of it."""

from __future__ import annotations

from collections.abc import Iterator

from warpsph.scene.bodies import LOCKS, BodyField
from warpsph.scene.fields import marks_of, parts_within
from warpsph.scene.fluids import RheologyField
from warpsph.scene.schemes import TRAITS, strange_to_scheme
from warpsph.scene.source import nearest
from warpsph.scene.whole import INSTRUMENTS, SceneFields

MOST_FRAMES, MOST_SAMPLES = 1_000_000, 5_000_000


def wants_lists(scene: SceneFields) -> list[str]:
    """The parts of a scene that need lists of neighbours: pair loops other than pressure and density."""
    needs = {
        f"the scheme {scene.scheme}": TRAITS[scene.scheme].list_reach is not None,
        "antuono's diffusion of density": scene.density_diffusion.model == "antuono",
        "walls of dummy particles": bool(scene.walls) and scene.wall_model.force == "dummy_particles",
        "images": scene.images,
        "the materials' own viscosity": any(material.viscosity for material in scene.materials.values()),
        "shifting": scene.shifting.model != "none",
        "a density_filter": scene.density_filter.model != "none",
    }
    return [name for name, is_there in needs.items() if is_there]


def contradictions(scene: SceneFields) -> Iterator[tuple[str, str]]:
    """What no single field can know: (path, message) for whatever does not fit the rest of the scene."""
    yield from _too_often(scene)
    yield from strange_to_scheme(scene)
    if scene.dimensions == 3 and scene.wall_model.force.startswith("monaghan_kos"):
        force = scene.wall_model.force
        yield "wall_model.force", f"{force} needs walls that are lines; in a 3-D scene take radial or lennard_jones"
    yield from _strange_to_dummies(scene)
    if scene.neighbours == "cells" and scene.scheme == "weakly_compressible":
        yield from (("neighbours", f"lists are needed for {name}") for name in wants_lists(scene))
    flowing = [scene.materials[fluid.material] for fluid in scene.fluids if fluid.material in scene.materials]
    if scene.shifting.velocity == "local" and not any(material.viscosity for material in flowing):
        yield "shifting.velocity", "local needs a fluid with a viscosity of its own"
    yield from _misplaced(scene)
    if scene.images:
        if scene.bodies:
            yield "bodies", "a scene with images has no bodies: they would not be seen through them"
        if scene.density_diffusion.model == "antuono":
            yield "density_diffusion.model", "antuono does not know images; take fourtakas"
    for kind in ("walls", "images", "fluids", "bodies", "damping_zones", *INSTRUMENTS):
        seen: dict[str, int] = {}
        for i, part in enumerate(getattr(scene, kind)):
            # Records are files named after the part, and some file systems do not tell A from a.
            first = seen.setdefault(part.name.casefold(), i)
            if first != i:
                yield f"{kind}[{i}].name", f"'{part.name}' is the name of {kind}[{first}] already"
    yield from _strange_to_instruments(scene)
    if not scene.gravity and (scene.wave_maker or scene.damping_zones):
        yield "gravity", "must be more than 0 where waves are made or damped"
    for i, zone in enumerate(scene.damping_zones):
        for name in ("period", "depth"):
            if getattr(zone, name) is None and (scene.wave_maker is None or getattr(scene.wave_maker, name) is None):
                yield f"damping_zones[{i}].{name}", "this field is missing, without a wave_maker that has one"
    for i, fluid in enumerate(scene.fluids):
        if fluid.material not in scene.materials:
            hint = nearest(fluid.material, scene.materials)
            yield f"fluids[{i}].material", f"no material named '{fluid.material}'{hint}"
        if fluid.fill and fluid.fill.above not in (names := [wall.name for wall in scene.walls]):
            yield f"fluids[{i}].fill.above", f"no wall named '{fluid.fill.above}'{nearest(fluid.fill.above, names)}"
    ways = {name: law.regularisation or "bi_viscous" for name, law in _yielding(scene).items()}
    for name, way in ways.items():
        if way != (chosen := next(iter(ways.values()))):
            path = f"materials.{name}.rheology.regularisation"
            yield path, f"one for all materials of a scene is needed, and another one has {chosen}"
    for i, body in enumerate(scene.bodies):
        yield from ((f"bodies[{i}].{path}", message) for path, message in _impossible_start(scene, body))
    if scene.bodies and scene.run.integrator == "predictor_corrector":
        yield "run.integrator", "predictor_corrector does not move bodies; take verlet or runge_kutta"


def _too_often(scene: SceneFields) -> Iterator[tuple[str, str]]:
    """(path, message) for whatever would be written more often than anyone reads."""
    end, output = scene.run.end_time, scene.output
    wanted = {
        "frames_per_second": (output.frames_per_second * end, MOST_FRAMES, "frames"),
        "samples_per_second": (output.samples_per_second * (end - scene.start_time), MOST_SAMPLES, "lines of records"),
        "checkpoint_every": ((end - scene.start_time) / output.checkpoint_every, MOST_FRAMES, "checkpoints"),
    }
    for name, (count, most, words) in wanted.items():
        if count > most:
            yield f"output.{name}", f"makes {count:.1e} {words} until {end:g} s; {most:,} is the most"


def _strange_to_dummies(scene: SceneFields) -> Iterator[tuple[str, str]]:
    """(path, message) for whatever does not know walls of dummy particles yet."""
    if scene.wall_model.force != "dummy_particles":
        return
    if scene.bodies and not scene.walls:
        yield "bodies", "dummy_particles need a wall too; take another wall_model.force"
    if not scene.walls:
        return
    strange = {
        "images": bool(scene.images),
        "density_diffusion.model": scene.density_diffusion.model == "antuono",
        "density_filter.model": scene.density_filter.model != "none",
        "viscosity.weights": scene.viscosity.weights == "balanced",
    }
    for path, is_there in strange.items():
        if is_there:
            yield path, "walls of dummy particles do not know this yet; take another wall_model.force"


def _strange_to_instruments(scene: SceneFields) -> Iterator[tuple[str, str]]:
    """(path, message) for an instrument on a wall or a body that is not there, or a record held against no column."""
    walls, bodies = [wall.name for wall in scene.walls], [body.name for body in scene.bodies]
    for kind in ("forces", "run_up"):
        for i, part in enumerate(getattr(scene, kind)):
            if part.wall not in walls:
                yield f"{kind}[{i}].wall", f"no wall named '{part.wall}'{nearest(part.wall, walls)}"
    for i, probe in enumerate(scene.probes):
        if probe.body is not None and probe.body not in bodies:
            yield f"probes[{i}].body", f"no body named '{probe.body}'{nearest(probe.body, bodies)}"
    known = {"gauges": ("level",), "probes": ("pressure", *("uw" if scene.dimensions == 2 else "uvw"))}
    for kind, names in known.items():
        for i, part in enumerate(getattr(scene, kind)):
            if part.observed and part.observed.quantity not in (None, *names):
                wanted = part.observed.quantity
                yield f"{kind}[{i}].observed.quantity", f"no column is named '{wanted}'{nearest(wanted, names)}"


def _yielding(scene: SceneFields) -> dict[str, RheologyField]:
    """The laws with a yield stress, by material."""
    laws = {name: material.rheology for name, material in scene.materials.items()}
    return {name: law for name, law in laws.items() if law and law.yield_stress is not None}


def _impossible_start(scene: SceneFields, body: BodyField) -> Iterator[tuple[str, str]]:
    """(path, message) where a body is to move as it cannot."""
    for i, lock in enumerate(body.locked):
        if lock not in LOCKS[scene.dimensions]:
            yield f"locked[{i}]", f"'{lock}' means nothing in a {scene.dimensions}-D scene"
    spin = body.spin or 0.0
    axes, turns = ("xz", ("angle",)) if scene.dimensions == 2 else ("xyz", ("turn_x", "turn_y", "turn_z"))
    rates = spin if isinstance(spin, tuple) else (spin,)
    known = {
        "velocity": dict(zip(axes, body.velocity or (), strict=False)),
        "spin": dict(zip(turns, rates, strict=True)) if len(rates) == len(turns) else {},
    }
    for name, starts in known.items():
        for way, value in starts.items():
            if value and way in body.locked:
                yield name, f"starts with {value:g} along '{way}', which is locked"


def _misplaced(scene: SceneFields) -> Iterator[tuple[str, str]]:
    """(path, message) for whatever belongs to a scene of the other number of dimensions."""
    for path, part in parts_within(scene):
        for name, marks in marks_of(type(part)).items():
            found = (mark.fault(getattr(part, name), part, scene.dimensions) for mark in marks)
            yield from ((f"{path}.{name}" if path else name, message) for message in found if message)
