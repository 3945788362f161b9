"""The numbers that kernels read: formulas are closed over, numbers travel here, so no new value compiles anew."""

import warp as wp


@wp.struct
class Parameters:
    """Constants of one model. Arrays have one entry for each fluid of the scene."""

    dimensions: int  # of space
    particle_count: int  # slots from here on hold what stands behind the particles
    # smoothing
    smoothing_length: float  # h [m]
    inverse_h: float  # 1 / h [1/m]
    kernel_norm: float  # n: W = n w(q) [1/m^D]
    gradient_norm: float  # n / h^2: grad W = n / h^2 s(q) x_ij [1/m^(D+2)]
    inverse_shape_dx: float  # 1 / w(dx / h), for the tensile correction
    # neighbour lists
    list_radius: float  # support h (1 + skin) [m]
    list_capacity: int  # longest row that fits
    # forces
    gravity: wp.vec3  # and the body force [m/s2]
    hydrostatic: wp.vec3  # gravity alone, which fluid at rest carries by its pressure [m/s2]
    artificial_viscosity_beta: float  # beta of eq 58
    xsph: float  # epsilon of eq 40
    diffusion: float  # delta of the density diffusion
    inverse_spacing: float  # 1 / dx [1/m]
    wall_strength: float  # K / c^2, divided by beta (in 3-D its square) for the laws of distance alone
    wall_approach: (
        float  # beta_v of Monaghan & Kos (1999): what the speed of approach adds; 0 keeps energy, 1 is theirs
    )
    # time step
    courant: float
    # limits beyond which a particle is absurd
    least_compression: float  # rho / rho0
    most_compression: float
    lower: wp.vec3  # corner of the box that no particle leaves [m]
    upper: wp.vec3
    # one entry for each fluid
    mass: wp.array[float]  # [kg], or [kg/m] in 2-D
    rest_density: wp.array[float]  # rho0 [kg/m3]
    sound_speed: wp.array[float]  # c [m/s]
    stiffening: wp.array[float]  # 1: Tait, 0: linear state equation
    alpha: wp.array[float]  # artificial viscosity
    wall_alpha: wp.array[float]  # artificial viscosity against walls, divided by beta
    mobility: wp.array[float]  # 1: free, 0: held at its gate
    still_level: wp.array[float]  # level at which the fluid rests; -inf: it does not rest [m]
