"""Verlet's two halves against eq 76-80, the two stages of the others, limits of the step, absurdity."""

import math

import numpy as np
import pytest
import warp as wp

from warpsph.kernels import clock as clock_kernels
from warpsph.kernels import integrators

# Velocities, accelerations and steps are in single precision.
TOLERANCE = 1e-6

SPACING, RATIO = 0.1, 1.5
H = RATIO * SPACING
SOUND_SPEED = 20.0  # of the first fluid of a cloud [m/s]
BOX = {"lower": wp.vec3(-50.0, -1.0, -50.0), "upper": wp.vec3(50.0, 1.0, math.inf)}
SAFE = {
    "dimensions": 3,
    "courant": 0.5,
    "least_compression": 0.5,
    "most_compression": 2.0,
    "gravity": wp.vec3(),
    "alpha": [0.0, 0.0],
}

DRIFT = {
    "velocity": wp.vec3,
    "xsph_velocity": wp.vec3,
    "acceleration": wp.vec3,
    "density_rate": float,
    "last_diffusion_rate": float,
    "fluid": int,
    "position": wp.vec3d,
    "density": wp.float64,
    "position_volume": wp.vec4,
    "velocity_pressure": wp.vec4,
}
KICK = {
    "pressure_acceleration": wp.vec3,
    "dissipative_acceleration": wp.vec3,
    "wall_acceleration": wp.vec3,
    "wall_distance": float,
    "xsph_velocity": wp.vec3,
    "density_rate": float,
    "diffusion_rate": float,
    "fluid": int,
    "position": wp.vec3d,
    "velocity": wp.vec3,
    "density": wp.float64,
    "last_diffusion_rate": float,
    "position_volume": wp.vec4,
    "velocity_pressure": wp.vec4,
    "acceleration": wp.vec3,
    "work": wp.vec3,
    "dt_limit": float,
    "fault": int,
}
PREDICT = {
    "pressure_acceleration": wp.vec3,
    "dissipative_acceleration": wp.vec3,
    "wall_acceleration": wp.vec3,
    "xsph_velocity": wp.vec3,
    "density_rate": float,
    "diffusion_rate": float,
    "fluid": int,
    "velocity": wp.vec3,
    "position": wp.vec3d,
    "density": wp.float64,
    "position_volume": wp.vec4,
    "velocity_pressure": wp.vec4,
    "acceleration": wp.vec3,
    "work": wp.vec3,
    "first_dissipative": wp.vec3,
    "first_wall": wp.vec3,
}
CORRECT = {
    "pressure_acceleration": wp.vec3,
    "dissipative_acceleration": wp.vec3,
    "wall_acceleration": wp.vec3,
    "wall_distance": float,
    "xsph_velocity": wp.vec3,
    "density_rate": float,
    "diffusion_rate": float,
    "first_dissipative": wp.vec3,
    "first_wall": wp.vec3,
    "fluid": int,
    "position": wp.vec3d,
    "velocity": wp.vec3,
    "density": wp.float64,
    "position_volume": wp.vec4,
    "velocity_pressure": wp.vec4,
    "acceleration": wp.vec3,
    "work": wp.vec3,
    "dt_limit": float,
    "fault": int,
}


@pytest.fixture
def launch(make_cloud):
    """A function that launches `kernel` over `count` particles and gives every array that it was handed, float64.

    `types` names the arrays in the kernel's order; those of `values` that are left out are zero, at rest and far away.
    """

    def run(kernel, types, count=1, dt=0.01, damping=None, reach=None, numbers=None, **values) -> dict[str, np.ndarray]:
        cloud = make_cloud(np.zeros((count, 3)), spacing=SPACING, ratio=RATIO, **(BOX | SAFE | (numbers or {})))
        values = {"density": 1000.0, "wall_distance": 1e9} | values
        arrays = {}
        for name, dtype in types.items():
            size = getattr(dtype, "_length_", 1)
            shape = (count, size) if size > 1 else (count,)
            arrays[name] = cloud.array(np.broadcast_to(np.asarray(values.get(name, 0.0), float), shape), dtype)
        scalars = [] if reach is None else [reach]
        scalars += [cloud.array([value], float) for value in (dt, damping) if value is not None]
        cloud.launcher.record_in_order(kernel, count, [cloud.parameters, *scalars, *arrays.values()])()
        return {name: array.numpy().astype(float) for name, array in arrays.items()}

    return run


def kick(launch, **fields) -> dict[str, np.ndarray]:
    return launch(integrators.kick_and_drift, KICK, **({"damping": 0.0} | fields))


# ------------------------------------------------------------------------------------------------------- one step


def test_first_half_is_eq_76_and_77(launch):
    given = {
        "position": [[8.0, 0.0, 1.0], [-3.0, 0.0, 2.0]],
        "velocity": [[0.5, 0.0, -0.25], [1.0, 0.0, 2.0]],
        "xsph_velocity": [[0.1, 0.0, 0.2], [0.0, 0.0, -0.1]],
        "acceleration": [[1.0, 0.0, -9.0], [3.0, 0.0, 0.0]],
        "density": [1010.0, 2500.0],
        "density_rate": [-100.0, 4000.0],
        "last_diffusion_rate": [10.0, -50.0],
        "fluid": [0, 1],
    }
    after = launch(integrators.drift_half, DRIFT, count=2, dt=0.02, **given)
    x, u, xsph, a, rho, D, R, _ = (np.array(values, float) for values in given.values())
    np.testing.assert_allclose(after["position"], x + 0.01 * (u + xsph), rtol=TOLERANCE * 1e-2)
    np.testing.assert_allclose(after["density"], rho + 0.01 * (D + R), rtol=TOLERANCE * 1e-2)
    # What the pair loops read: the place and the velocity of the middle of the step, m / rho and Tait's p there.
    np.testing.assert_allclose(after["position_volume"][:, :3], after["position"], rtol=TOLERANCE)
    np.testing.assert_allclose(after["velocity_pressure"][:, :3], u + 0.01 * a, rtol=TOLERANCE)
    rest_density, c = np.array([1000.0, 2530.0]), np.array([20.0, 30.0])
    volume = rest_density * SPACING**2 / after["density"]
    pressure = c**2 * rest_density / 7 * ((after["density"] / rest_density) ** 7 - 1)
    np.testing.assert_allclose(after["position_volume"][:, 3], volume, rtol=TOLERANCE)
    np.testing.assert_allclose(after["velocity_pressure"][:, 3], pressure, rtol=TOLERANCE)


def test_second_half_is_eq_78_and_79(launch):
    after = kick(
        launch,
        dt=0.02,
        position=[1.0, 0.0, 2.0],
        velocity=[0.5, 0.0, -0.25],
        xsph_velocity=[0.1, 0.0, 0.2],
        pressure_acceleration=[1.0, 0.0, 0.0],
        dissipative_acceleration=[0.0, 0.0, 2.0],
        wall_acceleration=[0.0, 0.0, 5.0],
        density=1010.0,
        density_rate=50.0,
        diffusion_rate=-7.0,
        last_diffusion_rate=3.0,
        position_volume=[0.0, 0.0, 0.0, 10.0 / 1010.0],
        velocity_pressure=[0.0, 0.0, 0.0, 300.0],
        numbers={"gravity": wp.vec3(0.0, 0.0, -9.0)},
    )
    a = np.array([1.0, 0.0, -2.0])
    u = np.array([0.5, 0.0, -0.25]) + 0.02 * a
    x = np.array([1.0, 0.0, 2.0]) + 0.01 * (u + np.array([0.1, 0.0, 0.2]))
    for name, value in {"acceleration": a, "velocity": u, "position": x}.items():
        np.testing.assert_allclose(after[name][0], value, rtol=TOLERANCE)
    np.testing.assert_allclose(after["velocity_pressure"][0, :3], u, rtol=TOLERANCE)
    np.testing.assert_allclose(after["position_volume"][0, :3], x, rtol=TOLERANCE)
    # Diffusion over the whole step, of which the last rate has had a half.
    rho = 1010.0 + 0.02 * -7.0 - 0.01 * 3.0
    assert after["density"][0] == pytest.approx(rho, rel=TOLERANCE)
    assert after["last_diffusion_rate"][0] == -7.0
    # Continuity reads volume and pressure at the end of the step too, predicted with the last rate.
    rho += 0.01 * 50.0
    pressure = SOUND_SPEED**2 * 1000.0 / 7 * ((rho / 1000.0) ** 7 - 1)
    assert after["position_volume"][0, 3] == pytest.approx(1000.0 * SPACING**2 / rho, rel=TOLERANCE)
    assert after["velocity_pressure"][0, 3] == pytest.approx(pressure, rel=TOLERANCE)
    # What diffusion takes of internal energy, m p / rho^2 d rho, is dissipated, with what the dissipative force takes.
    path = 10.0 * 0.02 * 0.5 * (np.array([0.5, 0.0, -0.25]) + u)
    assert after["work"][0, 0] == pytest.approx(10.0 * 300.0 / 1010.0**2 * 7.0 * 0.02 - 2.0 * path[2], rel=TOLERANCE)


def test_density_ends_by_eq_80(make_cloud):
    cloud = make_cloud(np.zeros((1, 3)))
    density = cloud.array([1010.0], wp.float64)
    cloud.launcher.record_in_order(
        integrators.finish_density, 1, [cloud.array([0.02], float), cloud.array([50.0], float), density]
    )()
    assert density.numpy()[0] == pytest.approx(1010.0 + 0.01 * 50.0, rel=TOLERANCE)


def test_kinetic_energy_is_accounted_for(launch):
    """Its change is the work of gravity, of pressure and of walls, less what is dissipated and what is damped."""
    random = np.random.default_rng(5)
    forces = {
        name: random.normal(size=(50, 3)) * [30, 0, 30]
        for name in ("pressure_acceleration", "dissipative_acceleration", "wall_acceleration")
    }
    u = random.normal(size=(50, 3)) * [1, 0, 1]
    after = kick(launch, count=50, dt=0.02, damping=8.0, velocity=u, **forces)
    kicked = u + 0.02 * sum(forces.values())
    path = 10.0 * 0.02 * 0.5 * (u + kicked)  # of a mass of 10 kg/m
    by = {name: np.einsum("ik,ik->i", force, path) for name, force in forces.items()}
    dissipated, by_walls, damped = after["work"].T
    np.testing.assert_allclose(dissipated, -by["dissipative_acceleration"], rtol=0, atol=10 * TOLERANCE)
    np.testing.assert_allclose(by_walls, by["wall_acceleration"], rtol=0, atol=10 * TOLERANCE)
    np.testing.assert_allclose(after["velocity"], kicked * math.exp(-8.0 * 0.02), rtol=0, atol=10 * TOLERANCE)
    gained = 5.0 * (np.einsum("ik,ik->i", after["velocity"], after["velocity"]) - np.einsum("ik,ik->i", u, u))
    budget = by["pressure_acceleration"] + by_walls - dissipated - damped
    np.testing.assert_allclose(gained, budget, rtol=0, atol=1e2 * TOLERANCE)


RATES = {
    "pressure_acceleration": [3.0, 0.0, 0.0],
    "dissipative_acceleration": [0.0, 0.0, 2.0],
    "wall_acceleration": [-1.0, 0.0, 5.0],
    "xsph_velocity": [0.1, 0.0, 0.2],
    "density_rate": 50.0,
    "diffusion_rate": -7.0,
}
WEIGHT = {"gravity": wp.vec3(0.0, 0.0, -9.0), "dimensions": 3}
every_reach = pytest.mark.parametrize("reach", sorted(integrators.REACH.values()))


def two_stages(launch, reach: float, first: dict, second: dict, **given) -> tuple[dict, dict]:
    """What the prediction and the correction leave of `given`, with the rates `first` and `second`."""
    common = {"reach": reach, "dt": 0.02, "numbers": WEIGHT}
    ahead = launch(integrators.predict, PREDICT, **common, **given, **first)
    carried = {name: ahead[name] for name in PREDICT if name in CORRECT and name not in (*RATES, "fluid", "velocity")}
    return ahead, launch(
        integrators.correct, CORRECT, damping=0.0, **common, **carried, velocity=given["velocity"], **second
    )


@every_reach
def test_two_stages_are_their_formula(launch, reach):
    """y* = y + theta dt A, y' = y + dt ((1 - b) A + b A*), b = 1 / (2 theta), x' by the velocities of y and y*."""
    x, u, rho = np.array([8.0, 0.0, 2.0]), np.array([0.5, 0.25, -0.25]), 1010.0
    second = {name: -2.0 * np.array(value) for name, value in RATES.items()}
    packed = {"position_volume": [0.0, 0.0, 0.0, 10.0 / rho], "velocity_pressure": [0.0, 0.0, 0.0, 300.0]}
    ahead, after = two_stages(launch, reach, RATES, second, position=x, velocity=u, density=rho, **packed)
    g, b = np.array([0.0, 0.0, -9.0]), 0.5 / reach
    by_forces = np.array([2.0, 0.0, 7.0])
    drift, u_ahead = u + np.array([0.1, 0.0, 0.2]), u + reach * 0.02 * (g + by_forces)
    np.testing.assert_allclose(ahead["position_volume"][0, :3], x + reach * 0.02 * drift, rtol=TOLERANCE)
    assert ahead["position_volume"][0, 3] == pytest.approx(10.0 / (rho + reach * 0.02 * 43.0), rel=TOLERANCE)
    np.testing.assert_allclose(ahead["velocity_pressure"][0, :3], u_ahead, rtol=TOLERANCE)

    x_new = x + 0.02 * ((1.0 - b) * drift + b * (u_ahead - [0.2, 0.0, 0.4]))
    u_new = u + 0.02 * (g + (1.0 - b) * by_forces - 2.0 * b * by_forces)
    rho_new = rho + 0.02 * ((1.0 - b) * 43.0 - 2.0 * b * 43.0)
    np.testing.assert_allclose(after["position"][0], x_new, rtol=0, atol=TOLERANCE * 1e-2)
    np.testing.assert_allclose(after["velocity"][0], u_new, rtol=TOLERANCE)
    assert after["density"][0] == pytest.approx(rho_new, rel=TOLERANCE * 1e-2)
    np.testing.assert_allclose(after["position_volume"][0], [*x_new, 10.0 / rho_new], rtol=TOLERANCE)
    np.testing.assert_allclose(after["velocity_pressure"][0, :3], u_new, rtol=TOLERANCE)


@every_reach
def test_two_stages_account_for_their_work(launch, reach):
    """Kinetic energy changes by the work of gravity and pressure, told here, and by what is written down."""
    random = np.random.default_rng(9)
    first, second = (
        {name: random.normal(size=3) * 30.0 for name in RATES if name.endswith("acceleration")} for _ in range(2)
    )
    u = np.array([0.5, 0.25, -0.25])
    _, after = two_stages(launch, reach, first, second, velocity=u)
    dissipated, by_walls, damped = after["work"][0]
    b = 0.5 / reach
    mean = (1.0 - b) * first["pressure_acceleration"] + b * second["pressure_acceleration"] + [0.0, 0.0, -9.0]
    told = 10.0 * 0.02 * mean @ (0.5 * (u + after["velocity"][0]))
    gained = 5.0 * (after["velocity"][0] @ after["velocity"][0] - u @ u)
    assert gained == pytest.approx(told + by_walls - dissipated, abs=100 * TOLERANCE)
    assert abs(by_walls) > 0.01 and abs(dissipated) > 0.01 and damped == 0.0


def test_held_fluid_feels_no_force(launch):
    after = kick(
        launch,
        pressure_acceleration=[100.0, 0.0, 50.0],
        wall_acceleration=[0.0, 0.0, 9.0],
        numbers={"mobility": [0.0, 1.0], "gravity": wp.vec3(0.0, 0.0, -9.81)},
    )
    for name in ("velocity", "position", "acceleration", "work"):
        assert not after[name].any()


def test_slow_particles_move_far_from_the_origin(launch):
    """5 mm/s in steps of 0.1 ms at x = 8 m, where single precision could not tell one place from the next."""
    x = np.array([[8.0, 0.0, 0.0]])
    for _ in range(20):
        x = launch(integrators.drift_half, DRIFT, dt=1e-4, velocity=[0.005, 0.0, 0.0], position=x)["position"]
        x = kick(launch, dt=1e-4, velocity=[0.005, 0.0, 0.0], position=x)["position"]
    assert x[0, 0] - 8.0 == pytest.approx(20 * 1e-4 * 0.005, rel=1e-5)


# ------------------------------------------------------------------------------------------- limits of the step


@pytest.mark.parametrize(
    ("fields", "limit"),
    [
        ({}, 0.5 * H / SOUND_SPEED),
        ({"velocity": [3.0, 0.0, 4.0]}, 0.5 * H / (SOUND_SPEED + 5.0)),
        ({"numbers": {"courant": 0.25}}, 0.25 * H / SOUND_SPEED),
        ({"pressure_acceleration": [0.0, 0.0, -4e4]}, 0.3 * math.sqrt(H / 4e4)),
        ({"numbers": {"alpha": [8.0, 0.0]}}, 0.25 * H**2 / (8.0 * SOUND_SPEED * H / 8)),
        ({"velocity": [6.0, 0.0, 8.0], "wall_distance": 0.02}, 0.5 * 0.02 / 10.0),
    ],
    ids=["sound", "sound and motion", "courant", "force", "viscosity", "wall"],
)
def test_limits_of_the_step(launch, fields, limit):
    """Each where it is the least, with a step too short to change the velocity."""
    after = kick(launch, dt=1e-12, **fields)
    assert after["dt_limit"][0] == pytest.approx(limit, rel=TOLERANCE)


@pytest.mark.parametrize(
    ("fault", "fields"),
    [
        (clock_kernels.SOUND, {}),
        (clock_kernels.SOUND, {"density": 501.0, "position": [49.0, 0.0, 1e6], "velocity": [0.0, 0.0, 19.9]}),
        (clock_kernels.NOT_FINITE, {"position": [math.nan, 0.0, 0.0]}),
        (clock_kernels.NOT_FINITE, {"velocity": [0.0, 0.0, math.inf]}),
        (clock_kernels.NOT_FINITE, {"pressure_acceleration": [math.nan, 0.0, 0.0]}),
        (clock_kernels.NOT_FINITE, {"density": math.nan}),
        (clock_kernels.TOO_LIGHT, {"density": 499.0}),
        (clock_kernels.TOO_DENSE, {"density": 2001.0}),
        (clock_kernels.SOUND, {"density": 2001.0, "fluid": 1}),  # of a fluid with 2530 kg/m3
        (clock_kernels.TOO_FAST, {"velocity": [20.1, 0.0, 0.0]}),
        (clock_kernels.OUTSIDE, {"position": [50.1, 0.0, 0.0]}),
        (clock_kernels.OUTSIDE, {"position": [-50.1, 0.0, 0.0]}),
        (clock_kernels.OUTSIDE, {"position": [0.0, 0.0, -50.1]}),
        (clock_kernels.OUTSIDE, {"position": [0.0, 1.1, 0.0]}),
    ],
)
def test_what_is_absurd(launch, fault, fields):
    assert kick(launch, dt=1e-6, **fields)["fault"][0] == fault
