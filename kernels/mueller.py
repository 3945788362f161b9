"""Braga's scheme (2018), after Müller, Charypar & Gross (2003): a smoothing kernel for each purpose, in a plane.

    rho_i = sum_j m W_p6(x_ij)                                                       eq 3.5, i itself included
    p_i = k (rho_i - rho0)                                                           eq 3.13, k = c^2
    a_i = - 1 / rho_i sum_j V_j (p_i + p_j) / 2 grad W_s(x_ij)                       eq 3.4
          + mu / rho_i sum_j V_j (u_j - u_i) lap W_v(x_ij) + g                       eq 3.21,  V_j = m / rho_j

The kernels vanish from q = 1 on, q = r / h. What one particle of a pair gets the other gives, so that momentum is
conserved; energy is not, since pressure acts along the gradient of another kernel than density is summed with.
"""

from functools import cache

import warp as wp

from .clock import find_fault
from .integrators import pressure_at, volume_at
from .layout import CPU_LAYOUT, Layout, Rows, compiler_options
from .parameters import Parameters
from .smoothing import SmoothingKernel

PI = wp.constant(3.14159265358979)


@wp.func
def poly6(q: float) -> float:
    """w = (1 - q^2)^3, Braga (2018) eq 3.25: for density."""
    t = wp.max(1.0 - q * q, 0.0)
    return t * t * t


@wp.func
def poly6_slope(q: float) -> float:
    """s = -6 (1 - q^2)^2; eq 3.31 leaves out its power of h and the vector."""
    t = wp.max(1.0 - q * q, 0.0)
    return -6.0 * t * t


@wp.func
def spiky(q: float) -> float:
    """w = (1 - q)^3, eq 3.26, of which pressure is the gradient: it pushes apart what comes close."""
    t = wp.max(1.0 - q, 0.0)
    return t * t * t


@wp.func
def spiky_slope(q: float) -> float:
    """s = -3 (1 - q)^2 / q."""
    t = wp.max(1.0 - q, 0.0)
    return -3.0 * t * t / wp.max(q, 1.0e-6)


@wp.func
def viscous(q: float) -> float:
    """w = q^2 / 4 - q^3 / 9 - log(q) / 6 - 5 / 36, eq 3.27: for viscosity."""
    t = wp.clamp(q, 1.0e-6, 1.0)
    return t * t / 4.0 - t * t * t / 9.0 - wp.log(t) / 6.0 - 5.0 / 36.0


@wp.func
def viscous_slope(q: float) -> float:
    """s = 1 / 2 - q / 3 - 1 / (6 q^2)."""
    t = wp.clamp(q, 1.0e-6, 1.0)
    return 0.5 - t / 3.0 - 1.0 / (6.0 * t * t)


@wp.func
def viscous_laplacian(q: float) -> float:
    """l = w'' + w' / q = 1 - q, nowhere negative: lap W = 40 / (pi h^4) l, eq 3.33."""
    return wp.max(1.0 - q, 0.0)


# Eq 3.29.
POLY6 = SmoothingKernel(poly6, poly6_slope, 1.0, {2: 4.0 / float(PI)})
SPIKY = SmoothingKernel(spiky, spiky_slope, 1.0, {2: 10.0 / float(PI)})
VISCOUS = SmoothingKernel(viscous, viscous_slope, 1.0, {2: 40.0 / float(PI)})

DENSITY_NORM = wp.constant(POLY6.normalisation[2])  # n h^2
PRESSURE_NORM = wp.constant(SPIKY.normalisation[2])
VISCOUS_NORM = wp.constant(VISCOUS.normalisation[2])


@cache
def summed_density_kernel(layout: Layout = CPU_LAYOUT) -> wp.Kernel:
    """The pair loop of rho_i = sum_j m W_p6(x_ij)."""
    load, packed, entry = layout.load[2], layout.packed, layout.entry

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def summed_density(
        first: int,
        parameters: Parameters,
        position_volume: wp.array[packed],
        velocity_pressure: wp.array[packed],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: Rows,
        density_out: wp.array[wp.float64],
    ):
        """rho_i [kg/m3]."""
        i = first + wp.tid()
        x_i, _y_i, z_i, _V_i, _u_i, _v_i, _w_i, _p_i = load(position_volume, velocity_pressure, i)
        total = poly6(0.0)
        k, end = int(0), neighbour_count[i]
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, _y_j, z_j, _V_j, _u_j, _v_j, _w_j, _p_j = load(position_volume, velocity_pressure, j)
            x, z = x_i - x_j, z_i - z_j
            total += poly6(wp.sqrt(x * x + z * z) * parameters.inverse_h)
            k += 1
        n = DENSITY_NORM * parameters.inverse_h * parameters.inverse_h
        density_out[i] = wp.float64(parameters.mass[fluid[i]] * n * total)

    return summed_density


@cache
def forces_kernel(layout: Layout = CPU_LAYOUT) -> wp.Kernel:
    """The pair loop of acceleration by pressure and by viscosity."""
    load, packed, entry = layout.load[2], layout.packed, layout.entry

    @wp.kernel(module="unique", enable_backward=False, module_options=compiler_options())
    def forces(
        first: int,
        parameters: Parameters,
        viscosity: float,
        position_volume: wp.array[packed],
        velocity_pressure: wp.array[packed],
        fluid: wp.array[int],
        neighbour_count: wp.array[int],
        neighbour_list: Rows,
        pressure_acceleration_out: wp.array[wp.vec3],
        dissipative_acceleration_out: wp.array[wp.vec3],
    ):
        """a_i by pressure and by viscosity [m/s2]; `viscosity` is mu [Pa s]."""
        i = first + wp.tid()
        x_i, _y_i, z_i, V_i, u_i, _v_i, w_i, p_i = load(position_volume, velocity_pressure, i)
        pressure_x, pressure_z, viscous_x, viscous_z = float(0.0), float(0.0), float(0.0), float(0.0)
        k, end = int(0), neighbour_count[i]
        while k < end:
            j = entry(neighbour_list, i, k)
            x_j, _y_j, z_j, V_j, u_j, _v_j, w_j, p_j = load(position_volume, velocity_pressure, j)
            x, z = x_i - x_j, z_i - z_j
            q = wp.sqrt(x * x + z * z) * parameters.inverse_h
            P = V_j * 0.5 * (p_i + p_j) * spiky_slope(q)
            pressure_x -= P * x
            pressure_z -= P * z
            L = V_j * viscous_laplacian(q)
            viscous_x += L * (u_j - u_i)
            viscous_z += L * (w_j - w_i)
            k += 1
        per_density = V_i / parameters.mass[fluid[i]]
        square = parameters.inverse_h * parameters.inverse_h
        n_s, n_v = PRESSURE_NORM * square * square, VISCOUS_NORM * square * square
        pressure_acceleration_out[i] = per_density * n_s * wp.vec3(pressure_x, 0.0, pressure_z)
        dissipative_acceleration_out[i] = viscosity * per_density * n_v * wp.vec3(viscous_x, 0.0, viscous_z)

    return forces


@wp.func
def thrown_back(axis: int, wall: wp.float64, restitution: float, x: wp.vec3d, v: wp.vec3, half: wp.vec3):
    """What a wall across an axis does to a particle that has gone through it, eq 3.35-3.38 as the program has them.

        t = (x - x_b) / v_x                      since it went through
        x -= (1 - d) v t,  x_x = 2 x_b - x_x     with its velocity from then on, and back from the wall
        v = d v,  v_x = -v_x                     all components, at whole and at half steps

    Of a particle that moves along the wall, v_x = 0, nothing is known, and nothing is done.
    """
    back, slowed, slowed_half = x, v, half
    if v[axis] != 0.0:
        since = float(x[axis] - wall) / v[axis]
        back = x - wp.vec3d((1.0 - restitution) * since * v)
        back[axis] = wp.float64(2.0) * wall - back[axis]
        slowed, slowed_half = restitution * v, restitution * half
        slowed[axis] = -slowed[axis]
        slowed_half[axis] = -slowed_half[axis]
    return back, slowed, slowed_half


@wp.func
def within_walls(lower: wp.vec3d, upper: wp.vec3d, restitution: float, x: wp.vec3d, v: wp.vec3, half: wp.vec3):
    """The same of the four walls of a box, one after the other: left, right, bottom, top."""
    if x[0] < lower[0]:
        x, v, half = thrown_back(0, lower[0], restitution, x, v, half)
    if x[0] > upper[0]:
        x, v, half = thrown_back(0, upper[0], restitution, x, v, half)
    if x[2] < lower[2]:
        x, v, half = thrown_back(2, lower[2], restitution, x, v, half)
    if x[2] > upper[2]:
        x, v, half = thrown_back(2, upper[2], restitution, x, v, half)
    return x, v, half


@wp.kernel(enable_backward=False)
def start_leapfrog(
    first: int,
    parameters: Parameters,
    time_step: float,
    pressure_acceleration: wp.array[wp.vec3],
    dissipative_acceleration: wp.array[wp.vec3],
    velocity: wp.array[wp.vec3],
    half_velocity_out: wp.array[wp.vec3],
):
    """Velocity half a step before the start, v^(-1/2) = v^0 - dt/2 a^0, eq 2.93."""
    i = first + wp.tid()
    a = parameters.gravity + pressure_acceleration[i] + dissipative_acceleration[i]
    half_velocity_out[i] = velocity[i] - 0.5 * time_step * a


@wp.kernel(enable_backward=False)
def leapfrog(
    first: int,
    parameters: Parameters,
    restitution: float,
    lower_wall: wp.vec3d,
    upper_wall: wp.vec3d,
    dt: wp.array[float],
    pressure_acceleration: wp.array[wp.vec3],
    dissipative_acceleration: wp.array[wp.vec3],
    density: wp.array[wp.float64],
    fluid: wp.array[int],
    position_inout: wp.array[wp.vec3d],
    velocity_inout: wp.array[wp.vec3],
    half_velocity_inout: wp.array[wp.vec3],
    wall_impulse_inout: wp.array[wp.vec3d],
    position_volume_out: wp.array[wp.vec4],
    velocity_pressure_out: wp.array[wp.vec4],
    acceleration_out: wp.array[wp.vec3],
    particle_work_out: wp.array[wp.vec3],
    particle_fault_out: wp.array[int],
):
    """v^(n+1/2) = v^(n-1/2) + dt a^n, x^(n+1) = x^n + dt v^(n+1/2), eq 2.89 and 2.90; then the walls.

    The velocity that viscosity and walls see is v^(n+1) = v^(n+1/2) + dt/2 a^n, eq 2.94. `lower_wall` and `upper_wall`
    are corners of the box of the walls [m]. What walls have given is that to v^(n+1/2), times the mass [N s/m].
    """
    i = first + wp.tid()
    f = fluid[i]
    step, m = dt[0], parameters.mass[f]
    a = parameters.gravity + pressure_acceleration[i] + dissipative_acceleration[i]
    half = half_velocity_inout[i] + step * a
    v = half + 0.5 * step * a
    x = position_inout[i] + wp.vec3d(step * half)
    x_end, v_end, half_end = within_walls(lower_wall, upper_wall, restitution, x, v, half)

    rise = float(x_end[2] - x[2])
    particle_work_out[i] = wp.vec3(
        -m * step * wp.dot(dissipative_acceleration[i], half),
        0.5 * m * (wp.dot(v_end, v_end) - wp.dot(v, v)) - m * parameters.gravity[2] * rise,
        0.0,
    )
    wall_impulse_inout[i] = wall_impulse_inout[i] + wp.float64(m) * (wp.vec3d(half_end) - wp.vec3d(half))
    position_inout[i] = x_end
    velocity_inout[i] = v_end
    half_velocity_inout[i] = half_end
    acceleration_out[i] = a
    # The density still belongs to the places before, until it is summed anew.
    rho = density[i]
    position_volume_out[i] = volume_at(parameters, x_end, rho, f)
    velocity_pressure_out[i] = pressure_at(parameters, x_end, v_end, rho, f)
    c = parameters.sound_speed[f]
    particle_fault_out[i] = find_fault(parameters, x_end, v_end, rho, parameters.rest_density[f], c)
