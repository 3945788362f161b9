"""Every kernel compiles for CUDA, on a machine that need not have a GPU."""

import importlib
import pkgutil
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from zlib import crc32

import pytest
import warp as wp

import warpsph.kernels
from warpsph.kernels.artificial_viscosity import ARTIFICIAL_VISCOSITY
from warpsph.kernels.balance import balance_kernel
from warpsph.kernels.corrections import CORRECTION, density_filter_kernel
from warpsph.kernels.density import DENSITY_DIFFUSION, pressure_gradient_kernel
from warpsph.kernels.dummies import (
    carry_velocity_kernel,
    list_dummies_kernel,
    load_dummies_kernel,
    press_dummies_kernel,
)
from warpsph.kernels.gauges import volume_fraction_kernel
from warpsph.kernels.images import list_ghosts_kernel
from warpsph.kernels.instruments import probe_kernel
from warpsph.kernels.layout import CPU_LAYOUT, CUDA_LAYOUT
from warpsph.kernels.loads import body_points_kernel, reaction_kernel
from warpsph.kernels.mueller import forces_kernel, summed_density_kernel
from warpsph.kernels.neighbours import (
    copy_kernel,
    gather_kernel,
    list_kernel,
    scatter_kernel,
    wall_points_kernel,
)
from warpsph.kernels.packing import pack_kernel
from warpsph.kernels.rates import Formulas, rates_kernel
from warpsph.kernels.rheology import REGULARISATION, RHEOLOGY, apparent_viscosity_kernel
from warpsph.kernels.shifting import cover_kernel, shifting_kernel
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.kernels.stress import (
    stress_acceleration_kernel,
    transposed_stress_kernel,
    velocity_gradient_kernel,
    yielding_kernel,
)
from warpsph.kernels.viscosity import MEAN, VISCOSITY, viscous_acceleration_kernel
from warpsph.kernels.walls import WALL_FORCE, wall_acceleration_kernel

ARCHITECTURES = (80, 90)  # A100 and H100
MODULES = [
    importlib.import_module(f"warpsph.kernels.{found.name}") for found in pkgutil.iter_modules(warpsph.kernels.__path__)
]
# Functions and structs are compiled with the kernels that use them.
WITH_KERNELS = [module.__name__ for module in MODULES if wp.get_module(module.__name__).kernels]

HALVES = [(True, True), (True, False), (False, True)]
# Each formula once in full; what is left out costs no term.
FORMULAS = [
    *(Formulas(smoothing=name, xsph=True, tensile_correction=True) for name in SMOOTHING),
    *(Formulas(artificial_viscosity=name, fluid_count=1, dimensions=2) for name in ARTIFICIAL_VISCOSITY),
    *(Formulas(diffusion=name) for name in DENSITY_DIFFUSION),
    *(Formulas(walled=True, diffusion="fourtakas", fluid_count=1, dimensions=dimensions) for dimensions in (2, 3)),
    *(Formulas(renormalised=True, dimensions=dimensions) for dimensions in (2, 3)),
    *(Formulas(neighbours="cells", fluid_count=count, dimensions=count) for count in (2, 3)),
]
# Each factory with all that it can be asked for.
STATE_TYPES = [(dtype,) for dtype in (int, float, wp.float64, wp.vec3, wp.vec3d)]
FACTORIES: dict[Callable[..., wp.Kernel], list[tuple]] = {
    rates_kernel: [(formulas, CUDA_LAYOUT, *half) for formulas in FORMULAS for half in HALVES],
    list_kernel: [(CUDA_LAYOUT,), (CPU_LAYOUT,)],
    list_ghosts_kernel: [(CUDA_LAYOUT,), (CPU_LAYOUT,)],
    list_dummies_kernel: [(CUDA_LAYOUT,), (CPU_LAYOUT,)],
    press_dummies_kernel: [(name, dimensions, CUDA_LAYOUT) for name in SMOOTHING for dimensions in (2, 3)],
    carry_velocity_kernel: [(name,) for name in SMOOTHING],
    load_dummies_kernel: list(product(SMOOTHING, ARTIFICIAL_VISCOSITY)),
    pack_kernel: [(name,) for name in SMOOTHING],
    pressure_gradient_kernel: [(name, CUDA_LAYOUT) for name in SMOOTHING],
    wall_acceleration_kernel: [*product(WALL_FORCE, SMOOTHING), *((name, "wendland_c2", True) for name in WALL_FORCE)],
    body_points_kernel: [(True,), (False,)],
    reaction_kernel: list(product(WALL_FORCE, SMOOTHING)),
    cover_kernel: [(formulas, CUDA_LAYOUT) for formulas in FORMULAS],
    shifting_kernel: [(formulas, CUDA_LAYOUT) for formulas in FORMULAS],
    volume_fraction_kernel: [(name,) for name in SMOOTHING],
    probe_kernel: [(name,) for name in SMOOTHING],
    density_filter_kernel: [
        *((name, correction, True, CUDA_LAYOUT) for name, correction in product(SMOOTHING, ("shepard", "mls"))),
        *((name, correction, False, CUDA_LAYOUT) for name, correction in product(SMOOTHING, CORRECTION)),
    ],
    balance_kernel: [
        *((name, 2, CUDA_LAYOUT) for name in SMOOTHING),
        *(("wendland_c2", dimensions, CUDA_LAYOUT, True) for dimensions in (2, 3)),
    ],
    velocity_gradient_kernel: [
        *((name, 2, CUDA_LAYOUT) for name in SMOOTHING),
        ("wendland_c2", 3, CUDA_LAYOUT, False, True),
        *(("wendland_c2", dimensions, CUDA_LAYOUT, True) for dimensions in (2, 3)),
    ],
    viscous_acceleration_kernel: [
        *((*choice, 2, CUDA_LAYOUT) for choice in product(SMOOTHING, VISCOSITY, MEAN)),
        *(("wendland_c2", *choice, CUDA_LAYOUT, True) for choice in product(VISCOSITY, MEAN, (2, 3))),
        ("wendland_c2", "morris", "harmonic", 3, CUDA_LAYOUT, False, False, True),
        *(("wendland_c2", "morris", "harmonic", dimensions, CUDA_LAYOUT, True, True) for dimensions in (2, 3)),
    ],
    stress_acceleration_kernel: [
        *((*choice, 2, CUDA_LAYOUT) for choice in product(SMOOTHING, MEAN)),
        *(("wendland_c2", "harmonic", dimensions, CUDA_LAYOUT, True) for dimensions in (2, 3)),
        *(("wendland_c2", "harmonic", dimensions, CUDA_LAYOUT, True, True) for dimensions in (2, 3)),
        ("wendland_c2", "harmonic", 3, CUDA_LAYOUT, False, False, True),
    ],
    transposed_stress_kernel: [(2,), (3,)],
    yielding_kernel: [
        *((*choice, 2, CUDA_LAYOUT) for choice in product(SMOOTHING, MEAN)),
        *(("wendland_c2", "harmonic", dimensions, CUDA_LAYOUT, True) for dimensions in (2, 3)),
        ("wendland_c2", "harmonic", 3, CUDA_LAYOUT, False, True),
    ],
    apparent_viscosity_kernel: list(product(RHEOLOGY, REGULARISATION)),
    summed_density_kernel: [(CUDA_LAYOUT,)],
    forces_kernel: [(CUDA_LAYOUT,)],
    copy_kernel: STATE_TYPES,
    wall_points_kernel: [(False,), (True,)],
    gather_kernel: STATE_TYPES,
    scatter_kernel: STATE_TYPES,
}

pytestmark = pytest.mark.skipif(sys.platform == "darwin", reason="Warp for macOS comes without a CUDA compiler")


def factories() -> Iterator[Callable[..., wp.Kernel]]:
    """Every function of the package that makes kernels."""
    for module in MODULES:
        yield from (value for key, value in vars(module).items() if key.endswith("_kernel"))


def compiled(module: object, folder) -> dict[int, str]:
    """The PTX of a module for each architecture."""
    paths = wp.compile_aot_module(module, arch=list(ARCHITECTURES), use_ptx=True, module_dir=folder)
    return {arch: path.read_text() for arch, path in zip(ARCHITECTURES, paths, strict=True)}


def assert_holds(ptx: dict[int, str], kernel: wp.Kernel) -> None:
    for arch, text in ptx.items():
        assert f".target sm_{arch}" in text
        assert any(".entry" in line and kernel.get_mangled_name() in line for line in text.splitlines()), kernel.key


@pytest.fixture(scope="module")
def ptx_of(tmp_path_factory) -> Callable[[Callable[..., wp.Kernel], wp.Kernel], dict[int, str]]:
    """A function that gives the PTX of a kernel of a factory, among others of that factory: those with the same options
    are compiled at once, for most of the time goes into what is the same for all of them, Warp's own headers."""

    @cache
    def together(factory: Callable[..., wp.Kernel], options: str) -> dict[int, str]:
        kernels = [
            kernel for kernel in (factory(*c) for c in FACTORIES[factory]) if str(kernel.module.options) == options
        ]
        module = wp.get_module(f"{factory.__name__}_{crc32(options.encode()):08x}")
        module.options.update(kernels[0].module.options)
        # A module forgets kernels that nobody holds.
        held = [wp.Kernel(one.func, key=one.key, module=module, options=one.options) for one in kernels]
        assert len(held) == len(kernels)
        return compiled(module, tmp_path_factory.mktemp(factory.__name__))

    return lambda factory, kernel: together(factory, str(kernel.module.options))


def test_every_factory_is_known():
    assert set(factories()) == set(FACTORIES)


@pytest.mark.parametrize("name", WITH_KERNELS)
def test_kernels_of_a_module(tmp_path, name):
    ptx = compiled(name, tmp_path)
    for kernel in wp.get_module(name).kernels.values():
        assert_holds(ptx, kernel)


@pytest.mark.parametrize(
    ("factory", "formulas"),
    [(factory, choice) for factory, choices in FACTORIES.items() for choice in choices],
    ids=lambda value: "-".join(map(str, value)) if isinstance(value, tuple) else value.__name__,
)
def test_kernels_of_a_factory(ptx_of, factory, formulas):
    kernel = factory(*formulas)
    assert_holds(ptx_of(factory, kernel), kernel)


# What a neighbour is read by: (x, y, z, V) and (u, v, w, p), 16 bytes each.
NEIGHBOUR_LOADS = 2
# More registers than this, and fewer than half of the threads that an H100 has room for can be there at once.
MOST_REGISTERS = 64


# The halves of the dam break between dummy particles, and what gives these their pressure.
PAIR_LOOPS = list(product(("forces", "continuity", "dummies"), (2, 3)))


@pytest.fixture(scope="module")
def pair_loop_ptx(tmp_path_factory) -> Callable[[str, int], str]:
    """A function that gives the PTX of one pair loop alone."""

    @cache
    def ptx(what: str, dimensions: int) -> str:
        formulas = Formulas(
            diffusion="fourtakas", tensile_correction="bounded", fluid_count=1, dimensions=dimensions, walled=True
        )
        if what == "dummies":
            kernel = press_dummies_kernel(formulas.smoothing, dimensions, CUDA_LAYOUT)
        else:
            kernel = rates_kernel(formulas, CUDA_LAYOUT, what == "forces", what == "continuity")
        return compiled(kernel.module, tmp_path_factory.mktemp("pair_loop"))[90].rstrip("\0")

    return ptx


@pytest.mark.parametrize(("what", "dimensions"), PAIR_LOOPS)
def test_a_neighbour_is_two_loads_of_16_bytes(pair_loop_ptx, what, dimensions):
    """Once for the particle itself, and once or, where the loop is unrolled, several times for a neighbour."""
    lines = pair_loop_ptx(what, dimensions).splitlines()
    vectors = sum("ld.global.nc.v4.f32" in line for line in lines)
    itself = 0 if what == "dummies" else 1
    assert vectors >= (itself + 1) * NEIGHBOUR_LOADS and vectors % NEIGHBOUR_LOADS == 0
    # Numbers of the fluid and of its walls, before the loop; of a dummy, and of each neighbour's fluid.
    assert sum("ld.global.f32" in line for line in lines) <= (24 if what == "dummies" else 9)


@pytest.mark.skipif(shutil.which("ptxas") is None, reason="there is no ptxas on the path")
@pytest.mark.parametrize(("what", "dimensions"), PAIR_LOOPS)
def test_registers_leave_room_for_half_of_the_threads(tmp_path, pair_loop_ptx, what, dimensions):
    path = tmp_path / "pair_loop.ptx"
    # An older ptxas knows all that is in it, but not its version: CUDA 13.0 has PTX 9.0.
    release = subprocess.run(["ptxas", "--version"], capture_output=True, text=True, check=True).stdout
    major, minor = map(int, re.search(r"release (\d+)\.(\d+)", release).groups())
    ptx = pair_loop_ptx(what, dimensions)
    path.write_text(re.sub(r"\.version \d+\.\d+", f".version {major - 4}.{minor}", ptx))
    command = ["ptxas", "-arch=sm_90", "-v", str(path), "-o", str(tmp_path / "cubin")]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    assert int(re.search(r"Used (\d+) registers", said)[1]) <= MOST_REGISTERS
    assert "0 bytes spill stores, 0 bytes spill loads" in said
