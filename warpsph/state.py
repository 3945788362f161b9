"""State: the arrays that change from step to step, allocated once."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpsph.device.blocks import blocks_of, stages_of
from warpsph.device.launch import alias
from warpsph.kernels.density import BY_GRADIENT
from warpsph.kernels.neighbours import scatter_kernel
from warpsph.kernels.state_equation import find_pressure
from warpsph.model import Model
from warpsph.placement.images import folded

NO_LAST_STEP = 2**31 - 1


@dataclass(frozen=True)
class Snapshot:
    """The fluid at one instant, in id order.

    Attributes:
        time: [s].
        step: Steps done so far.
        position: [m], float64, shape [particle_count, 3].
        velocity: [m/s], float32, shape [particle_count, 3].
        density: [kg/m3], float64, shape [particle_count].
        pressure: [Pa], float32, shape [particle_count].
        fluid: Index into the scene's fluids, int32, shape [particle_count].
        id: 0, 1, ... particle_count - 1 less what has left, int64.
        apparent_viscosity: [Pa s], float32, shape [particle_count]; None where every viscosity is a constant.
        yielded: 1 where the fluid flows, 0 where it is a plug, int32, shape [particle_count]; None likewise.
    """

    time: float
    step: int
    position: np.ndarray
    velocity: np.ndarray
    density: np.ndarray
    pressure: np.ndarray
    fluid: np.ndarray
    id: np.ndarray
    apparent_viscosity: np.ndarray | None = None
    yielded: np.ndarray | None = None


# The clock of a state: time, and the target that no step goes beyond [s]; dt, the step that comes next, 0 at the target
# and after a fault, and its longest stable length [s]; steps done, and the last before the host is asked; whether a
# pair might be missing from the lists before the next step ends; whether the next step may be taken; what is wrong with
# the first absurd particle, and its slot.
CLOCK = np.dtype(
    [
        *(
            ("time", "<f8"),
            ("target", "<f8"),
            ("dt", "<f4"),
            ("dt_limit", "<f4"),
            ("step", "<i4"),
            ("last_step", "<i4"),
        ),
        *(("stale", "<i4"), ("running", "<i4"), ("fault", "<i4"), ("fault_slot", "<i4")),
    ]
)
_WARP_TYPES = {"<f8": wp.float64, "<f4": wp.float32, "<i4": wp.int32}


class State:
    """Particle arrays in slot order (sorted by cell whenever neighbours are listed), and the clock.

    Position and density are integrated in double precision; the pair loops read them rounded, packed as
    (x, y, z, V) and (u, v, w, p), so that a neighbour costs two loads. In a plane v, which is 0, makes room for x.
    Ghosts, if there are any, stand behind the particles.

    Attributes:
        particle_names: Arrays that are a particle's own history.
        kept_names: Arrays that a checkpoint keeps.
    """

    # A particle's own history, with the fields of the scheme: permuted when slots are sorted.
    PARTICLE = ("id", "fluid", "position", "velocity", "density")
    # What a checkpoint keeps besides: with the place where particles were listed, a resumed run sums in the same order.
    KEPT = ("time", "dt", "dt_limit", "step", "stale", "listed_position", "work", "energy_gone")

    # The clock, arrays of one entry: see CLOCK.
    time: wp.array
    target: wp.array
    dt: wp.array
    dt_limit: wp.array
    step: wp.array
    last_step: wp.array
    stale: wp.array
    running: wp.array
    fault: wp.array
    fault_slot: wp.array
    # Fields of a scheme that rooms of a step know by name.
    acceleration: wp.array
    density_rate: wp.array
    last_diffusion_rate: wp.array
    xsph_velocity: wp.array

    def __init__(self, model: Model, fields: Mapping[str, type]) -> None:
        """`fields` are the fields of the scheme, by name; they begin at 0."""
        self.model = model
        device, count = model.launcher.device, model.particle_count

        def zeros(dtype: type, length: int = count) -> wp.array:
            return wp.zeros(length, dtype=dtype, device=device)

        def array(values: np.ndarray, dtype: type) -> wp.array:
            return wp.array(values, dtype=dtype, device=device)

        self.id = array(np.arange(count, dtype=np.int32), int)
        position, velocity, density, fluid = model.take_initial()
        self.fluid = self.fluid_and_ghosts = array(fluid, int)
        self.position = array(position, wp.vec3d)  # [m]
        self.velocity = array(velocity, wp.vec3)  # [m/s]
        self.density = array(density, wp.float64)  # [kg/m3]
        del position, velocity, density, fluid  # before the rest takes its room
        for name, dtype in fields.items():
            setattr(self, name, zeros(dtype))
        is_balanced = model.viscous is not None and model.viscous.balanced
        self.balance = zeros(wp.vec3, count if is_balanced else 1)  # lambda of balance.py, in the last step [1/m]
        self.particle_names = (*self.PARTICLE, *fields, *(("balance",) if is_balanced else ()))
        self.kept_names = (*self.particle_names, *self.KEPT)

        self.listed_position = zeros(wp.vec3)  # where the particles were when their neighbours were listed [m]

        # Within a step.
        self._pack(0)
        self.pressure_acceleration = zeros(wp.vec3)  # [m/s2]
        self.dissipative_acceleration = zeros(wp.vec3)
        self.wall_acceleration = zeros(wp.vec3)
        self.diffusion_rate = zeros(float)  # [kg/m3/s]
        self.wall_distance = zeros(float)  # [m]
        if model.has_dummies:
            self.wall_distance.fill_(np.inf)  # nothing but pressure holds fluid off them
        needs_gradient = model.formulas.diffusion in BY_GRADIENT
        self.pressure_gradient = zeros(wp.vec3, count if needs_gradient else 1)  # [Pa/m]
        has_rheology = model.viscous is not None and model.viscous.law is not None
        self.apparent_viscosity = zeros(float, count if has_rheology else 1)  # when outputs are due [Pa s]
        self.yielded = zeros(int, count if has_rheology else 1)  # 0: a plug
        is_filtered = model.scene.density_filter.model != "none"
        self.filtered_density = zeros(wp.float64, count if is_filtered else 1)  # [kg/m3]
        is_shifted = model.scene.shifting.model != "none"
        self.cover = zeros(float, count if is_shifted else 1)  # least eigenvalue of the moments of neighbours
        averages = model.scene.run.integrator == "predictor_corrector"  # the rates at both ends of the step
        self.first_dissipative = zeros(wp.vec3, count if averages else 1)  # at its beginning [m/s2]
        self.first_wall = zeros(wp.vec3, count if averages else 1)
        self.particle_dt_limit = zeros(float)  # [s]
        self.particle_fault = zeros(int)
        self.particle_work = zeros(wp.vec3)  # in the last step: dissipated, done by walls, damped [J]

        self.blocks, self.block_count = blocks_of(count, device)  # whose sums and extremes one thread collects
        self.work = zeros(wp.vec3d, self.block_count)  # since the release; a block's, for only the sum counts [J]
        self.energy_gone = zeros(wp.float64, 1)  # with particles that left since the release [J]
        # One entry more, for bodies: without any it stays at no limit, no fault and, below, no strain. The limit by
        # viscosity, which never changes, has the last.
        viscous_step = model.viscous.longest_step if model.viscous else np.inf
        self.block_dt_limit = array(np.append(np.full(self.block_count + 1, np.inf), viscous_step), float)
        self.block_fault_slot = array(np.full(self.block_count + 2, -1), int)
        # The same of blocks of these, and so on, until one thread can go through them.
        self.stages = [
            (blocks, zeros(float, number), zeros(int, number))
            for blocks, number in stages_of(self.block_count + 2, device)
        ]

        # How far the particles of each block of cells have moved since they were listed: bounds [m], and as a share of
        # what the lists allow; of blocks of these and so on, on a GPU; one entry more, for bodies.
        self.cell_block_count = math.prod(model.grid.blocks)
        self.motion_lower = zeros(wp.vec3, self.cell_block_count)
        self.motion_upper = zeros(wp.vec3, self.cell_block_count)
        self.strain = zeros(float, self.cell_block_count + 1)
        stages = stages_of(self.cell_block_count, device)
        self.strain_stages = [(blocks, zeros(float, number + 1)) for blocks, number in stages]
        self.block_strain = self.strain_stages[-1][1] if stages else self.strain
        self.strain_block_count = len(self.block_strain) - 1

        # The clock, one entry each, side by side so that the host reads all of it at once.
        self._clock = zeros(wp.uint8, CLOCK.itemsize)
        for name, (kind, offset, *_) in (CLOCK.fields or {}).items():
            setattr(self, name, alias(self._clock, _WARP_TYPES[kind.str], 1, offset))
        self.time.fill_(model.scene.start_time)
        self.target.fill_(model.scene.start_time)
        self.last_step.fill_(NO_LAST_STEP)
        self.damping = zeros(float, 1)  # [1/s]

    def _pack(self, room: int) -> None:
        length = self.model.particle_count + room
        self.packed = wp.zeros(2 * length, dtype=wp.vec4, device=self.model.launcher.device)
        self.position_volume, self.velocity_pressure = self.packed[:length], self.packed[length:]

    def make_room(self, room: int) -> None:
        """Room for so many ghosts behind the particles, in the arrays that pair loops read; what they held is lost.

        Launches that were bound to them must be recorded anew.
        """
        length = self.model.particle_count + room
        self.fluid_and_ghosts = wp.zeros(length, dtype=int, device=self.model.launcher.device)
        self._pack(room)

    def clock(self) -> np.void:
        """The clock as it is now, a record of CLOCK."""
        return self.model.launcher.read(self._clock).view(CLOCK)[0].copy()

    def snapshot(self, pinned: dict[str, wp.array] | None = None) -> Snapshot:
        """Copy the fluid to the host, in id order.

        `pinned` is for copies made again and again: memory that a GPU writes into by itself, many times as fast. It
        is made at the first time; the snapshot is good until it is given again.
        """
        m, device = self.model, self.model.launcher.device
        pressure = wp.empty(m.particle_count, dtype=float, device=device)
        m.launcher.run(find_pressure, m.particle_count, m, self, pressure=pressure)
        arrays = {name: getattr(self, name) for name in ("position", "velocity", "density", "fluid")}
        arrays["pressure"] = pressure
        if m.viscous is not None and m.viscous.law is not None:
            arrays |= {"apparent_viscosity": self.apparent_viscosity, "yielded": self.yielded}
        ordered = {name: self._in_id_order(values) for name, values in arrays.items()}
        if pinned is not None and device.is_cuda:
            for name, values in ordered.items():
                if name not in pinned:
                    pinned[name] = wp.empty(len(values), dtype=values.dtype, device="cpu", pinned=True)
                wp.copy(pinned[name], values)
            wp.synchronize_stream(device)
            ordered = pinned
        found, clock = {name: values.numpy() for name, values in ordered.items()}, self.clock()
        found["position"], found["velocity"] = folded(m.edges, m.seen_images, found["position"], found["velocity"])
        ids = np.arange(m.particle_count, dtype=np.int64)
        here = found["fluid"] < len(m.fluid_names)
        if not here.all():  # some have left
            ids, found = ids[here], {name: values[here] for name, values in found.items()}
        return Snapshot(time=float(clock["time"]), step=int(clock["step"]), id=ids, **found)

    def _in_id_order(self, values: wp.array) -> wp.array:
        """A copy of an array of the particles, in id order."""
        ordered = wp.empty_like(values)
        places = {"place": self.id, "values": values, "values_out": ordered}
        self.model.launcher.run(scatter_kernel(values.dtype), len(values), **places)
        return ordered
