"""Water waves: dispersion, limits, spectra, and the motions of paddles that make them. SI units; no kernel runs here.

A paddle stands at x = 0 and pushes along x. Its stroke is the full way between its ends, for a flap that at the still
level. Heights z are measured from the bed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

MCCOWAN = 0.78  # greatest H / d of a solitary wave: McCowan (1894)
MICHE = 0.142  # greatest H / L in deep water: Miche (1944)
MOST_URSELL = 8.0 * math.pi**2 / 3.0  # of H L^2 / d^3, for second-order theory: Madsen (1971)
# A solitary wave begins and ends where its height is sech^2 of this.
SOLITARY_REACH = 3.8
# Of the peak frequency, between which a spectrum is made.
LOWEST, HIGHEST = 0.5, 3.0


def wavenumber(omega: ArrayLike, *, depth: float, gravity: float = 9.81) -> np.ndarray:
    """k [1/m] of a wave of frequency omega [rad/s]: omega^2 = g k tanh(k d), Airy (1845); by Newton's method."""
    y = np.asarray(omega, float) ** 2 * depth / gravity
    kd = np.where(y < 1.0, np.sqrt(y), y)
    for _ in range(50):
        t = np.tanh(kd)
        kd = kd - (kd * t - y) / (t + kd * (1.0 - t * t))
    return kd / depth


def wavelength(period: float, *, depth: float, gravity: float = 9.81) -> float:
    """L [m] of a small wave."""
    return 2.0 * math.pi / float(wavenumber(2.0 * math.pi / period, depth=depth, gravity=gravity))


def group_celerity(period: float, *, depth: float, gravity: float = 9.81) -> float:
    """Speed [m/s] at which a train of small waves advances: c / 2 (1 + 2 k d / sinh(2 k d))."""
    omega = 2.0 * math.pi / period
    k = float(wavenumber(omega, depth=depth, gravity=gravity))
    return 0.5 * omega / k * (1.0 + 2.0 * k * depth / math.sinh(min(2.0 * k * depth, 300.0)))


def miche_height(period: float, *, depth: float, gravity: float = 9.81) -> float:
    """The greatest height [m] of a regular wave: 0.142 L tanh(k d), Miche (1944)."""
    length = wavelength(period, depth=depth, gravity=gravity)
    return MICHE * length * math.tanh(2.0 * math.pi * depth / length)


def paddle_ratio(k: ArrayLike, *, depth: float, hinge: float | None = None) -> np.ndarray:
    """H / S of a paddle, by linear theory: Biesel & Suquet (1951), Dean & Dalrymple (1991) eq 6.25 and 6.26.

    With f(z) the share of the stroke at z, 1 for a piston, (z - l) / (d - l) above the `hinge` l of a flap [m from the
    bed, less than 0 below it]:

        H / S = 4 k sinh(k d) / (sinh(2 k d) + 2 k d) int_0^d f(z) cosh(k z) dz
    """
    k = np.asarray(k, float)
    kd = k * depth
    scale = np.exp(-2.0 * kd)  # sinh and cosh over e^kd, for deep water
    sinh, cosh = 0.5 * (1.0 - scale), 0.5 * (1.0 + scale)
    if hinge is None:
        integral = sinh / k
    else:
        low = max(hinge, 0.0)
        foot = (low - hinge) * np.sinh(k * low) / k - np.cosh(k * low) / k**2
        integral = ((depth - hinge) * sinh / k - cosh / k**2 - foot * np.exp(-kd)) / (depth - hinge)
    return 4.0 * k * sinh * integral / (0.5 * (1.0 - scale * scale) + 2.0 * kd * scale)


def madsen_stroke(height: float, k: float, *, depth: float) -> float:
    """Amplitude [m] of the second harmonic of a piston that makes no free one: Madsen (1971).

    x(t) = S / 2 sin(w t) + H^2 / (32 d) (3 cosh(k d) / sinh^3(k d) - 2 / m) sin(2 w t),   m = H / S
    """
    kd = k * depth
    ratio = float(paddle_ratio(k, depth=depth))
    return height**2 / (32.0 * depth) * (3.0 * math.cosh(kd) / math.sinh(kd) ** 3 - 2.0 / ratio)


def bound_harmonic(height: float, k: float, *, depth: float) -> float:
    """Amplitude [m] of the second harmonic that goes with a wave: Stokes (1847), k H^2 / 16 cosh(kd) (2 + cosh(2kd)) /
    sinh^3(kd)."""
    kd = k * depth
    return k * height**2 / 16.0 * math.cosh(kd) * (2.0 + math.cosh(2.0 * kd)) / math.sinh(kd) ** 3


def regular_paddle(
    t: ArrayLike,
    *,
    height: float,
    period: float,
    depth: float,
    order: int = 1,
    hinge: float | None = None,
    gravity: float = 9.81,
) -> np.ndarray:
    """Way [m] of a paddle, at the still level, that makes regular waves; of second order by `madsen_stroke`."""
    omega = 2.0 * math.pi / period
    k = float(wavenumber(omega, depth=depth, gravity=gravity))
    t = np.asarray(t, float)
    way = 0.5 * height / paddle_ratio(k, depth=depth, hinge=hinge) * np.sin(omega * t)
    if order == 2:
        way = way + madsen_stroke(height, k, depth=depth) * np.sin(2.0 * omega * t)
    return way


# ------------------------------------------------------------------------------------------------------------- spectra


def pierson_moskowitz(f: ArrayLike, *, height: float, period: float) -> np.ndarray:
    """S(f) [m2 s] of a grown sea with significant height Hs and peak period Tp: Pierson & Moskowitz (1964).

    5/16 Hs^2 f_p^4 f^-5 exp(-5/4 (f_p / f)^4), whose integral is Hs^2 / 16.
    """
    x = np.asarray(f, float) * period
    return 5.0 / 16.0 * height**2 * period * x**-5.0 * np.exp(-1.25 * x**-4.0)


def jonswap(f: ArrayLike, *, height: float, period: float, peak: float = 3.3) -> np.ndarray:
    """S(f) [m2 s] of a young sea: Hasselmann et al. (1973), scaled so that its integral is Hs^2 / 16.

    That of Pierson & Moskowitz times gamma^exp(-(f / f_p - 1)^2 / (2 s^2)), s = 0.07 below the peak and 0.09 above.
    """

    def shape(frequency: np.ndarray) -> np.ndarray:
        x = frequency * period
        width = np.where(x < 1.0, 0.07, 0.09)
        return pierson_moskowitz(frequency, height=height, period=period) * peak ** np.exp(
            -((x - 1.0) ** 2) / (2.0 * width**2)
        )

    fine = np.linspace(0.3, 10.0, 20000) / period
    return shape(np.asarray(f, float)) * height**2 / 16.0 / np.trapezoid(shape(fine), fine)


@dataclass(frozen=True)
class Components:
    """Waves that make up a sea: amplitude [m], frequency [rad/s] and phase [rad] of each, shape [n]."""

    amplitude: np.ndarray
    omega: np.ndarray
    phase: np.ndarray


def sea(
    *, height: float, period: float, spectrum: str, peak: float = 3.3, count: int = 128, seed: int = 1
) -> Components:
    """Components of an irregular sea between 0.5 and 3 times the peak frequency.

    Bands are as wide as each other, frequencies at random within them, so that the record does not repeat; phases are
    at random. Amplitudes sqrt(2 S df), scaled so that they have the energy of the whole spectrum.
    """
    edges = np.linspace(LOWEST, HIGHEST, count + 1) / period
    random = np.random.default_rng(seed)
    f = edges[:-1] + random.random(count) * np.diff(edges)
    amplitude = np.sqrt(2.0 * spectral_density(f, height=height, period=period, spectrum=spectrum, peak=peak))
    amplitude *= np.sqrt(np.diff(edges))
    amplitude *= height / 4.0 / math.sqrt(0.5 * float(amplitude @ amplitude))
    return Components(amplitude, 2.0 * math.pi * f, 2.0 * math.pi * random.random(count))


def spectral_density(f: ArrayLike, *, height: float, period: float, spectrum: str, peak: float = 3.3) -> np.ndarray:
    """S(f) [m2 s] of a spectrum by its name."""
    if spectrum == "jonswap":
        return jonswap(f, height=height, period=period, peak=peak)
    return pierson_moskowitz(f, height=height, period=period)


def focused(
    *,
    crest: float,
    period: float,
    place: float,
    time: float,
    depth: float,
    spectrum: str,
    peak: float = 3.3,
    count: int = 128,
    gravity: float = 9.81,
) -> Components:
    """Components whose crests meet `place` [m] from the paddle at a `time` [s], a `crest` [m] high by linear theory.

    Amplitudes go as S(f), the mean shape of a highest crest: Lindgren (1970), Tromans, Anaturk & Hagemeijer (1991).
    """
    f = np.linspace(LOWEST, HIGHEST, count) / period
    amplitude = spectral_density(f, height=1.0, period=period, spectrum=spectrum, peak=peak)
    omega = 2.0 * math.pi * f
    k = wavenumber(omega, depth=depth, gravity=gravity)
    return Components(crest * amplitude / amplitude.sum(), omega, k * place - omega * time)


def components_paddle(
    t: ArrayLike, waves: Components, *, depth: float, hinge: float | None = None, gravity: float = 9.81
) -> np.ndarray:
    """Way [m] of a paddle, at the still level, that makes waves a cos(w t - k x + phase): sum of a / (H / S) sin."""
    k = wavenumber(waves.omega, depth=depth, gravity=gravity)
    stroke = waves.amplitude / paddle_ratio(k, depth=depth, hinge=hinge)
    angle = np.multiply.outer(np.asarray(t, float), waves.omega) + waves.phase
    return np.sin(angle) @ stroke


def elevation(x: float, t: ArrayLike, waves: Components, *, depth: float, gravity: float = 9.81) -> np.ndarray:
    """Surface [m] at x from the paddle, by linear theory."""
    k = wavenumber(waves.omega, depth=depth, gravity=gravity)
    angle = np.multiply.outer(np.asarray(t, float), waves.omega) + waves.phase - k * x
    return np.cos(angle) @ waves.amplitude


# ------------------------------------------------------------------------------------------------------ solitary waves


def rayleigh_wave(s: ArrayLike, *, height: float, depth: float) -> np.ndarray:
    """Elevation [m] of a solitary wave at s = x - c t from its crest: H sech^2(b s), b^2 = 3 H / (4 d^2 (H + d)).

    Rayleigh (1876), with c^2 = g (d + H); of all simple ones it sheds the least tail: Katell & Eric (2002).
    """
    b = math.sqrt(0.75 * height / (depth**2 * (height + depth)))
    return height / np.cosh(b * np.asarray(s, float)) ** 2


def solitary_paddle(
    *, height: float, depth: float, gravity: float = 9.81, count: int = 400
) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and ways [m], each of shape [count], of a piston that makes a solitary wave and stays.

    The piston moves with the water, dx/dt = c eta / (d + eta) where it is (Goring 1978). Along s = c t - x that is
    dx/ds = eta / d, so that x = H / (b d) tanh(b s) and t = (s + x) / c without an iteration: Katell & Eric (2002).
    """
    b = math.sqrt(0.75 * height / (depth**2 * (height + depth)))
    c = math.sqrt(gravity * (depth + height))
    s = np.linspace(-SOLITARY_REACH, SOLITARY_REACH, count) / b
    way = height / (b * depth) * np.tanh(b * s)
    time = (s + way) / c
    return time - time[0], way - way[0]


def solitary_stroke(height: float, *, depth: float) -> float:
    """The whole way of the piston [m]: sqrt(16 H (H + d) / 3)."""
    return math.sqrt(16.0 * height * (height + depth) / 3.0)


# ---------------------------------------------------------------------------------------------------------- reflection


def reflection(places: ArrayLike, amplitudes: ArrayLike, k: float) -> tuple[float, float]:
    """Amplitudes [m] of the incident and the reflected wave, of three gauges or more: Mansard & Funke (1980).

    `amplitudes` are complex, a e^(-i phase) of cos(w t - phase) at each of the places [m]: the pair of waves
    e^(-i k x) and e^(i k x) that is nearest to them by least squares.
    """
    x = np.asarray(places, float)
    waves = np.stack([np.exp(-1j * k * (x - x[0])), np.exp(1j * k * (x - x[0]))], axis=1)
    (onward, back), *_ = np.linalg.lstsq(waves, np.asarray(amplitudes, complex), rcond=None)
    return float(abs(onward)), float(abs(back))
