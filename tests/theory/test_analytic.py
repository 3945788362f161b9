"""Analytic solutions: the tables that ship, the equations that they solve, what they conserve, and their limits."""

import csv
import math
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import numpy as np
import pytest

import warpsph.validation
from warpsph.theory.analytic import (
    HUPPERT_FRONT,
    arrested_depth,
    arrested_toe,
    bingham_poiseuille,
    couette,
    fit_solitary_wave,
    floating_draft,
    heave_in_tank,
    herschel_bulkley_free_surface,
    highest,
    huppert_depth,
    huppert_front,
    impulse_product,
    impulse_wave,
    logvinovich_force,
    periodic_shear,
    plug_thickness,
    poiseuille,
    poiseuille_free_surface,
    ritter,
    ritter_front,
    solitary_celerity,
    solitary_energy,
    solitary_wave,
    wagner_force,
    wagner_half_width,
)

# The tables have six digits. Relative to the largest value of what is compared.
TOLERANCE = 6e-6

DATA = Path(warpsph.validation.__file__).parent / "data"
SLIDE = {"depth": 0.6, "acceleration": 2.778, "density": 1000.0}  # the layer of Vasco (2014) 6.2.2
COLUMN = {"height": 0.1, "length": 0.5, "density": 1300.0}


def read_table(name: str) -> list[dict[str, str]]:
    with (DATA / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def columns(name: str) -> dict[str, np.ndarray]:
    rows = read_table(name)
    return {heading: np.array([float(row[heading]) for row in rows]) for heading in rows[0]}


def assert_close(found: np.ndarray, expected: np.ndarray, tolerance: float = TOLERANCE) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


def integral(values: np.ndarray, x: np.ndarray) -> float:
    """By the trapezoidal rule."""
    return float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(x)))


# ------------------------------------------------------------------------------------------------- viscous, transient

TRANSIENT = {
    "poiseuille_free_surface_transient": lambda z, t: poiseuille_free_surface(
        z, t, depth=0.6, acceleration=9.81 * math.sin(math.radians(16.45)), viscosity=1.0
    ),
    "poiseuille_plane_transient": lambda z, t: poiseuille(z, t, height=0.6, acceleration=2.78, viscosity=1.0),
    "couette_transient": lambda z, t: couette(z, t, height=0.6, speed=0.1, viscosity=1.0),
}
SOURCE = {"poiseuille_free_surface_transient": 2.778, "poiseuille_plane_transient": 2.78, "couette_transient": 0.0}

every_transient = pytest.mark.parametrize("name", TRANSIENT)


@every_transient
def test_transient_tables(name):
    table = columns(name)
    z = table.pop("y")
    for heading, u in table.items():
        t = math.inf if heading == "steady" else float(heading.removeprefix("t="))
        # The slope of the first table is given to four digits.
        assert_close(TRANSIENT[name](z, t), u, 2e-5 if name.startswith("poiseuille_free") else TOLERANCE)


@every_transient
@pytest.mark.parametrize("t", [0.003, 0.03, 0.3])
def test_transient_solutions_solve_navier_stokes(name, t):
    """du/dt = nu d2u/dz2 + G, by differences."""
    z, dz, dt = np.linspace(0.02, 0.58, 57), 1e-3, 1e-5
    u = TRANSIENT[name]
    rate = (u(z, t + dt) - u(z, t - dt)) / (2 * dt)
    curvature = (u(z + dz, t) - 2 * u(z, t) + u(z - dz, t)) / dz**2
    scale = np.abs(rate).max() + np.abs(curvature).max()
    np.testing.assert_allclose(rate, curvature + SOURCE[name], rtol=0, atol=2e-3 * scale)


def test_layer_begins_as_a_free_fall():
    """u = G t far from the bed, and nothing shears at the surface."""
    u = poiseuille_free_surface(np.array([0.0, 0.599, 0.6]), 1e-3, depth=0.6, acceleration=2.778, viscosity=1.0)
    assert u == pytest.approx([0.0, 2.778e-3, 2.778e-3], rel=TOLERANCE, abs=1e-12)
    u = poiseuille_free_surface(np.linspace(0.0, 0.6, 9), 0.0, depth=0.6, acceleration=2.778, viscosity=1.0)
    np.testing.assert_allclose(u, 0.0, atol=1e-7)


def test_couette_begins_as_stokes_first_problem():
    """V erfc((H - z) / (2 sqrt(nu t))) while the other plate is far away; at t = 0 only the plate moves."""
    z = np.linspace(0.0, 0.6, 601)
    for t in (1e-5, 1e-3):
        expected = [0.1 * math.erfc((0.6 - height) / (2 * math.sqrt(t))) for height in z]
        assert_close(couette(z, t, height=0.6, speed=0.1, viscosity=1.0), np.array(expected))
    np.testing.assert_array_equal(couette([0.0, 0.3, 0.6], 0.0, height=0.6, speed=0.1, viscosity=1.0), [0.0, 0.0, 0.1])


def test_periodic_shear_table():
    table = columns("periodic_shear_decay")
    numbers = {"speed": 1.0, "wavelength": 0.6, "viscosity": 1e-3}
    found = [float(periodic_shear(0.15, t, **numbers)) for t in table["t"]]
    assert_close(np.array(found), table["amplitude"])
    np.testing.assert_allclose(periodic_shear([0.0, 0.3, 0.6], 1.0, **numbers), 0.0, atol=1e-12)


# ----------------------------------------------------------------------------------------------- viscoplastic, steady


@pytest.mark.parametrize(
    ("fluid", "rows"),
    [
        (key, list(rows))
        for key, rows in groupby(read_table("herschel_bulkley_free_surface_steady"), itemgetter("tau_c", "K", "N"))
    ],
    ids=lambda value: "-".join(value) if isinstance(value, tuple) else "",
)
def test_herschel_bulkley_table(fluid, rows):
    tau_y, K, N = map(float, fluid)
    z, u = (np.array([float(row[name]) for row in rows]) for name in ("y", "u"))
    assert_close(herschel_bulkley_free_surface(z, **SLIDE, consistency=K, exponent=N, yield_stress=tau_y), u)


@pytest.mark.parametrize("exponent", [0.4, 1.0, 1.6])
def test_stress_of_the_profile_carries_the_weight(exponent):
    """tau_y + K (du/dz)^N = rho G (d - z) where it flows; above, a plug as thick as it should be."""
    numbers = {"consistency": 300.0, "exponent": exponent, "yield_stress": 500.0}
    z = np.linspace(0.0, 0.6, 6001)
    u = herschel_bulkley_free_surface(z, **SLIDE, **numbers)
    plug = plug_thickness(**SLIDE, yield_stress=500.0)
    assert plug == pytest.approx(500.0 / 2778.0)
    slope, middle = np.diff(u) / np.diff(z), 0.5 * (z[1:] + z[:-1])
    flows = middle < 0.6 - plug - 0.01
    stress = 500.0 + 300.0 * slope[flows] ** exponent
    np.testing.assert_allclose(stress, 2778.0 * (0.6 - middle[flows]), rtol=1e-4)
    assert np.ptp(u[z > 0.6 - plug]) == 0.0


def test_no_yield_stress_and_exponent_one_is_newtonian():
    z = np.linspace(0.0, 0.6, 13)
    found = herschel_bulkley_free_surface(z, **SLIDE, consistency=1000.0, exponent=1.0, yield_stress=0.0)
    expected = poiseuille_free_surface(z, math.inf, depth=0.6, acceleration=2.778, viscosity=1.0)
    assert_close(found, expected)


def test_too_strong_to_flow():
    numbers = {"consistency": 1000.0, "exponent": 0.5, "yield_stress": 1667.0}
    assert not herschel_bulkley_free_surface(np.linspace(0, 0.6, 7), **SLIDE, **numbers).any()
    assert plug_thickness(**SLIDE, yield_stress=5000.0) == 0.6


def test_bingham_between_plates():
    """The flux of Buckingham (1921) between plates, G rho H^3 / (12 mu) (1 - 3/2 s + s^3 / 2), s = tau_y / tau_wall."""
    numbers = {"height": 0.6, "acceleration": 2.78, "density": 1000.0, "viscosity": 1000.0}
    z = np.linspace(0.0, 0.6, 6001)
    for tau_y in (0.0, 100.0, 400.0):
        u = bingham_poiseuille(z, **numbers, yield_stress=tau_y)
        s = tau_y / (2780.0 * 0.3)
        flux = 2780.0 * 0.6**3 / 12e3 * (1 - 1.5 * s + 0.5 * s**3)
        assert integral(u, z) == pytest.approx(flux, rel=1e-6)
        assert_close(u, u[::-1])
    assert_close(
        bingham_poiseuille(z, **numbers, yield_stress=0.0),
        poiseuille(z, math.inf, height=0.6, acceleration=2.78, viscosity=1.0),
    )


# --------------------------------------------------------------------------------------------------------- dam breaks


def test_ritter_table():
    table = columns("ritter_1892")
    c = math.sqrt(9.81 * 0.3)
    h, u = ritter(table["xi"] * c * 0.2, 0.2, height=0.3)
    assert_close(h / 0.3, table["h_over_H0"])
    assert_close(u / c, table["u_over_c0"])


def test_ritter_conserves_and_has_ends():
    x = np.linspace(-5.0, 10.0, 150001)
    h, u = ritter(x, 0.5, height=1.0)
    # What stood behind the gate, nothing added, nothing lost; and its momentum is the thrust of the reservoir.
    assert integral(h, x) == pytest.approx(5.0, rel=1e-6)
    assert integral(h * u, x) == pytest.approx(0.5 * 9.81 * 0.5, rel=1e-6)
    assert h[0] == 1.0 and u[0] == 0.0 and h[-1] == 0.0 and u[-1] == 0.0


def test_fronts_table():
    for row in read_table("newtonian_dambreak_bounds"):
        height, nu, t = (float(row[name]) for name in ("H0_m", "nu_m2_s", "t_s"))
        inertial = ritter_front(t, height=height, length=0.5)
        viscous = huppert_front(t, area=0.5 * height, viscosity=nu)
        assert inertial == pytest.approx(float(row["x_ritter"]), abs=6e-5)
        assert viscous == pytest.approx(float(row["x_huppert"]), rel=1.5e-4)  # nu is rounded there


def test_huppert_keeps_its_area():
    assert pytest.approx(1.411, abs=5e-4) == HUPPERT_FRONT
    for t in (1.0, 100.0):
        front = float(huppert_front(t, area=0.05, viscosity=7e-4))
        # Dense towards the front, which is blunt.
        x = front * np.sin(np.linspace(0.0, 0.5 * math.pi, 20001))
        assert integral(huppert_depth(x, t, area=0.05, viscosity=7e-4), x) == pytest.approx(0.05, rel=1e-5)


def test_huppert_solves_the_thin_film_equation():
    """dh/dt = g / (3 nu) d/dx (h^3 dh/dx), by differences, away from the front."""
    nu, t, dt, dx = 7e-4, 5.0, 1e-3, 1e-3
    x = np.linspace(0.1, 0.8, 50) * float(huppert_front(t, area=0.05, viscosity=nu))

    def h(x, t):
        return huppert_depth(x, t, area=0.05, viscosity=nu)

    def flux(x):
        return -9.81 / (3 * nu) * h(x, t) ** 3 * (h(x + dx / 2, t) - h(x - dx / 2, t)) / dx

    rate = (h(x, t + dt) - h(x, t - dt)) / (2 * dt)
    np.testing.assert_allclose(rate, -(flux(x + dx / 2) - flux(x - dx / 2)) / dx, rtol=0, atol=1e-4 * abs(rate).max())


@pytest.mark.parametrize("yield_stress", [5.0, 20.0, 200.0])
def test_arrested_slump_keeps_its_area(yield_stress):
    toe = arrested_toe(**COLUMN, yield_stress=yield_stress)
    x = toe * np.sin(np.linspace(0.0, 0.5 * math.pi, 20001))
    h = arrested_depth(x, **COLUMN, yield_stress=yield_stress)
    assert integral(h, x) == pytest.approx(0.05, rel=1e-5)
    assert h[-1] == 0.0 and h.max() <= 0.1
    assert toe > 0.5


@pytest.mark.parametrize("yield_stress", [5.0, 200.0])
def test_arrested_slump_leans_on_its_yield_stress(yield_stress):
    """rho g h dh/dx = -tau_y where it has slumped."""
    toe = arrested_toe(**COLUMN, yield_stress=yield_stress)
    x = np.linspace(toe - 0.1, toe - 0.02, 20)
    half_square = [
        0.5 * 1300.0 * 9.81 * arrested_depth(x + dx, **COLUMN, yield_stress=yield_stress) ** 2 for dx in (-1e-4, 1e-4)
    ]
    np.testing.assert_allclose((half_square[1] - half_square[0]) / 2e-4, -yield_stress, rtol=1e-6)


def test_arrested_slump_that_leaves_its_back():
    """tau_y L / (rho g H^2) = 1/3 parts the two; there both give x_f = 3/2 L, as high at the wall as the column was."""
    parting = 1300.0 * 9.81 * 0.1**2 / (3 * 0.5)
    for share in (1 - 1e-9, 1 + 1e-9):
        assert arrested_toe(**COLUMN, yield_stress=share * parting) == pytest.approx(0.75, rel=1e-6)
    assert arrested_depth(0.0, **COLUMN, yield_stress=0.9 * parting) < 0.1
    assert arrested_depth(0.01, **COLUMN, yield_stress=1.1 * parting) == 0.1
    assert arrested_toe(**COLUMN, yield_stress=1e6) == pytest.approx(0.5, abs=1e-4)


# ------------------------------------------------------------------------------------------------------ solitary wave


def test_solitary_wave_volume_and_celerity():
    """The volume is sqrt(16/3 a d^3); a low wave travels at sqrt(g d)."""
    s = np.linspace(-20.0, 20.0, 40001)
    elevation = solitary_wave(s, depth=0.3, amplitude=0.06)
    assert elevation.max() == 0.06
    assert integral(elevation, s) == pytest.approx(math.sqrt(16 / 3 * 0.06 * 0.3**3), rel=1e-9)
    assert solitary_celerity(depth=0.3, amplitude=1e-9) == pytest.approx(math.sqrt(9.81 * 0.3))


def test_solitary_wave_has_as_much_energy_as_its_shape_says():
    """Potential energy is that of the elevation, and the long waves of theory have as much kinetic energy."""
    s = np.linspace(-10.0, 10.0, 200_001)
    elevation = solitary_wave(s, depth=0.3, amplitude=0.06)
    potential = 0.5 * 1000.0 * 9.81 * np.trapezoid(elevation**2, s)
    assert solitary_energy(depth=0.3, amplitude=0.06, density=1000.0) == pytest.approx(2.0 * potential, rel=TOLERANCE)


# ------------------------------------------------------------------------------------------------------ impulse wave


def test_impulse_product_of_the_slide_at_lake_askja():
    """Evers et al. (2019) 4.2.1: F = 0.82, S = 0.26, M = 1.91 on 10.4 degrees make P = 0.49, as printed."""
    slide = {"thickness": 0.26 * 138.0, "mass": 1.91 * 1000.0 * 138.0**2, "slope": 10.4}
    product = impulse_product(froude=0.82, depth=138.0, density=1000.0, **slide)
    assert product == pytest.approx(0.49, abs=0.005)


def test_impulse_wave_decays_along_a_channel():
    """By X^(-4/15) (Evers et al. 2019, 5.2.2), and in proportion to the depth; a = 3/5 d where P = X = 1."""
    assert impulse_wave(1.0, depth=2.0, distance=2.0) == pytest.approx(1.2, rel=TOLERANCE)
    near, far = (impulse_wave(0.7, depth=100.0, distance=x) for x in (500.0, 2000.0))
    assert far / near == pytest.approx(4.0 ** (-4.0 / 15.0), rel=TOLERANCE)


@pytest.mark.parametrize("gravity", [None, 9.81])
def test_fit_finds_the_wave(gravity):
    """In a picture and in a gauge's record, also where it is rough; the samples do not hold the crest itself."""
    at = np.linspace(0.0, 8.0, 161)
    speed = 1.0 if gravity is None else -solitary_celerity(depth=0.3, amplitude=0.06)
    elevation = solitary_wave(speed * (at - 3.517), depth=0.3, amplitude=0.06)
    fit = fit_solitary_wave(at, elevation, depth=0.3, gravity=gravity)
    assert (fit.amplitude, fit.crest, fit.r2) == pytest.approx((0.06, 3.517, 1.0), rel=1e-6)
    rough = elevation + 0.002 * np.random.default_rng(1).normal(size=161)
    fit = fit_solitary_wave(at, rough, depth=0.3, gravity=gravity)
    assert (fit.amplitude, fit.crest) == pytest.approx((0.06, 3.517), rel=0.03)
    assert 0.9 < fit.r2 < 0.999


def test_fit_knows_another_wave():
    """One as high but half or twice as wide is no solitary wave of its depth."""
    x = np.linspace(-4.0, 4.0, 401)
    for width in (0.5, 2.0):
        assert fit_solitary_wave(x, solitary_wave(x / width, depth=0.3, amplitude=0.06), depth=0.3).r2 < 0.98


def test_nothing_to_fit():
    with pytest.raises(ValueError, match="no wave above still water"):
        fit_solitary_wave([0.0, 1.0, 2.0], [0.0, -0.1, 0.0], depth=0.3)


# ------------------------------------------------------------------------------------------------------------- bodies


def test_wagner_force_is_the_rate_of_momentum():
    """F = d/dt (pi / 2 rho c^2 V), and its known form pi^3 / 4 rho V^3 t / tan^2."""
    wedge = {"speed": 2.0, "deadrise": math.radians(10.0)}
    t, dt = 0.05, 1e-6
    momentum = [0.5 * math.pi * 1000.0 * wagner_half_width(t + d, **wedge) ** 2 * 2.0 for d in (-dt, dt)]
    force = float(wagner_force(t, **wedge, density=1000.0))
    assert force == pytest.approx((momentum[1] - momentum[0]) / (2 * dt), rel=1e-6)
    assert force == pytest.approx(math.pi**3 / 4 * 1000.0 * 8.0 * t / math.tan(wedge["deadrise"]) ** 2)
    assert wagner_force(0.0, **wedge, density=1000.0) == 0.0


@pytest.mark.parametrize(
    ("degrees", "coefficient", "bar"),
    [(10.0, 213.980, 0.025), (15.0, 85.522, 0.015), (20.0, 42.485, 0.015), (25.0, 23.657, 0.04), (30.0, 14.139, 0.07)],
)
def test_logvinovich_is_near_the_similarity_solution(degrees, coefficient, bar):
    """F / (rho V^3 t) of Zhao & Faltinsen (1993) table 1, and the integral of the pressure where it is above 0."""
    wedge = {"speed": 3.0, "deadrise": math.radians(degrees)}
    force = float(logvinovich_force(0.02, **wedge, density=1000.0))
    assert force / (1000.0 * 27.0 * 0.02) == pytest.approx(coefficient, rel=bar)
    assert force < wagner_force(0.02, **wedge, density=1000.0)
    tan, cos, sin = (f(wedge["deadrise"]) for f in (math.tan, math.cos, math.sin))
    f = np.linspace(0.0, 0.5 * math.pi, 200_001)[:-1]  # s = sin(f)
    pressure = 4500.0 * (math.pi / tan / np.cos(f) - cos**2 / np.cos(f) ** 2 - sin**2)
    there = np.clip(pressure, 0.0, None) * np.cos(f)
    assert force == pytest.approx(2.0 * float(wagner_half_width(0.02, **wedge)) * np.trapezoid(there, f), rel=1e-4)


@pytest.mark.parametrize(("draft", "coefficient"), [(0.5, 1.36), (1.0, 4.754 / math.pi), (2.0, 1.70)])
def test_added_mass_of_a_rectangle(draft, coefficient):
    """Of pi rho (beam / 2)^2 in water without end, DNV-RP-C205 (2010) table D-1 and Newman (1977) table 4.3 for the
    square; half of a rectangle floats, and heaves with half of it at high frequency. The tank is 20 by 12 beams."""
    found = heave_in_tank(width=40.0, depth=24.0, beam=2.0, draft=draft, density=1000.0, dimensions=2).added_mass
    assert found / (0.5 * math.pi * 1000.0) == pytest.approx(coefficient, rel=0.02)


def test_draft_displaces_its_own_mass():
    assert floating_draft(mass=30.0, waterplane=0.3, density=1000.0) == pytest.approx(0.1)


def test_added_mass_in_a_wide_tank_is_that_of_a_cube():
    """DNV-RP-C205 (2010), appendix D: 0.68 rho a^3 for a cube in water without end, half of which heaves with half of
    it at high frequency. In a tank of 4 by 2 beams; walls and a bottom that come closer make it more."""
    wide, narrow, shallow = (
        heave_in_tank(width=width, depth=depth, beam=1.0, draft=0.5, density=1.0).added_mass
        for width, depth in ((4.0, 2.0), (2.0, 2.0), (4.0, 1.0))
    )
    assert wide == pytest.approx(0.34, rel=0.02)
    assert narrow > 1.02 * wide and shallow > 1.02 * wide


def test_added_mass_of_a_shallow_box_in_a_closing_gap():
    """The water below must pass the gap: an added mass of rho A^2 d / (A_tank - A) of it at least."""
    added = heave_in_tank(width=1.25, depth=1.0, beam=1.0, draft=0.5, density=1.0).added_mass
    assert added > 0.5 / (1.25**2 - 1.0)
    with pytest.raises(ValueError, match="no cubes fit"):
        heave_in_tank(width=0.48, depth=0.24, beam=0.24, draft=0.0801, density=1000.0)


def test_heave_of_a_deep_box_hardly_makes_waves():
    """Then it is a mass on the spring rho g A, which the level that falls as the box rises makes stiffer."""
    sizes = {"width": 0.8, "depth": 0.36, "beam": 0.24, "draft": 0.16}
    found = heave_in_tank(**sizes, density=1000.0)
    area = 0.24**2
    mass, spring = 1000.0 * area * 0.16 + found.added_mass, 9810.0 * area / (1.0 - area / 0.8**2)
    assert found.period == pytest.approx(2.0 * math.pi * math.sqrt(mass / spring), rel=5e-3)
    assert found.first == pytest.approx(0.5 * found.period, rel=5e-3)
    slow = heave_in_tank(**sizes, density=1000.0, gravity=9.81 / 4.0)
    assert slow.period == pytest.approx(2.0 * found.period) and slow.added_mass == pytest.approx(found.added_mass)


def test_a_shallow_box_makes_waves():
    """Froude's similarity; the waves that come back leave no such half of a period."""
    sizes = {"width": 2.0, "depth": 0.4, "beam": 0.3, "draft": 0.1}
    found = heave_in_tank(**sizes, density=1000.0, dimensions=2)
    twice = heave_in_tank(**{name: 2.0 * size for name, size in sizes.items()}, density=1000.0, dimensions=2)
    assert twice.period == pytest.approx(math.sqrt(2.0) * found.period)
    assert twice.added_mass == pytest.approx(4.0 * found.added_mass)
    assert abs(found.first / (0.5 * found.period) - 1.0) > 0.05


def test_highest_places_of_an_oscillation_that_dies_away():
    """Those of exp(-b t) cos(w t + p) are a period apart, whatever it swings about."""
    t = np.arange(0.0, 5.0, 0.01)
    decay, rate = 0.5, 2.0 * math.pi / 1.3
    found = highest(t, 0.3 - np.exp(-decay * t) * np.cos(rate * t), 1.2)
    first = (math.pi - math.atan(decay / rate)) / rate
    assert found == pytest.approx(first + 1.3 * np.arange(4), abs=2e-3)
