"""Verlet, predictor-corrector and Runge-Kutta.

Verlet: drift, kick, drift.

Vasco (2014) eq 76-80, with F and D the rates of velocity and density, and R the rate of density by diffusion:

    x^(n+1/2) = x^n + dt/2 u^n                   rho^(n+1/2) = rho^n + dt/2 (D^n + R^(n-1/2))
    u^(n+1)   = u^n + dt F(x, u, rho at n+1/2)
    x^(n+1)   = x^(n+1/2) + dt/2 u^(n+1)         rho^(n+1)   = rho^n + dt/2 (D^n + D^(n+1)) + dt R^(n+1/2)

F needs a velocity at n+1/2, which the thesis leaves open: u^n + dt/2 F^(n-1/2). R comes from the sweep over the pairs
that gives F, D from one of its own.

The other two find all rates A of y = (x, u, rho) twice a step, A^n in place and A* at the state predicted with them:

    y* = y^n + theta dt A^n              y^(n+1) = y^n + dt ((1 - b) A^n + b A*),  b = 1 / (2 theta)

The predictor-corrector of Vasco (2014) 4.12.1 is theta = 1, Heun's: its eq 73-75 take A* half a step ahead and are of
first order. Runge-Kutta, 4.12.3, is theta = 1/2, the midpoint rule: its eq 84-86 have a factor 1/2 too many.
"""

from collections.abc import Mapping

import warp as wp

from .clock import find_fault, longest_step
from .parameters import Parameters
from .state_equation import pressure

# How far the integrators that evaluate twice predict: theta, of a step.
REACH: Mapping[str, float] = {"predictor_corrector": 1.0, "runge_kutta": 0.5}


@wp.func
def volume_at(parameters: Parameters, x: wp.vec3d, rho: wp.float64, f: int) -> wp.vec4:
    """(x, y, z, V) as the pair loop reads it."""
    return wp.vec4(float(x[0]), float(x[1]), float(x[2]), parameters.mass[f] / float(rho))


@wp.func
def pressure_at(parameters: Parameters, x: wp.vec3d, u: wp.vec3, rho: wp.float64, f: int) -> wp.vec4:
    """(u, v, w, p) as the pair loop reads it: in a plane (u, x, w, p), so that it needs a load less."""
    p = pressure(rho, parameters.rest_density[f], parameters.sound_speed[f], parameters.stiffening[f])
    return wp.vec4(u[0], wp.where(parameters.dimensions == 2, float(x[0]), u[1]), u[2], p)


@wp.kernel(enable_backward=False)
def drift_half(
    first: int,
    parameters: Parameters,
    dt: wp.array[float],
    velocity: wp.array[wp.vec3],
    xsph_velocity: wp.array[wp.vec3],
    acceleration: wp.array[wp.vec3],
    density_rate: wp.array[float],
    last_diffusion_rate: wp.array[float],
    fluid: wp.array[int],
    position_inout: wp.array[wp.vec3d],
    density_inout: wp.array[wp.float64],
    position_volume_out: wp.array[wp.vec4],
    velocity_pressure_out: wp.array[wp.vec4],
):
    """Position and density to n+1/2 (eq 76, 77), pressure by the state equation, velocity predicted."""
    i = first + wp.tid()
    f = fluid[i]
    half = 0.5 * dt[0]
    x = position_inout[i] + wp.vec3d(half * (velocity[i] + xsph_velocity[i]))
    rho = density_inout[i] + wp.float64(half * (density_rate[i] + last_diffusion_rate[i]))
    u = velocity[i] + half * acceleration[i]
    position_inout[i] = x
    density_inout[i] = rho
    position_volume_out[i] = volume_at(parameters, x, rho, f)
    velocity_pressure_out[i] = pressure_at(parameters, x, u, rho, f)


@wp.kernel(enable_backward=False)
def kick_and_drift(
    first: int,
    parameters: Parameters,
    dt: wp.array[float],
    damping: wp.array[float],
    pressure_acceleration: wp.array[wp.vec3],
    dissipative_acceleration: wp.array[wp.vec3],
    wall_acceleration: wp.array[wp.vec3],
    wall_distance: wp.array[float],
    xsph_velocity: wp.array[wp.vec3],
    density_rate: wp.array[float],
    diffusion_rate: wp.array[float],
    fluid: wp.array[int],
    position_inout: wp.array[wp.vec3d],
    velocity_inout: wp.array[wp.vec3],
    density_inout: wp.array[wp.float64],
    last_diffusion_rate_inout: wp.array[float],
    position_volume_inout: wp.array[wp.vec4],
    velocity_pressure_inout: wp.array[wp.vec4],
    acceleration_out: wp.array[wp.vec3],
    particle_work_out: wp.array[wp.vec3],
    particle_dt_limit_out: wp.array[float],
    particle_fault_out: wp.array[int],
):
    """Velocity to n+1 (eq 78), position to n+1 (eq 79), diffusion, the work of each force, the longest next step.

    The work done in a step is m a . (u^n + u^(n+1)) / 2 dt: with it the kinetic energy is accounted for exactly.
    Damping is u' = -damping u; it and the held fluids are the only places where velocity is not moved by a force.
    """
    i = first + wp.tid()
    f = fluid[i]
    step = dt[0]
    m = parameters.mass[f]
    free = parameters.mobility[f]
    a = free * (parameters.gravity + pressure_acceleration[i] + dissipative_acceleration[i] + wall_acceleration[i])
    u_old = velocity_inout[i]
    u_kicked = u_old + step * a
    u = u_kicked
    if damping[0] > 0.0:
        u *= wp.exp(-damping[0] * step)
    x = position_inout[i] + wp.vec3d(0.5 * step * (u + xsph_velocity[i]))

    path = free * step * m * 0.5 * (u_old + u_kicked)
    # The internal energy that diffusion takes, m p / rho^2 d rho, is dissipated.
    V, p, R = position_volume_inout[i][3], velocity_pressure_inout[i][3], diffusion_rate[i]
    particle_work_out[i] = wp.vec3(
        -wp.dot(dissipative_acceleration[i], path) - step * V * V / m * p * R,
        wp.dot(wall_acceleration[i], path),
        0.5 * m * (wp.dot(u_kicked, u_kicked) - wp.dot(u, u)),
    )
    rho = density_inout[i] + wp.float64(step * (R - 0.5 * last_diffusion_rate_inout[i]))
    position_inout[i] = x
    velocity_inout[i] = u
    density_inout[i] = rho
    last_diffusion_rate_inout[i] = R
    # Continuity at second order needs volumes of its own instant: density at n+1 is predicted with the last rate.
    rho_end = rho + wp.float64(0.5 * step * density_rate[i])
    position_volume_inout[i] = volume_at(parameters, x, rho_end, f)
    velocity_pressure_inout[i] = pressure_at(parameters, x, u, rho_end, f)
    acceleration_out[i] = a

    c = parameters.sound_speed[f]
    particle_dt_limit_out[i] = longest_step(parameters, c, parameters.alpha[f], u, a, wall_distance[i])
    particle_fault_out[i] = find_fault(parameters, x, u, rho, parameters.rest_density[f], c)


@wp.kernel(enable_backward=False)
def finish_density(first: int, dt: wp.array[float], density_rate: wp.array[float], density_inout: wp.array[wp.float64]):
    """Density to n+1 (eq 80)."""
    i = first + wp.tid()
    density_inout[i] = density_inout[i] + wp.float64(0.5 * dt[0] * density_rate[i])


@wp.kernel(enable_backward=False)
def pack(
    first: int,
    parameters: Parameters,
    position: wp.array[wp.vec3d],
    velocity: wp.array[wp.vec3],
    density: wp.array[wp.float64],
    fluid: wp.array[int],
    position_volume_out: wp.array[wp.vec4],
    velocity_pressure_out: wp.array[wp.vec4],
):
    """What the pair loop reads, of this instant; pressure by the state equation."""
    i = first + wp.tid()
    x, rho, f = position[i], density[i], fluid[i]
    position_volume_out[i] = volume_at(parameters, x, rho, f)
    velocity_pressure_out[i] = pressure_at(parameters, x, velocity[i], rho, f)


@wp.func
def diffusion_work(parameters: Parameters, V: float, p: float, R: float, f: int) -> float:
    """The internal energy that diffusion of density takes, m p / rho^2 R [W]."""
    return -V * V / parameters.mass[f] * p * R


@wp.kernel(enable_backward=False)
def predict(
    first: int,
    parameters: Parameters,
    reach: float,
    dt: wp.array[float],
    pressure_acceleration: wp.array[wp.vec3],
    dissipative_acceleration: wp.array[wp.vec3],
    wall_acceleration: wp.array[wp.vec3],
    xsph_velocity: wp.array[wp.vec3],
    density_rate: wp.array[float],
    diffusion_rate: wp.array[float],
    fluid: wp.array[int],
    velocity: wp.array[wp.vec3],
    position_inout: wp.array[wp.vec3d],
    density_inout: wp.array[wp.float64],
    position_volume_inout: wp.array[wp.vec4],
    velocity_pressure_inout: wp.array[wp.vec4],
    acceleration_out: wp.array[wp.vec3],
    particle_work_out: wp.array[wp.vec3],
    first_dissipative_out: wp.array[wp.vec3],
    first_wall_out: wp.array[wp.vec3],
):
    """What the pair loop reads, y* = y^n + theta dt A^n, theta the `reach`; position and density get their A^n.

    Where A^n has a share (theta > 1/2) what dissipates and what walls do is kept too, for their work over the step.
    """
    i = first + wp.tid()
    f = fluid[i]
    ahead = reach * dt[0]
    rest = (1.0 - 0.5 / reach) * dt[0]  # (1 - b) dt
    R = diffusion_rate[i]
    a = pressure_acceleration[i] + dissipative_acceleration[i] + wall_acceleration[i]
    a = parameters.mobility[f] * (parameters.gravity + a)
    u = velocity[i] + xsph_velocity[i]
    D = density_rate[i] + R
    x, rho = position_inout[i], density_inout[i]
    V, p = position_volume_inout[i][3], velocity_pressure_inout[i][3]

    x_ahead, rho_ahead = x + wp.vec3d(ahead * u), rho + wp.float64(ahead * D)
    position_volume_inout[i] = volume_at(parameters, x_ahead, rho_ahead, f)
    velocity_pressure_inout[i] = pressure_at(parameters, x_ahead, velocity[i] + ahead * a, rho_ahead, f)
    position_inout[i] = x + wp.vec3d(rest * u)
    density_inout[i] = rho + wp.float64(rest * D)
    particle_work_out[i] = wp.vec3(rest * diffusion_work(parameters, V, p, R, f), 0.0, 0.0)
    if reach > 0.5:
        acceleration_out[i] = a
        first_dissipative_out[i] = dissipative_acceleration[i]
        first_wall_out[i] = wall_acceleration[i]


@wp.kernel(enable_backward=False)
def correct(
    first: int,
    parameters: Parameters,
    reach: float,
    dt: wp.array[float],
    damping: wp.array[float],
    pressure_acceleration: wp.array[wp.vec3],
    dissipative_acceleration: wp.array[wp.vec3],
    wall_acceleration: wp.array[wp.vec3],
    wall_distance: wp.array[float],
    xsph_velocity: wp.array[wp.vec3],
    density_rate: wp.array[float],
    diffusion_rate: wp.array[float],
    first_dissipative: wp.array[wp.vec3],
    first_wall: wp.array[wp.vec3],
    fluid: wp.array[int],
    position_inout: wp.array[wp.vec3d],
    velocity_inout: wp.array[wp.vec3],
    density_inout: wp.array[wp.float64],
    position_volume_inout: wp.array[wp.vec4],
    velocity_pressure_inout: wp.array[wp.vec4],
    acceleration_inout: wp.array[wp.vec3],
    particle_work_inout: wp.array[wp.vec3],
    particle_dt_limit_out: wp.array[float],
    particle_fault_out: wp.array[int],
):
    """y^(n+1) = y^n + dt ((1 - b) A^n + b A*), b = 1 / (2 theta), the work of each force, the longest next step.

    Work is accounted for as by `kick_and_drift`: of the mean force along dt (u^n + u^(n+1)) / 2.
    """
    i = first + wp.tid()
    f = fluid[i]
    step = dt[0]
    share = 0.5 / reach  # b
    m = parameters.mass[f]
    free = parameters.mobility[f]
    dissipative, wall = share * dissipative_acceleration[i], share * wall_acceleration[i]
    a = (
        free
        * share
        * (parameters.gravity + pressure_acceleration[i] + dissipative_acceleration[i] + wall_acceleration[i])
    )
    if reach > 0.5:
        dissipative += (1.0 - share) * first_dissipative[i]
        wall += (1.0 - share) * first_wall[i]
        a += (1.0 - share) * acceleration_inout[i]
    u_old = velocity_inout[i]
    u_kicked = u_old + step * a
    u = u_kicked
    if damping[0] > 0.0:
        u *= wp.exp(-damping[0] * step)
    V, up, R = position_volume_inout[i][3], velocity_pressure_inout[i], diffusion_rate[i]
    u_ahead = wp.vec3(up[0], wp.where(parameters.dimensions == 2, 0.0, up[1]), up[2])
    x = position_inout[i] + wp.vec3d(share * step * (u_ahead + xsph_velocity[i]))
    rho = density_inout[i] + wp.float64(share * step * (density_rate[i] + R))

    path = free * step * m * 0.5 * (u_old + u_kicked)
    by_diffusion = share * step * diffusion_work(parameters, V, up[3], R, f)
    particle_work_inout[i] = particle_work_inout[i] + wp.vec3(
        by_diffusion - wp.dot(dissipative, path),
        wp.dot(wall, path),
        0.5 * m * (wp.dot(u_kicked, u_kicked) - wp.dot(u, u)),
    )
    position_inout[i] = x
    velocity_inout[i] = u
    density_inout[i] = rho
    position_volume_inout[i] = volume_at(parameters, x, rho, f)
    velocity_pressure_inout[i] = pressure_at(parameters, x, u, rho, f)
    acceleration_inout[i] = a

    c = parameters.sound_speed[f]
    particle_dt_limit_out[i] = longest_step(parameters, c, parameters.alpha[f], u, a, wall_distance[i])
    particle_fault_out[i] = find_fault(parameters, x, u, rho, parameters.rest_density[f], c)
