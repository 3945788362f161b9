"""The scene file: its fields with their units, and plain words for whatever is wrong with them.

A scene is one YAML file. `load_scene` reads it into frozen models, which are also the JSON Schema that an editor
completes from: the whole below, its parts in `fluids`, `boundaries`, `bodies` and `shapes`. Every mistake
ends as a `SceneError` whose text is the finished line for the user, all that are found at once a line each:

    landslide.yaml:31: fluids[1].material: no material named 'watr'; did you mean 'water'?

SI units throughout, z up, angles in degrees. A point is [x, z], in a 3-D scene [x, y, z].
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import Field, PrivateAttr, ValidationError, model_validator

from warpsph.scene.bodies import LOCKS, BodyField, BodyMotion
from warpsph.scene.boundaries import ImageField, Wall, WallModel
from warpsph.scene.fields import (
    COLOR,
    IN_SPACE,
    NAME,
    Coefficient,
    Duration,
    Line,
    Name,
    NotNegative,
    Part,
    Point,
    Range,
    Rate,
    Real,
    Size,
    Switch,
    SwitchOrBounded,
    Text,
    fault,
    faults,
    marks_of,
    part_types,
    parts_within,
)
from warpsph.scene.fluids import (
    DensityDiffusion,
    DensityFilterField,
    FluidField,
    Material,
    RheologyField,
    Shifting,
    Smoothing,
    ViscosityField,
)
from warpsph.scene.instruments import Force, Gauge, Overtopping, Probe, RunUp
from warpsph.scene.schemes import SchemeName, strange_to_scheme, suited
from warpsph.scene.source import SceneError, SourceMap, apply_override, closest, nearest, read_text, read_yaml, show
from warpsph.scene.waves import PADDLE, DampingZone, WaveMaker

# More than these are a slip, not a scene: each is tested against all others.
MOST_WALLS, MOST_FLUIDS, MOST_BODIES, MOST_GAUGES = 200, 50, 100, 500
MOST_FRAMES, MOST_SAMPLES = 1_000_000, 5_000_000
# More mistakes than this are not read to their end.
MOST_MISTAKES = 12

INSTRUMENTS = ("gauges", "probes", "forces", "run_up", "overtopping")


class WarmUp(Part):
    """Settling before the release, from t = -duration to t = 0."""

    duration: Duration = Field(description="How long the settling lasts [s].")
    damping: NotNegative = Field(description="Rate at which velocity is damped meanwhile [1/s].")
    settling: NotNegative | None = Field(
        None,
        description="How long a fill keeps the density of rest while its particles find their places [s]; half the "
        "duration when absent.",
    )

    @property
    def settling_time(self) -> float:
        """How long a fill keeps the density of rest [s]."""
        return 0.5 * self.duration if self.settling is None else min(self.settling, self.duration)


class RunField(Part):
    """When to stop, and how far a step reaches."""

    end_time: Duration = Field(description="End of the run [s]; t = 0 is the release.")
    courant: Annotated[Real, Field(ge=0.001, le=1)] = Field(
        0.5, description="Courant number: dt = courant h / (c + u) [-]."
    )
    time_step: Annotated[Real, Field(ge=1e-9, le=1)] | None = Field(
        None, description="Fixed time step of the scheme mueller [s]; other schemes find their own."
    )
    integrator: Literal["verlet", "predictor_corrector", "runge_kutta", "leapfrog"] = Field(
        "verlet",
        description="How a step is taken [-]: verlet, predictor_corrector (Heun) or runge_kutta (midpoint rule), all "
        "of second order; verlet keeps energy best; predictor_corrector does not move bodies; leapfrog is that of the "
        "scheme mueller, which knows no other.",
    )
    max_steps: Annotated[int, Field(strict=True, gt=0, le=2_000_000_000)] | None = Field(
        None, description="Number of steps from which on the run stops, at its next record [-]; no limit when absent."
    )
    absurd: Literal["stop", "drop"] = Field(
        "stop",
        description="What an absurd particle does, one faster than sound, say [-]: stop ends the run; drop takes it "
        "out and counts it, up to one in a thousand.",
    )


# Fewer pictures than this of an animation look like slides [1/s].
SMOOTH = 15.0

Projection = Literal["front", "above", "perspective"]


class View(Part):
    """From where pictures are seen, and how much of the scene."""

    projection: Annotated[Projection | None, IN_SPACE] = Field(
        None,
        description="From where a 3-D scene is seen [-]: front (where y is least), above, or in perspective; the last "
        "when absent. A 2-D scene is seen from its front.",
    )
    x: Range | None = Field(None, description="From x to x [m]; all of it when absent.")
    y: Annotated[Range | None, IN_SPACE] = Field(None, description="From y to y, in 3-D [m]; all of it when absent.")
    z: Range | None = Field(None, description="From z to z [m]; all of it when absent.")


class Output(Part):
    """What is written while the scene runs."""

    frames_per_second: Rate = Field(30.0, description="Pictures and frames of USD and VTK [1/s].")
    samples_per_second: Rate = Field(200.0, description="Lines of the records of gauges, energy and fluids [1/s].")
    pictures: Switch = Field(True, description="Whether to draw PNG frames and an animation [-].")
    usd: Switch = Field(True, description="Whether to write a USD point cache [-].")
    vtk: Switch = Field(False, description="Whether to write particles for ParaView [-].")
    checkpoint_every: Duration = Field(0.5, description="Simulated time from one checkpoint to the next [s].")
    usd_fields: Switch = Field(True, description="Whether the USD cache holds density and pressure [-].")
    usd_walls: Switch = Field(True, description="Whether a renderer sees the walls of the USD cache [-].")
    animation_rate: Rate | None = Field(
        None,
        description="Pictures of the animation [1/s]; when absent frames_per_second, as it happens, but 15 at least.",
    )
    view: View = Field(View(), description="From where pictures are seen, and how much of the scene.")
    speed_scale: Size | None = Field(
        None, description="Speed at which the colours of the pictures end [m/s]; a guess from gravity when absent."
    )

    @property
    def shown_per_second(self) -> float:
        """Pictures of the animation [1/s]."""
        return self.animation_rate or max(self.frames_per_second, SMOOTH)


class Scene(Part):
    """A whole scene file."""

    title: Line = Field(description="One line for reports [-].")
    source: Text = Field("", description="Where the case comes from [-].")
    scheme: SchemeName = Field(
        "weakly_compressible",
        description="How the equations of flow are solved [-]: weakly_compressible, or mueller, Braga's (2018) for the "
        "sake of comparison: density by summation, a kernel for each purpose, walls that throw particles back, 2-D.",
    )
    dimensions: Literal[2, 3] = Field(
        2, description="Dimensions of space [-]; a 2-D scene lies in the x-z plane, points of a 3-D one are [x, y, z]."
    )
    spacing: Annotated[Real, Field(ge=1e-6, le=1e4)] = Field(description="Particle spacing dx [m].")
    gravity: Annotated[NotNegative, Field(le=1e4)] = Field(9.81, description="Gravity along -z [m/s2].")
    body_force: Point | None = Field(
        None, description="Acceleration of all fluid besides gravity [u, w], in 3-D [u, v, w] [m/s2]; none when absent."
    )
    smoothing: Smoothing = Field(Smoothing(), description="The smoothing kernel.")
    materials: Annotated[dict[Name, Material], Field(min_length=1, max_length=MOST_FLUIDS)] = Field(
        description="Materials by name."
    )
    artificial_viscosity: Literal["signal", "monaghan"] = Field(
        "signal", description="Artificial viscosity [-]: signal (all pairs) or monaghan (approaching pairs only)."
    )
    artificial_viscosity_beta: Coefficient = Field(
        0.0, description="Quadratic coefficient beta of the monaghan artificial viscosity [-]."
    )
    viscosity: ViscosityField = Field(
        ViscosityField(), description="How forces come of the materials' own viscosities."
    )
    density_diffusion: DensityDiffusion = Field(DensityDiffusion(), description="Diffusion of density.")
    continuity: Literal["plain", "renormalised"] = Field(
        "plain",
        description="Divergence in the rate of density [-]: plain, the partner of the pressure force, or renormalised, "
        "exact for linear velocities in disorder and at a surface, for which energy is kept less well.",
    )
    density_filter: DensityFilterField = Field(DensityFilterField(), description="Density made anew, now and then.")
    shifting: Shifting = Field(Shifting(), description="A drift that keeps particles in order.")
    tensile_correction: SwitchOrBounded = Field(
        "bounded",
        description="Whether to correct the tensile instability [-]; bounded: so far only that no pair in tension is "
        "pushed apart.",
    )
    xsph: Annotated[Real, Field(ge=0, le=1)] = Field(0.0, description="XSPH smoothing of the velocity, epsilon [-].")
    neighbours: Literal["auto", "lists", "cells"] = Field(
        "auto",
        description="How pair loops find neighbours [-]: lists (fast), or the cells around (little memory); auto: "
        "lists, but cells where only these fit into the memory that is free.",
    )
    walls: Annotated[tuple[Wall, ...], Field(max_length=MOST_WALLS)] = Field((), description="Walls.")
    wall_model: WallModel = Field(WallModel(), description="How walls push fluid away.")
    images: Annotated[tuple[ImageField, ...], Field(max_length=6)] = Field(
        (), description="Mirrors and periodic edges."
    )
    fluids: Annotated[tuple[FluidField, ...], Field(min_length=1, max_length=MOST_FLUIDS)] = Field(
        description="Bodies of fluid; a later one leaves out places closer than one spacing to an earlier one."
    )
    bodies: Annotated[tuple[BodyField, ...], Field(max_length=MOST_BODIES)] = Field((), description="Rigid bodies.")
    wave_maker: WaveMaker | None = Field(None, description="A paddle that makes waves; it is the last of the bodies.")
    damping_zones: Annotated[tuple[DampingZone, ...], Field(max_length=MOST_GAUGES)] = Field(
        (), description="Zones in which waves are damped."
    )
    gauges: Annotated[tuple[Gauge, ...], Field(max_length=MOST_GAUGES)] = Field((), description="Wave gauges.")
    probes: Annotated[tuple[Probe, ...], Field(max_length=MOST_GAUGES)] = Field(
        (), description="Probes of pressure and velocity."
    )
    forces: Annotated[tuple[Force, ...], Field(max_length=MOST_GAUGES)] = Field((), description="Forces on walls.")
    run_up: Annotated[tuple[RunUp, ...], Field(max_length=MOST_GAUGES)] = Field(
        (), description="Highest wet points along walls."
    )
    overtopping: Annotated[tuple[Overtopping, ...], Field(max_length=MOST_GAUGES)] = Field(
        (), description="What passes lines, in 3-D rectangles."
    )
    warm_up: WarmUp | None = Field(None, description="Settling before the release; none when absent.")
    run: RunField = Field(description="When to stop, and how far a step reaches.")
    output: Output = Field(Output(), description="What is written while the scene runs.")
    allow: tuple[Literal["low_sound_speed"], ...] = Field((), description="Refusals to turn into warnings [-].")

    _source: SourceMap = PrivateAttr(default_factory=SourceMap)
    _origin: tuple[float, float, float] = PrivateAttr((0.0, 0.0, 0.0))

    @property
    def smoothing_length(self) -> float:
        """h [m]."""
        return self.smoothing.ratio * self.spacing

    @property
    def acceleration(self) -> tuple[float, float, float]:
        """Gravity and the body force [m/s2], shape [3]."""
        x, *y, z = self.body_force or (0.0, 0.0)
        return x, y[0] if y else 0.0, z - self.gravity

    @property
    def wall_spacing(self) -> float:
        """Largest distance between neighbouring points of a wall [m]."""
        return self.spacing / self.wall_model.refinement

    @property
    def start_time(self) -> float:
        """Where the clock starts [s]: 0, or minus the length of the warm-up."""
        return -self.warm_up.duration if self.warm_up else 0.0

    @property
    def origin(self) -> tuple[float, float, float]:
        """What has been taken off all places of this scene [m], as `placement.origin` does; 0 as it was read."""
        return self._origin

    def spot(self, point: Sequence[float]) -> str:
        """Where a point [x, y, z] of this scene [m] is, in words and in the coordinates of the user."""
        axes = "xz" if self.dimensions == 2 else "xyz"
        places = {axis: (point["xyz".index(axis)], self.origin["xyz".index(axis)]) for axis in axes}
        return ", ".join(f"{axis} = {place(*place_of)} m" for axis, place_of in places.items())

    def error(self, path: str, message: str) -> SceneError:
        """A `SceneError` about the field at `path` (such as `fluids[1].shape`), for the caller to raise."""
        if self.wave_maker and path.startswith(f"bodies[{len(self.bodies) - 1}]"):
            path = "wave_maker"  # nobody has written its paddle
        return self._source.error(path, message)

    def resolved_yaml(self) -> str:
        """The scene with every default filled in, as YAML that loads back to an equal `Scene`."""
        data = self.model_dump(mode="json", exclude_none=True)
        if self.wave_maker:
            data["bodies"].pop()  # the paddle, which comes of it
        return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None)

    def paddle(self, maker: WaveMaker) -> BodyField:
        """The paddle of a wave maker as a body, whose motion is found when it is placed."""
        thickness, low = maker.thickness or 6.0 * self.spacing, max(maker.bed, maker.hinge or maker.bed)
        left, right, high = maker.x - thickness, maker.x, maker.upper_edge
        shape: dict[str, Any] = {"box": {"min": (left, low), "max": (right, high)}}
        if self.dimensions == 3:
            front, back = maker.width or (0.0, 1.0)
            shape = {"box": {"min": (left, front, low), "max": (right, back, high)}}
        elif maker.paddle == "flap":
            # Its back is cut away below, so that it does not turn into the bed.
            cut = low + 0.3 * thickness
            shape = {"polygon": ((right, low), (right, high), (left, high), (left, cut))}
        try:
            body = BodyField.model_validate({"name": PADDLE, "shape": shape, "density": 1000.0})
        except ValidationError as error:  # of a size that no body has
            raise fault(f"its paddle cannot be drawn: {next(_mistakes(error))[1]}", "wave_maker") from None
        motion = BodyMotion.model_construct(kind="waves")
        return body.model_copy(update={"motion": motion})

    @model_validator(mode="before")
    @classmethod
    def _rest_in_space(cls, data: Any) -> Any:
        # Rest is the default, and has as many components as the scene has dimensions.
        if isinstance(data, dict) and data.get("dimensions") == 3 and isinstance(data.get("fluids"), (list, tuple)):
            rest = {"velocity": (0.0, 0.0, 0.0)}
            fluids = [rest | fluid if isinstance(fluid, dict) else fluid for fluid in data["fluids"]]
            return data | {"fluids": fluids}
        return data

    @model_validator(mode="after")
    def _holds_together(self) -> Scene:
        if self.wave_maker:
            self.__dict__["bodies"] = (*self.bodies, self.paddle(self.wave_maker))
        if found := list(_contradictions(self)):
            raise faults(found)
        return self

    @model_validator(mode="before")
    @classmethod
    def _suit_the_scheme(cls, data: Any) -> Any:
        return suited(data) if isinstance(data, dict) else data

    @model_validator(mode="before")
    @classmethod
    def _know_new_words(cls, data: Any) -> Any:
        """Scenes from before real viscosity had the plain word say `viscosity` of the artificial one."""
        if isinstance(data, dict):
            for old, new in _RENAMED.items():
                if old in data:
                    raise fault(f"this field is called {new} now", old)
            if data.get("viscosity") in _ARTIFICIAL:
                raise fault(f"{data['viscosity']} is an artificial viscosity: write artificial_viscosity", "viscosity")
        return data


_ARTIFICIAL = ("signal", "monaghan")
_RENAMED = {"viscosity_beta": "artificial_viscosity_beta", "laminar": "viscosity"}


def place(coordinate: float, origin: float) -> str:
    """A coordinate of a scene [m] in words, `origin` [m] added: to four figures of what the scene is about."""
    if not origin:
        return f"{coordinate:.4g}"
    return f"{coordinate + origin:.4f}".rstrip("0").rstrip(".")


def wants_lists(scene: Scene) -> list[str]:
    """What of a scene cannot do with the cells around: pair loops beside those of pressure and density."""
    needs = {
        "the scheme mueller": scene.scheme == "mueller",
        "antuono's diffusion of density": scene.density_diffusion.model == "antuono",
        "walls of dummy particles": bool(scene.walls) and scene.wall_model.force == "dummy_particles",
        "images": scene.images,
        "the materials' own viscosity": any(material.viscosity for material in scene.materials.values()),
        "shifting": scene.shifting.model != "none",
        "a density_filter": scene.density_filter.model != "none",
    }
    return [name for name, is_there in needs.items() if is_there]


def _contradictions(scene: Scene) -> Iterator[tuple[str, str]]:
    """What no single field can know: (path, message) for whatever does not fit the rest of the scene."""
    yield from _too_often(scene)
    yield from strange_to_scheme(scene)
    if scene.dimensions == 3 and scene.wall_model.force.startswith("monaghan_kos"):
        law = scene.wall_model.force
        yield "wall_model.force", f"{law} needs walls that are lines; in a 3-D scene take radial or lennard_jones"
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
    kinds = {name: law.regularisation or "bi_viscous" for name, law in _yielding(scene).items()}
    for name, kind in kinds.items():
        if kind != (first := next(iter(kinds.values()))):
            path = f"materials.{name}.rheology.regularisation"
            yield path, f"one for all materials of a scene is needed, and another one has {first}"
    for i, body in enumerate(scene.bodies):
        yield from ((f"bodies[{i}].{path}", message) for path, message in _impossible_start(scene, body))
    if scene.bodies and scene.run.integrator == "predictor_corrector":
        yield "run.integrator", "predictor_corrector does not move bodies; take verlet or runge_kutta"


def _too_often(scene: Scene) -> Iterator[tuple[str, str]]:
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


def _strange_to_dummies(scene: Scene) -> Iterator[tuple[str, str]]:
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


def _strange_to_instruments(scene: Scene) -> Iterator[tuple[str, str]]:
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


def _yielding(scene: Scene) -> dict[str, RheologyField]:
    """The laws with a yield stress, by material."""
    laws = {name: material.rheology for name, material in scene.materials.items()}
    return {name: law for name, law in laws.items() if law and law.yield_stress is not None}


def _impossible_start(scene: Scene, body: BodyField) -> Iterator[tuple[str, str]]:
    """(path, message) where a body is to move as it cannot."""
    for i, lock in enumerate(body.locked):
        if lock not in LOCKS[scene.dimensions]:
            yield f"locked[{i}]", f"'{lock}' means nothing in a {scene.dimensions}-D scene"
    shifts = dict(zip("xz" if scene.dimensions == 2 else "xyz", body.velocity or (), strict=False))
    turns = {"angle": body.spin or 0.0}
    if scene.dimensions == 3:
        turns = dict(
            zip(("turn_x", "turn_y", "turn_z"), body.spin if isinstance(body.spin, tuple) else (), strict=False)
        )
    for name, starts in {"velocity": shifts, "spin": turns}.items():
        for way, value in starts.items():
            if value and way in body.locked:
                yield name, f"starts with {value:g} along '{way}', which is locked"


def _misplaced(scene: Scene) -> Iterator[tuple[str, str]]:
    """(path, message) for whatever belongs to a scene of the other number of dimensions."""
    for path, part in parts_within(scene):
        for name, marks in marks_of(type(part)).items():
            found = (mark.fault(getattr(part, name), part, scene.dimensions) for mark in marks)
            yield from ((f"{path}.{name}" if path else name, message) for message in found if message)


# ------------------------------------------------------------------------------------------------------------- loading


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a scene file, for editors."""
    return Scene.model_json_schema()


def load_scene(path: Path | str, overrides: Sequence[str] = ()) -> Scene:
    """Read the scene file at `path`, with `overrides` such as `materials.water.alpha=0.03` on top.

    Raises SceneError for a file that cannot be read, is not YAML, or is not a scene: for all its mistakes, a line each,
    in the order of the file.
    """
    data, source = read_yaml(read_text(path), str(path))
    if data is None:
        raise SceneError(f"{path}: the file is empty")
    if not isinstance(data, dict):
        raise source.error("", f"a scene is a mapping of fields, not {show(data)}")
    for override in overrides:
        apply_override(data, source, override)
    _find_files(data, Path(path).parent)
    try:
        scene = Scene.model_validate(data)
    except ValidationError as error:
        found = sorted(_mistakes(error), key=lambda mistake: source.place(mistake[0])[0])
        lines = [str(source.error(*mistake)) for mistake in found[:MOST_MISTAKES]]
        if len(found) > MOST_MISTAKES:
            lines.append(f"and {len(found) - MOST_MISTAKES} mistakes more")
        raise SceneError("\n".join(lines)) from None
    scene._source = source
    return scene


def _find_files(data: dict[str, Any], folder: Path) -> None:
    """Make the paths of files that a scene names absolute, so that the scene of the run folder finds them too."""
    for kind in ("gauges", "probes"):
        for part in data.get(kind) if isinstance(data.get(kind), list) else ():
            seen = part.get("observed") if isinstance(part, dict) else None
            if isinstance(seen, dict) and isinstance(seen.get("file"), str):
                seen["file"] = os.path.abspath(folder / seen["file"])
    maker = data.get("wave_maker")
    if isinstance(maker, dict) and isinstance(maker.get("file"), str):
        maker["file"] = os.path.abspath(folder / maker["file"])
    bodies = data.get("bodies")
    for body in bodies if isinstance(bodies, list) else ():
        shape = body.get("shape") if isinstance(body, dict) else None
        for part in (
            shape.get("mesh") if isinstance(shape, dict) else None,
            isinstance(body, dict) and body.get("motion"),
        ):
            if isinstance(part, dict) and isinstance(part.get("file"), str):
                part["file"] = os.path.abspath(folder / part["file"])


_NEEDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing_size": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "string_unicode": "text without half letters",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping of fields",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_PATTERNS = {NAME: "a name made of letters, digits and _ is needed", COLOR: 'a colour such as "#8a6a4a" is needed'}
# Below a bound as small as this a number is as good as none.
_NEXT_TO_NOTHING = 1e-3


def _mistakes(error: ValidationError) -> Iterator[tuple[str, str]]:
    """(path, message) of all mistakes that pydantic found, in our words."""
    found = error.errors(include_url=False)
    # A list counts as too short when its entries are wrong: the entries are what to name.
    found = [mistake for mistake in found if mistake["type"] != "too_short"] or found
    unknown = {(*mistake["loc"][:-1], _meant(mistake["loc"])) for mistake in found if _is_unknown(mistake)}
    for mistake in found:
        # A key that is misspelt is named, rather than the field that it leaves missing.
        if mistake["type"] == "missing" and tuple(mistake["loc"]) in unknown:
            continue
        if mistake["type"] == "faults":
            yield from mistake["ctx"]["found"]
        else:
            yield _explain(mistake)


def _is_unknown(mistake: Mapping[str, Any]) -> bool:
    return mistake["type"] == "extra_forbidden"


def _meant(loc: Sequence[Any]) -> str:
    """The field that an unknown key is close to; nothing where it is close to none."""
    return closest(loc[-1], _fields_at(loc))


def _fields_at(loc: Sequence[Any]) -> list[str]:
    """The fields that the part has in which the last key of `loc` stands."""
    part = Scene
    for key in loc[:-1]:
        if isinstance(key, str) and key in part.model_fields:
            part = next(part_types(part.model_fields[key].annotation), part)
    return list(part.model_fields)


def _explain(mistake: Mapping[str, Any]) -> tuple[str, str]:
    """(path, message) of one mistake that pydantic found, in our words."""
    path = ""
    for key in mistake["loc"]:
        if isinstance(key, int):
            path += f"[{key}]"
        elif not key.startswith(("<", "[key]")):  # pydantic's marks for "which of a union" and "the key itself"
            path += f".{key}" if path and key else key
    kind, value, context = mistake["type"], mistake["input"], mistake.get("ctx", {})
    if kind == "fault":
        inner = context["path"]
        return (f"{path}.{inner}" if path and inner else path + inner), context["message"]
    if _is_unknown(mistake):
        return path, f"no such field{nearest(mistake['loc'][-1], _fields_at(mistake['loc']), most=math.inf)}"
    if kind == "missing":
        return path, "this field is missing"
    if kind in _NEEDS:
        return path, f"{_NEEDS[kind]} is needed, not {show(value)}"
    if kind in _BOUNDS:
        bound, words = _BOUNDS[kind]
        limit = context[bound]
        if bound == "ge" and 0 < limit <= _NEXT_TO_NOTHING and value <= 0:
            words, limit = "more than", 0
        return path, f"must be {words} {limit:g}, not {show(value)}"
    if kind == "literal_error":
        names = re.findall(r"[\w.]+", context["expected"].replace(" or ", " "))
        return path, f"{show(value)} is not known here{nearest(value, names)}"
    if kind == "string_pattern_mismatch":
        return path, f"{_PATTERNS[context['pattern']]}, not {show(value)}"
    if kind == "string_too_long":
        return path, f"is longer than {context['max_length']} letters"
    if kind == "too_short":
        return path, f"needs {context['min_length']} or more entries, not {context['actual_length']}"
    if kind == "too_long":
        return path, f"has more than {context['max_length']} entries, which is the most"
    return path, f"{show(value)} is not what is needed here"
