"""Exact and asymptotic solutions that case studies are held against. SI units; arrays broadcast; no kernel runs here.

Depths and heights z are measured from the bed or the lower plate, x from the back wall unless said otherwise. A body
force G is an acceleration along the flow, g sin(slope) on a slope.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

# Terms of a Fourier series exp(-n^2 s): beyond n^2 s = 40 they are below double precision.
_DECADES = 40.0
_MOST_TERMS = 4000

# ------------------------------------------------------------------------------------------------- viscous, transient


def periodic_shear(z: ArrayLike, t: float, *, speed: float, wavelength: float, viscosity: float) -> np.ndarray:
    """u [m/s] at z [m] of a shear wave that dies away: an exact solution of Navier-Stokes.

    u = U sin(k z) exp(-nu k^2 t), k = 2 pi / wavelength, nu = `viscosity` [m2/s]. Vasco (2014) 6.2.1 compares with the
    wave that does not decay.
    """
    k = 2.0 * math.pi / wavelength
    return speed * math.exp(-viscosity * k**2 * t) * np.sin(k * np.asarray(z, float))


def poiseuille_free_surface(
    z: ArrayLike, t: float, *, depth: float, acceleration: float, viscosity: float
) -> np.ndarray:
    """u [m/s] at z of a layer of `depth` d [m] on a slope, let go at t = 0; `t` may be infinite.

    u = G / nu (d z - z^2 / 2) - sum_n 2 G / (nu d l^3) sin(l z) exp(-nu l^2 t), l = (n + 1/2) pi / d, n >= 0: Vasco
    (2014) eq 101. The lower half of `poiseuille` between plates 2 d apart.
    """
    return poiseuille(z, t, height=2.0 * depth, acceleration=acceleration, viscosity=viscosity)


def poiseuille(z: ArrayLike, t: float, *, height: float, acceleration: float, viscosity: float) -> np.ndarray:
    """u [m/s] at z between plates `height` H [m] apart, at rest until t = 0; `t` may be infinite.

    u = G / (2 nu) z (H - z) - sum_n 4 G H^2 / (nu pi^3 m^3) sin(m pi z / H) exp(-m^2 pi^2 nu t / H^2), m = 2 n + 1:
    Morris, Fox & Zhu (1997); Vasco (2014) eq 102, whose sine lost its pi.
    """
    z = np.asarray(z, float)
    steady = 0.5 * acceleration / viscosity * z * (height - z)
    m = np.arange(1, 2 * _terms(viscosity * t / height**2), 2)
    shape = np.sin(np.multiply.outer(z, m) * math.pi / height)
    weight = 4.0 * acceleration * height**2 / (viscosity * math.pi**3 * m**3)
    return steady - shape @ (weight * _decay(m, viscosity * t / height**2))


def couette(z: ArrayLike, t: float, *, height: float, speed: float, viscosity: float) -> np.ndarray:
    """u [m/s] at z below a plate at `height` H [m] that moves with `speed` V from t = 0; `t` may be infinite.

    u = V z / H + sum_n 2 V / (n pi) (-1)^n sin(n pi z / H) exp(-n^2 pi^2 nu t / H^2), n >= 1: Morris, Fox & Zhu (1997),
    Vasco (2014) eq 103.
    """
    z = np.asarray(z, float)
    if t <= 0.0:
        return np.where(z < height, 0.0, speed)
    n = np.arange(1, _terms(viscosity * t / height**2))
    shape = np.sin(np.multiply.outer(z, n) * math.pi / height)
    weight = 2.0 * speed / (n * math.pi) * (-1.0) ** n
    return speed * z / height + shape @ (weight * _decay(n, viscosity * t / height**2))


def _terms(diffusion_time: float) -> int:
    """Terms of a series in exp(-n^2 pi^2 nu t / H^2), `diffusion_time` being nu t / H^2."""
    if diffusion_time * _MOST_TERMS**2 <= _DECADES:
        return _MOST_TERMS
    return 2 + math.ceil(math.sqrt(_DECADES / diffusion_time) / math.pi)


def _decay(n: np.ndarray, diffusion_time: float) -> np.ndarray:
    return np.exp(-((math.pi * n) ** 2) * diffusion_time)


# ----------------------------------------------------------------------------------------------- viscoplastic, steady


def herschel_bulkley_free_surface(
    z: ArrayLike,
    *,
    depth: float,
    acceleration: float,
    density: float,
    consistency: float,
    exponent: float,
    yield_stress: float,
) -> np.ndarray:
    """u [m/s] at z of a steady layer of `depth` d [m] on a slope; tau = tau_y + K (du/dz)^N, tau = rho G (d - z).

    u = (rho G / K)^(1/N) N / (N + 1) (z_p^((N+1)/N) - (z_p - z)^((N+1)/N)) below z_p = d - tau_y / (rho G), and a plug
    above: Coussot (1994), Huang & Garcia (1998). N = 1 is Bingham's fluid, tau_y = 0 a power law. At rest if
    tau_y >= rho G d.
    """
    weight = density * acceleration
    flowing = depth - plug_thickness(depth=depth, acceleration=acceleration, density=density, yield_stress=yield_stress)
    power = 1.0 + 1.0 / exponent
    below = np.clip(flowing - np.asarray(z, float), 0.0, None)
    return (weight / consistency) ** (1.0 / exponent) / power * (flowing**power - below**power)


def plug_thickness(*, depth: float, acceleration: float, density: float, yield_stress: float) -> float:
    """Thickness [m] of a layer's upper part, which does not shear: tau_y / (rho G), at most all of it."""
    return min(yield_stress / (density * acceleration), depth)


def bingham_poiseuille(
    z: ArrayLike, *, height: float, acceleration: float, density: float, viscosity: float, yield_stress: float
) -> np.ndarray:
    """u [m/s] at z of a Bingham fluid, steady between plates `height` H [m] apart; `viscosity` is its mu [Pa s].

    Two layers of H / 2 face to face, a plug of 2 tau_y / (rho G) between them: Bird, Dai & Yarusso (1983).
    """
    from_wall = 0.5 * height - np.abs(np.asarray(z, float) - 0.5 * height)
    return herschel_bulkley_free_surface(
        from_wall,
        depth=0.5 * height,
        acceleration=acceleration,
        density=density,
        consistency=viscosity,
        exponent=1.0,
        yield_stress=yield_stress,
    )


# --------------------------------------------------------------------------------------------------------- dam breaks


def ritter(x: ArrayLike, t: float, *, height: float, gravity: float = 9.81) -> tuple[np.ndarray, np.ndarray]:
    """Depth [m] and velocity [m/s] at x from the gate, t [s] > 0 after it opened on a dry bed: Ritter (1892).

    h = (2 - s)^2 H / 9, u = 2/3 (1 + s) sqrt(g H), s = x / (t sqrt(g H)), -1 <= s <= 2. For a reservoir without end:
    until t = L / sqrt(g H) for one of length L. Beyond the tip there is no fluid: h = 0, u = 0.
    """
    c = math.sqrt(gravity * height)
    s = np.asarray(x, float) / (t * c)
    wave = np.clip(s, -1.0, 2.0)
    return height * (2.0 - wave) ** 2 / 9.0, np.where(s > 2.0, 0.0, 2.0 / 3.0 * (1.0 + wave) * c)


def ritter_front(t: ArrayLike, *, height: float, length: float, gravity: float = 9.81) -> np.ndarray:
    """Front [m] from the back wall of a reservoir of `length`: L + 2 t sqrt(g H), which no real front passes."""
    return length + 2.0 * math.sqrt(gravity * height) * np.asarray(t, float)


# eta_N = (1/5 (3/10)^(1/3) sqrt(pi) Gamma(1/3) / Gamma(5/6))^(-3/5) = 1.411
HUPPERT_FRONT = (0.2 * 0.3 ** (1 / 3) * math.sqrt(math.pi) * math.gamma(1 / 3) / math.gamma(5 / 6)) ** -0.6


def huppert_front(t: ArrayLike, *, area: float, viscosity: float, gravity: float = 9.81) -> np.ndarray:
    """Front [m] of a viscous slump late after its release at the back wall: Huppert (1982).

    x_N = 1.411 (g A^3 t / (3 nu))^(1/5) for an `area` A [m2] and nu [m2/s]. Thin, slow, and well beyond its reservoir.
    """
    return HUPPERT_FRONT * (gravity * area**3 * np.asarray(t, float) / (3.0 * viscosity)) ** 0.2


def huppert_depth(x: ArrayLike, t: float, *, area: float, viscosity: float, gravity: float = 9.81) -> np.ndarray:
    """Depth [m] of the same slump: eta_N^(2/3) (3/10)^(1/3) (3 nu A^2 / (g t))^(1/5) (1 - (x / x_N)^2)^(1/3)."""
    front = float(huppert_front(t, area=area, viscosity=viscosity, gravity=gravity))
    scale = HUPPERT_FRONT ** (2 / 3) * 0.3 ** (1 / 3) * (3.0 * viscosity * area**2 / (gravity * t)) ** 0.2
    return scale * np.cbrt(np.clip(1.0 - (np.asarray(x, float) / front) ** 2, 0.0, None))


def arrested_toe(*, height: float, length: float, density: float, yield_stress: float, gravity: float = 9.81) -> float:
    """Toe [m] from the back wall of a viscoplastic dam break that has come to rest; see `arrested_depth`."""
    reach = 0.5 * density * gravity * height**2 / yield_stress
    if 2.0 * reach < 3.0 * length:
        return length + reach / 3.0
    scale = math.sqrt(2.0 * yield_stress / (density * gravity))
    return (1.5 * height * length / scale) ** (2 / 3)


def arrested_depth(
    x: ArrayLike, *, height: float, length: float, density: float, yield_stress: float, gravity: float = 9.81
) -> np.ndarray:
    """Depth [m] at x of a viscoplastic column `height` H by `length` L that has slumped on a level bed and stopped.

    Thin-layer theory, the yield stress at the bed carrying the slope of the surface, rho g h dh/dx = -tau_y:
    Nye (1952), Liu & Mei (1989), so that

        h^2 = 2 tau_y / (rho g) (x_f - x),    H L = 2/3 sqrt(2 tau_y / (rho g)) x_f^(3/2)

    If tau_y L / (rho g H^2) > 1/3 the back of the column stays as it was, h <= H, and x_f = L + rho g H^2 / (6 tau_y):
    Matson & Hogg (2007). Inertia makes a real slump run farther, and near its toe no layer is thin.
    """
    toe = arrested_toe(height=height, length=length, density=density, yield_stress=yield_stress, gravity=gravity)
    below = np.clip(toe - np.asarray(x, float), 0.0, None)
    return np.minimum(np.sqrt(2.0 * yield_stress / (density * gravity) * below), height)


# ------------------------------------------------------------------------------------------------------ solitary wave


def solitary_celerity(*, depth: float, amplitude: float, gravity: float = 9.81) -> float:
    """c = sqrt(g (d + a)) [m/s]: Boussinesq (1872), as Russell (1844) had measured."""
    return math.sqrt(gravity * (depth + amplitude))


def solitary_wave(s: ArrayLike, *, depth: float, amplitude: float) -> np.ndarray:
    """Elevation [m] at s = x - c t from the crest: a sech^2(s sqrt(3 a / (4 d^3))), Boussinesq (1872)."""
    return amplitude / np.cosh(math.sqrt(0.75 * amplitude / depth**3) * np.asarray(s, float)) ** 2


@dataclass(frozen=True)
class SolitaryFit:
    """The solitary wave nearest to a record.

    Attributes:
        amplitude: a [m].
        crest: Where the crest is [m], or when it passes [s].
        r2: Coefficient of determination: 1 for a perfect likeness.
    """

    amplitude: float
    crest: float
    r2: float


def fit_solitary_wave(
    at: ArrayLike, elevation: ArrayLike, *, depth: float, gravity: float | None = None
) -> SolitaryFit:
    """Fit `solitary_wave` to a record by least squares in amplitude and crest.

    `elevation` [m] above still water is along x [m], or, with `gravity`, at the times t [s] of a gauge that the wave
    passes with its own celerity. Amplitude and width are bound to each other: a wave of another width has a low r2.
    Gauss-Newton, steps halved until they help.

    Raises:
        ValueError: no point is above still water.
    """
    at, elevation = np.asarray(at, float), np.asarray(elevation, float)
    if not np.any(elevation > 0.0):
        raise ValueError("there is no wave above still water to fit")

    def wave(unknown: np.ndarray) -> np.ndarray:
        amplitude, crest = unknown
        speed = 1.0 if gravity is None else solitary_celerity(depth=depth, amplitude=amplitude, gravity=gravity)
        return solitary_wave(speed * (at - crest), depth=depth, amplitude=amplitude)

    unknown = np.array([elevation.max(), at[elevation.argmax()]])
    rest = np.sum((elevation - wave(unknown)) ** 2)
    for _ in range(100):
        step = 1e-6 * np.array([unknown[0], np.ptp(at)])
        slope = [(wave(unknown + d) - wave(unknown - d)) / (2.0 * d.sum()) for d in np.diag(step)]
        change = np.linalg.lstsq(np.stack(slope, axis=1), elevation - wave(unknown), rcond=None)[0]
        for share in 0.5 ** np.arange(20):
            tried = unknown + share * change
            better = np.sum((elevation - wave(tried)) ** 2) if tried[0] > 0.0 else math.inf
            if better < rest:
                break
        else:
            break
        unknown, rest = tried, better
    spread = np.sum((elevation - elevation.mean()) ** 2)
    return SolitaryFit(float(unknown[0]), float(unknown[1]), float(1.0 - rest / spread))


# ------------------------------------------------------------------------------------------------------------- bodies


def impulse_product(
    *, froude: float, thickness: float, mass: float, depth: float, slope: float, density: float
) -> float:
    """P = F S^(1/2) M^(1/4) cos(6 alpha / 7)^(1/2), S = s / d, M = m / (rho d^2): Heller & Hager (2010).

    Of a slide s = `thickness` [m] thick, of `mass` [kg/m], that hits water of `depth` [m] and `density` [kg/m3] on a
    slope of alpha = `slope` [degrees] with the Froude number F = V / sqrt(g d), V the speed of its centre.
    """
    M = mass / (density * depth**2)
    return froude * math.sqrt(thickness / depth) * M**0.25 * math.sqrt(math.cos(math.radians(6.0 / 7.0 * slope)))


def impulse_wave(product: float, *, depth: float, distance: float) -> float:
    """Amplitude of the wave of a slide [m], `distance` [m] from the impact in a channel: a = 4/5 H,
    H = 3/4 (P X^(-1/3))^(4/5) d, X = x / d.

    Heller & Hager (2010), from experiments with granular slides; Evers, Heller, Fuchs, Hager & Boes (2019) eq 3.16 and
    3.19, for slopes of 30 to 90 degrees, F = 0.86 to 6.83, S = 0.09 to 1.64, M = 0.11 to 10.02, slides 0.59 to 1.72
    times as dense as water, and X > 11/2 P^(1/2).
    """
    return 0.8 * 0.75 * (product * (distance / depth) ** (-1.0 / 3.0)) ** 0.8 * depth


def solitary_energy(*, depth: float, amplitude: float, density: float, gravity: float = 9.81) -> float:
    """E = 8 / (3 sqrt(3)) rho g (a d)^(3/2) [J/m], half of it kinetic: of `solitary_wave`, Boussinesq (1872)."""
    return 8.0 / (3.0 * math.sqrt(3.0)) * density * gravity * (amplitude * depth) ** 1.5


def wagner_half_width(t: ArrayLike, *, speed: float, deadrise: float) -> np.ndarray:
    """Half of the wetted width [m] of a wedge that enters still water: pi / 2 V t / tan(deadrise), Wagner (1932)."""
    return 0.5 * math.pi * speed / math.tan(deadrise) * np.asarray(t, float)


def wagner_force(t: ArrayLike, *, speed: float, deadrise: float, density: float) -> np.ndarray:
    """Force [N/m] on a wedge of `deadrise` [rad] that enters still water at a constant `speed` V [m/s]: Wagner (1932).

    F = d/dt (pi / 2 rho c^2 V) = pi^3 / 4 rho V^3 t / tan^2(deadrise), c being `wagner_half_width`. Early: while c is
    less than the half-width of the wedge and gravity is nothing, V >> g t. For small angles: too high by a factor that
    grows with the angle.
    """
    half_width = wagner_half_width(t, speed=speed, deadrise=deadrise)
    return math.pi * density * speed * half_width * (0.5 * math.pi * speed / math.tan(deadrise))


def logvinovich_force(t: ArrayLike, *, speed: float, deadrise: float, density: float) -> np.ndarray:
    """Force [N/m] on the same wedge, for angles that are not small: the modified Logvinovich model, Korobkin (2004).

    Wagner's potential with the shape of the wedge kept in Bernoulli's equation: at s = x / c, c being
    `wagner_half_width` and b the deadrise,

        p = rho V^2 / 2 (pi / tan(b) / sqrt(1 - s^2) - cos^2(b) / (1 - s^2) - sin^2(b))

    and the force is its integral as far as p > 0, up to s_p:

        F = rho V^2 c (pi / tan(b) arcsin(s_p) - cos^2(b) artanh(s_p) - sin^2(b) s_p)

    Within 2.3 % of the similarity solution of Dobrovolskaya (1969), as tabled by Zhao & Faltinsen (1993), for 10 to 20
    degrees, and 7 % above it for 30, where Wagner's own is 64 % above it.
    """
    a, cos2, sin2 = math.pi / math.tan(deadrise), math.cos(deadrise) ** 2, math.sin(deadrise) ** 2
    steepness = (a + math.sqrt(a**2 - 4.0 * cos2 * sin2)) / (2.0 * cos2)  # 1 / sqrt(1 - s_p^2)
    s = math.sqrt(1.0 - 1.0 / steepness**2)
    half_width = wagner_half_width(t, speed=speed, deadrise=deadrise)
    return density * speed**2 * half_width * (a * math.asin(s) - cos2 * math.atanh(s) - sin2 * s)


@dataclass(frozen=True)
class Heave:
    """How a floating box heaves that is let go at rest deeper than it floats, by linear theory.

    Attributes:
        added_mass: At high frequency [kg], in 2-D [kg/m].
        first: When it is highest for the first time [s].
        period: From then until it is highest again [s].
    """

    added_mass: float
    first: float
    period: float


def heave_in_tank(
    *, width: float, depth: float, beam: float, draft: float, density: float, gravity: float = 9.81, dimensions: int = 3
) -> Heave:
    """The heave of a box in the middle of a tank, with the waves in it: potential flow, small motions.

    In 3-D box and tank are square. Of two grids, one twice as fine as the other, extrapolated: at an edge of 270
    degrees phi goes like r^(2/3), and the added mass converges like dx^(4/3). The water level falls as the box rises,
    which shortens the period: by sqrt(1 - (beam / width)^2), in 2-D sqrt(1 - beam / width), if there are no waves.

    Raises ValueError where no whole number of cubes, up to 6 to half the beam, fits all sizes.
    """
    sizes = np.array([0.5 * width, depth, draft]) * 2.0 / beam
    fits = (cells for cells in range(2, 7) if np.allclose(sizes * cells, np.round(sizes * cells), atol=1e-6))
    if (cells := next(fits, None)) is None:
        raise ValueError(f"no cubes fit a beam of {beam:g} m, a draft of {draft:g} m and the tank")
    if dimensions == 2:
        cells *= 4  # squares are cheap
    grids = []
    for n in (cells, 2 * cells):
        to_wall, to_bed, to_bottom = np.rint(sizes * n).astype(int)
        grids.append(_Cubes.of(n, to_wall, to_bed, to_bottom, dimensions))
    coarse, fine = (np.array(grid.heave(beam, draft, density, gravity)) for grid in grids)
    return Heave(*(fine + (fine - coarse) / (2.0 ** (4.0 / 3.0) - 1.0)).tolist())


@dataclass(frozen=True)
class _Cubes:
    """Laplace's equation around a box in a tank by finite differences, told by its surfaces alone.

    A quarter of the tank, in 2-D a half, is cut into cubes of edge 1. With phi at the free surface, and the box rising
    at 1, water flows up through the surface at `flow` phi + `lift`, and the sum of phi over the bottom of the box is
    `added` - `lift` phi.

    Attributes:
        cells: Cubes to half the beam.
        dimensions: 2 or 3.
        flow: Shape [surface, surface].
        lift: Shape [surface].
        added: Of the quarter.
    """

    cells: int
    dimensions: int
    flow: np.ndarray
    lift: np.ndarray
    added: float

    @classmethod
    def of(cls, cells: int, width: int, depth: int, draft: int, dimensions: int) -> "_Cubes":
        """`cells`, `width`, `depth` and `draft` are cubes to half the beam, to half the width and to the others.

        Layers are eliminated from the bottom to the surface, phi_k = Q phi_(k+1) + q.
        """
        line = np.eye(width, k=1) + np.eye(width, k=-1)
        line -= np.diag(line.sum(axis=1))
        side = np.arange(width) < cells
        values, modes = np.linalg.eigh(line)
        flat, under, decay = line, side, values
        if dimensions == 3:
            flat = np.kron(line, np.eye(width)) + np.kron(np.eye(width), line)
            under, modes, decay = np.kron(side, side), np.kron(modes, modes), np.add.outer(values, values).ravel()
        beside = np.flatnonzero(~under)
        ring = flat[np.ix_(beside, beside)]
        ring -= np.diag(ring.sum(axis=1))

        # Below the box all layers have the modes of `flat`.
        share = np.zeros_like(decay)
        for k in range(depth - draft - 1):
            share = 1.0 / (float(k > 0) + 1.0 - decay - share)  # links to the layers below and above, and to the sides
        below = (modes * share) @ modes.T
        links = float(depth - draft > 1) + np.where(under, 0.0, 1.0)
        base = np.linalg.inv(np.diag(links) - flat - below)
        by_box = base @ under.astype(float)
        Q, q = base[np.ix_(beside, beside)], by_box[beside]
        layers = []
        for k in range(draft):
            above = 2.0 if k == draft - 1 else 1.0  # the surface is half as far as a layer
            inverse = np.linalg.inv((1.0 + above) * np.eye(len(beside)) - ring - Q)
            Q, q = above * inverse, inverse @ q
            layers.append((Q, q))
        phi = np.zeros(len(beside))
        for Q, q in reversed(layers):
            phi = Q @ phi + q
        bottom = (by_box + base[:, beside] @ phi)[under] + 0.5
        Q, q = layers[-1]
        return cls(cells, dimensions, 2.0 * (np.eye(len(beside)) - Q), -2.0 * q, float(bottom.sum()))

    def heave(self, beam: float, draft: float, density: float, gravity: float) -> tuple[float, float, float]:
        """Added mass, first time and period, as of `Heave`.

        The surface rises at `flow` phi + `lift` w, phi changes by -g times its rise, and the box is pushed by its own
        weight of water and by -density d/dt of phi summed over its bottom: leapfrog steps in the modes of `flow`.
        """
        edge = 0.5 * beam / self.cells
        column = (2.0 if self.dimensions == 2 else 4.0) * density * edge ** (self.dimensions - 1)  # of all quarters
        values, modes = np.linalg.eigh(0.5 * (self.flow + self.flow.T))
        lift, area = modes.T @ self.lift, beam ** (self.dimensions - 1)
        added = column * edge * self.added
        mass, spring = density * area * draft + added, density * gravity * area
        span = 2.0 * math.pi * math.sqrt(mass / spring)
        dt = 1e-3 * span
        rise, phi, z, w, heights = np.zeros_like(lift), np.zeros_like(lift), -1.0, 0.0, []
        for n in range(2000):
            phi -= (0.5 if n == 0 else 1.0) * dt * gravity * rise
            w -= (0.5 if n == 0 else 1.0) * dt * (spring * z + column * gravity * (lift @ rise)) / mass
            rise += dt * (values / edge * phi + lift * w)
            z += dt * w
            heights.append(z)
        first, again = highest(dt * np.arange(1, 2001), np.array(heights), span)[:2]
        return added, first, again - first


def highest(time: np.ndarray, height: np.ndarray, period: float) -> np.ndarray:
    """Times at which a heave of about `period` [s] is highest, from evenly sampled records of shape [n].

    Where no place within a third of a period is as high; between samples by a parabola through a sixth of a period.
    """
    around = round(period / 3.0 / (time[1] - time[0]))
    near = np.lib.stride_tricks.sliding_window_view(height, 2 * around + 1)
    tops = np.flatnonzero(near.argmax(axis=1) == around) + around
    found = []
    for k in tops:
        part = slice(k - around // 4, k + around // 4 + 1)
        curve, slope, _ = np.polyfit(time[part] - time[k], height[part], 2)
        found.append(time[k] - 0.5 * slope / curve)
    return np.array(found)


def floating_draft(*, mass: float, waterplane: float, density: float) -> float:
    """Draft [m] at which a body with upright sides floats: Archimedes, m = rho A d.

    `mass` [kg] over a `waterplane` [m2], or [kg/m] over a beam [m].
    """
    return mass / (density * waterplane)
