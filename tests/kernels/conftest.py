"""What the tests of kernels share: a cloud of particles with NumPy's own view of its pairs, and bodies in contact."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import pytest
import warp as wp

from warpsph.bodies.body import Body
from warpsph.bodies.body_set import BodySet, rotation
from warpsph.bodies.contact_geometry import ContactLegs, ContactPoints
from warpsph.device.launch import Launcher
from warpsph.kernels.blocks import Blocks
from warpsph.kernels.density import pressure_gradient_kernel
from warpsph.kernels.layout import CPU_LAYOUT, CUDA_LAYOUT, Layout, Rows
from warpsph.kernels.neighbours import CellGrid
from warpsph.kernels.parameters import Parameters
from warpsph.kernels.rates import Formulas, rates_kernel
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.shapes.mesh import Mesh

# Two fluids, as unlike as water and rock.
REST_DENSITY = np.array([1000.0, 2530.0])  # [kg/m3]
SOUND_SPEED = np.array([20.0, 30.0])  # [m/s]
ALPHA = np.array([0.05, 0.2])


class Cloud:
    """Particles in the x-z plane with all that a pair loop reads, and each pair [i, j] of them in double precision.

    Attributes:
        x, u: Position [m] and velocity [m/s], shape [n, 3], as rounded for the kernels.
        rho, p: Density [kg/m3] and pressure [Pa], shape [n].
        m, V: Mass [kg/m] and volume [m2], shape [n].
        fluid: Index into the fluids, shape [n].
        h: Smoothing length [m].
    """

    def __init__(
        self,
        device: str,
        x: np.ndarray,
        *,
        u: np.ndarray | float = 0.0,
        rho: np.ndarray | None = None,
        p: np.ndarray | float = 0.0,
        fluid: np.ndarray | int = 0,
        spacing: float = 0.1,
        ratio: float = 1.5,
        smoothing: str = "wendland_c2",
        by_column: bool = False,
        **numbers: float | wp.vec3 | list[float],
    ) -> None:
        """`numbers` replace fields of Parameters; `by_column` lays the neighbour list out as on a GPU."""
        n = len(x)
        self.launcher, self.by_column = Launcher(device, threads=1), by_column
        self.smoothing, self.h = smoothing, ratio * spacing
        self.x = np.asarray(x, np.float32).astype(float)
        self.u = np.broadcast_to(np.asarray(u, np.float32), (n, 3)).astype(float)
        self.fluid = np.broadcast_to(np.asarray(fluid, np.int32), n)
        self.m = (REST_DENSITY * spacing**2).astype(np.float32)[self.fluid].astype(float)
        self.rho = REST_DENSITY[self.fluid] if rho is None else np.asarray(rho, float)
        self.V = (self.m / self.rho).astype(np.float32).astype(float)
        self.rho = self.m / self.V
        self.p = np.broadcast_to(np.asarray(p, np.float32), n).astype(float)
        self.c, self.alpha = SOUND_SPEED[self.fluid], ALPHA[self.fluid]
        self.parameters = self._parameters(spacing, by_column, numbers)

        # Every other particle is on the list: what lies beyond the support must add nothing.
        self.others = np.broadcast_to(np.arange(n), (n, n))[~np.eye(n, dtype=bool)].reshape(n, n - 1)
        self.position_volume = self.array(np.column_stack([self.x, self.V]), wp.vec4)
        self.velocity_pressure = self.array(np.column_stack([self.u, self.p]), wp.vec4)
        self.fluids = self.array(self.fluid, int)
        self.neighbour_count = self.array(np.full(n, n - 1), int)
        self.neighbour_list = self.rows(self.others)

    def _parameters(self, spacing: float, by_column: bool, numbers: dict) -> Parameters:
        n, kernel = len(self.x), SMOOTHING[self.smoothing]
        p = Parameters()
        p.smoothing_length, p.inverse_h = self.h, 1.0 / self.h
        p.kernel_norm = kernel.normalisation[2] / self.h**2
        p.gradient_norm = p.kernel_norm / self.h**2
        p.inverse_shape_dx = kernel.normalisation[2] / WEIGHT[self.smoothing](spacing / self.h)
        p.list_radius = 1.15 * kernel.support * self.h
        p.list_capacity = n - 1
        p.gravity = wp.vec3(0.0, 0.0, -9.81)
        p.hydrostatic = p.gravity
        fields = {
            "mass": REST_DENSITY * spacing**2,
            "rest_density": REST_DENSITY,
            "sound_speed": SOUND_SPEED,
            "stiffening": [1.0, 1.0],
            "alpha": ALPHA,
            "wall_alpha": [0.0, 0.0],
            "mobility": [1.0, 1.0],
            "still_level": [-math.inf, -math.inf],
        }
        for name, value in (fields | numbers).items():
            setattr(p, name, self.array(value, float) if isinstance(value, list | np.ndarray) else value)
        return p

    def rows(self, entries: np.ndarray) -> Rows:
        """Lists of neighbours, shape [n, length]; every third particle has its own among the longer ones."""
        rows, n = Rows(), len(entries)
        is_long = np.arange(n) % 3 == 1
        short = np.where(is_long[:, None], 0, entries)
        for name, table in (("short_rows", short), ("long_rows", entries[is_long])):
            setattr(rows, name, self.array(np.ascontiguousarray(table.T if self.by_column else table), int))
        rows.long_row = self.array(np.where(is_long, np.cumsum(is_long) - 1, -1), int)
        rows.long_capacity = entries.shape[1]
        return rows

    def array(self, values: np.ndarray, dtype: type) -> wp.array:
        """`values` on the device of the cloud."""
        return wp.array(np.asarray(values), dtype=dtype, device=self.launcher.device)

    def run(
        self, kernel: wp.Kernel, inputs: Sequence[object], outputs: Sequence[type], *grids: CellGrid
    ) -> list[np.ndarray]:
        """What `kernel` writes into arrays of the types `outputs`, one entry for each particle, as float64."""
        written = [wp.zeros(len(self.x), dtype=dtype, device=self.launcher.device) for dtype in outputs]
        self.launcher.record_in_order(kernel, len(self.x), [*grids, self.parameters, *inputs, *written])()
        return [array.numpy().astype(float) for array in written]

    def rates(self, momentum: bool = True, continuity: bool = True, **formulas: str | bool | int) -> list[np.ndarray]:
        """Acceleration by pressure and by dissipation [m/s2] [n, 3], rate of density by continuity and by diffusion
        [kg/m3/s] [n], XSPH velocity [m/s] [n, 3]; zero where that half of the loop is left out."""
        quadruples = self.velocity_pressure.numpy().copy()
        if formulas.get("dimensions") == 2:
            quadruples[:, 1] = self.x[:, 0]  # as pressure_at does
        velocity_pressure = self.array(quadruples, wp.vec4)
        packed = [self.launcher.packed(array) for array in (self.position_volume, velocity_pressure)]
        lists = [self.neighbour_count, self.neighbour_list]
        gradient = self.array(self.pressure_gradient(), wp.vec3)
        nobody = [self.array([0], int), self.array(np.zeros((1, 3)), wp.vec3)]  # is found in cells
        inputs = [*packed, self.fluids, gradient, *lists, *nobody]
        kernel = rates_kernel(Formulas(smoothing=self.smoothing, **formulas), self.layout, momentum, continuity)
        return self.run(kernel, inputs, [wp.vec3, wp.vec3, float, float, wp.vec3], CellGrid())

    @property
    def layout(self) -> Layout:
        """How the pair loops of this device read, with the lists by column or by row."""
        return replace(CUDA_LAYOUT if self.launcher.device.is_cuda else CPU_LAYOUT, by_column=self.by_column)

    def pressure_gradient(self) -> np.ndarray:
        """Renormalised gradient of pressure within each fluid [Pa/m], shape [n, 3]."""
        lists = [self.neighbour_count, self.neighbour_list]
        inputs = [self.position_volume, self.velocity_pressure, self.fluids, *lists]
        return self.run(pressure_gradient_kernel(self.smoothing, self.layout), inputs, [wp.vec3])[0]

    def acceleration(
        self, artificial_viscosity: str = "signal", tensile_correction: bool | str = False
    ) -> list[np.ndarray]:
        """By pressure and by dissipation [m/s2], each of shape [n, 3]."""
        return self.rates(
            continuity=False, artificial_viscosity=artificial_viscosity, tensile_correction=tensile_correction
        )[:2]

    def density_rate(self, diffusion: str = "none") -> list[np.ndarray]:
        """The rate by continuity and by diffusion [kg/m3/s] [n], and the XSPH velocity [m/s] [n, 3]."""
        return self.rates(diffusion=diffusion, xsph=True)[2:]

    @cached_property
    def x_ij(self) -> np.ndarray:
        """[m], shape [n, n, 3]."""
        return self.x[:, None] - self.x[None]

    @cached_property
    def u_ij(self) -> np.ndarray:
        """[m/s], shape [n, n, 3]."""
        return self.u[:, None] - self.u[None]

    @cached_property
    def r(self) -> np.ndarray:
        """Distance of each pair [m], shape [n, n]; from a particle to itself it is beyond all reach."""
        r = np.linalg.norm(self.x_ij, axis=2)
        np.fill_diagonal(r, 1e9)
        return r

    @cached_property
    def W(self) -> np.ndarray:
        """W_ij [1/m2], shape [n, n], by the formulas of Vasco (2014), their constants put right."""
        return WEIGHT[self.smoothing](self.r / self.h) / self.h**2

    @cached_property
    def grad_W(self) -> np.ndarray:
        """grad_i W_ij [1/m3], shape [n, n, 3]: the derivative of `W` by central differences."""
        step = 1e-5
        weight, q = WEIGHT[self.smoothing], self.r / self.h
        derivative = (weight(q + step) - weight(np.abs(q - step))) / (2 * step) / self.h**3
        return (derivative / self.r)[:, :, None] * self.x_ij

    def W_at(self, r: float) -> float:
        """W at the distance `r` [m]."""
        return float(WEIGHT[self.smoothing](r / self.h)) / self.h**2


# n w(q), so that W = WEIGHT(r / h) / h^2 in the plane.
WEIGHT = {
    "wendland_c2": lambda q: np.where(q < 2, 7 / (4 * math.pi) * (1 - q / 2) ** 4 * (1 + 2 * q), 0.0),
    "cubic_spline": lambda q: (
        np.select([q < 1, q < 2], [2 / 3 - q**2 + q**3 / 2, (2 - q) ** 3 / 6], 0.0) * 15 / (7 * math.pi)
    ),
    "quintic_spline": lambda q: (
        1.5**2 * 7 / (478 * math.pi) * sum(c * np.maximum(a - 1.5 * q, 0.0) ** 5 for a, c in ((3, 1), (2, -6), (1, 15)))
    ),
    "gaussian": lambda q: np.where(q < 3, np.exp(-(q**2)) / (math.pi * (1 - math.exp(-9))), 0.0),
}


def square_lattice(columns: int, rows: int, spacing: float = 0.1) -> np.ndarray:
    """Points of the x-z plane [m], shape [columns * rows, 3]; of an odd lattice the middle one is the origin."""
    x, z = np.meshgrid(np.arange(columns) - (columns - 1) / 2, np.arange(rows) - (rows - 1) / 2)
    return spacing * np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)


@pytest.fixture
def lattice() -> Callable[..., np.ndarray]:
    """A function of columns, rows and spacing [m] that gives a square lattice about the origin [m], shape [n, 3]."""
    return square_lattice


@pytest.fixture
def make_cloud(device) -> Callable[..., Cloud]:
    """A function that makes a `Cloud` on the device of the test."""
    return lambda x, **fields: Cloud(device, x, **fields)


@pytest.fixture
def mixture(make_cloud) -> Callable[..., Cloud]:
    """A function that makes a disordered cloud of both fluids, in tension here and in compression there."""

    def make(**fields) -> Cloud:
        random = np.random.default_rng(1)
        x = square_lattice(17, 17) + 0.02 * random.uniform(-1, 1, (289, 3)) * [1, 0, 1]
        fluid = (x[:, 0] + 0.5 * x[:, 2] > 0.0).astype(np.int32)
        given = {
            "u": random.normal(size=(289, 3)) * [1, 0, 1],
            "rho": REST_DENSITY[fluid] * random.uniform(0.98, 1.02, 289),
            "p": random.uniform(-2000.0, 4000.0, 289),
            "fluid": fluid,
        }
        return make_cloud(x, **(given | fields))

    return make


class Touching:
    """Bodies that gravity and contact move, step by step; `set` holds them, `step` is how long one takes [s]."""

    def __init__(
        self,
        device: str,
        bodies: Sequence[Body],
        walls: Sequence[ContactLegs] = (),
        wall_points: ContactPoints | None = None,
        *,
        dt: float = 1e-4,
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
        **options: float,
    ) -> None:
        """`options` are those of a `BodySet`."""
        launcher, self.gravity = Launcher(device, threads=1), np.array(gravity)
        self.set = BodySet(launcher, bodies, walls, wall_points, gravity=gravity, **options)
        self.time = wp.zeros(1, dtype=wp.float64, device=launcher.device)
        self.dt, self.step = wp.array([dt], dtype=float, device=launcher.device), float(np.float32(dt))
        self.stages = [
            self.set.drift(0.0, 0.5, self.time, self.dt),
            self.set.kick(self.time, self.dt),
            self.set.drift(0.5, 1.0, self.time, self.dt),
        ]

    @cached_property
    def ten_steps(self) -> Callable[[], None]:
        """A graph: launched one by one from Python, steps take three times as long."""
        return self.set.launcher.sequence(self.stages * 10)

    def __call__(self, seconds: float) -> "Touching":
        tens, steps = divmod(round(seconds / self.step), 10)
        for _ in range(tens):
            self.ten_steps()
        for stage in self.stages * steps:
            stage()
        return self

    def position(self, body: int = 1) -> np.ndarray:
        return self.set.position.numpy()[body].copy()

    def velocity(self, body: int = 1) -> np.ndarray:
        return self.set.velocity.numpy()[body].copy()

    def spin(self, body: int = 1) -> np.ndarray:
        return self.set.spin.numpy()[body].copy()

    def tilt(self, body: int = 1) -> float:
        """The angle through which a body in the plane has turned from z to x [rad]."""
        q = self.set.orientation.numpy()[body]
        return 2.0 * math.atan2(q[1], q[3])

    def corners(self, body: int = 1) -> np.ndarray:
        """Where the corners of a body's outline are, shape [n, 2]."""
        legs = self.set.bodies[body - 1].outline.legs
        return self._placed(np.insert([leg.points(np.zeros(1))[0] for leg in legs], 1, 0.0, axis=1), body)[:, [0, 2]]

    def mesh(self, body: int = 1) -> Mesh:
        """A body's mesh where it is."""
        drawn = self.set.bodies[body - 1].mesh
        return Mesh(self._placed(drawn.vertices, body), drawn.triangles)

    def _placed(self, drawn: np.ndarray, body: int) -> np.ndarray:
        R = rotation(self.set.orientation.numpy()[body])
        return (drawn - self.set.bodies[body - 1].mass.centre) @ R.T + self.position(body)

    def energy(self) -> float:
        """Kinetic and potential [J], in the plane [J/m]."""
        masses = np.array([0.0, *(body.mass.mass for body in self.set.bodies)])
        return self.set.kinetic_energy().sum() - masses @ self.set.position.numpy() @ self.gravity

    def momenta(self) -> np.ndarray:
        """Linear [kg m/s] and angular about the origin [kg m2/s], shape [6]."""
        total = np.zeros(6)
        for b, own in enumerate(self.set.bodies, 1):
            R = rotation(self.set.orientation.numpy()[b])
            p = own.mass.mass * self.velocity(b)
            total[:3] += p
            total[3:] += np.cross(self.position(b), p) + R @ own.mass.inertia @ R.T @ self.spin(b)
        return total


@pytest.fixture
def make_blocks() -> Callable[..., Blocks]:
    """A function of the number of items and the size of a block: runs of items, or interleaved as on a GPU."""

    def make(count: int, size: int, interleaved: bool = False) -> Blocks:
        blocks, number = Blocks(), -(-count // size)
        blocks.count, blocks.size = count, size
        blocks.apart, blocks.stride = (1, number) if interleaved else (size, 1)
        return blocks

    return make


@pytest.fixture
def touching(device) -> Callable[..., Touching]:
    """A function that makes bodies that are `Touching` on the device of the test."""
    return lambda bodies, *walls, **options: Touching(device, bodies, *walls, **options)
